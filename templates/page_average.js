// The average's page integrates X' = eps X hat(u): two exponentials a step (commutator-free, order 4), and the average in
// closed form. Phi(t) = exp(t sum eps^q F_q) exp(sum eps^q Lambda_q(t)) starts at the phase 0; from X0 at the phase p the way is
// X0 Phi(p)^-1 Phi(p + t) = X0 exp(-Lambda(p)) exp(t F) exp(Lambda(p + t)).
(() => {
  const s = data.solver, d = s.start.length, n = s.basis.length, row = s.steps;
  const hat = hatted(s.basis);
  const mix = (a, x, b, y) => x.map((v, i) => a * v + b * y[i]);
  const A1 = .25 + Math.sqrt(3) / 6, A2 = .25 - Math.sqrt(3) / 6;
  function states(eps, phase = 0) {
    const h = s.period / row, count = s.periods * row, actual = [s.start], mean = [];
    const steps = Array.from({ length: row }, (_, k) => {
      const a = s.u[2 * k], b = s.u[2 * k + 1];
      return product(expm(hat(mix(eps * h * A1, a, eps * h * A2, b))), expm(hat(mix(eps * h * A2, a, eps * h * A1, b))));
    });
    for (let k = 0; k < count; k++) actual.push(product(actual[k], steps[(k + phase) % row]));
    const drift = Array.from({ length: n }, (_, i) => s.F.reduce((sum, f, q) => sum + eps ** (q + 1) * f[i], 0));
    const Lambda = k => Array.from({ length: n }, (_, i) => s.Lambda.reduce((sum, table, q) => sum + eps ** (q + 1) * table[k][i], 0));
    const wobble = Array.from({ length: row }, (_, k) => expm(hat(Lambda(k))));
    const first = product(s.start, expm(hat(Lambda(phase).map(x => -x))));
    for (let k = 0; k <= count; k++) mean.push(product(product(first, expm(hat(drift.map(x => x * k * h)))), wobble[(k + phase) % row]));
    return { actual, mean, h };
  }
  function seen(X, i, m) {
    if (d === 4) { m.R.splice(9 * i, 9, ...[0, 1, 2].flatMap(r => X[r].slice(0, 3))); m.p.splice(3 * i, 3, X[0][3], X[1][3], X[2][3]); }
    else if (s.plane) { m.R.splice(9 * i, 9, X[0][0], X[0][1], 0, X[1][0], X[1][1], 0, 0, 0, 1); m.p.splice(3 * i, 3, X[0][2], X[1][2], 0); }
    else m.R.splice(9 * i, 9, ...X.flat());
  }
  function solve(eps, phase) {
    const { actual, mean, h } = states(eps, phase), last = actual.length - 1, gap = [];
    data.t = Array.from({ length: last + 1 }, (_, k) => k * h);
    data.motions.forEach(m => { m.R = new Array(9 * (last + 1)).fill(0); if (m.p) m.p = new Array(3 * (last + 1)).fill(0); });
    for (let k = 0; k <= last; k++) {
      seen(actual[k], k, data.motions[0]); seen(mean[k], k, data.motions[1]);
      gap.push(Math.hypot(...actual[k].flatMap((a, i) => a.map((x, j) => x - mean[k][i][j]))));
    }
    const u = k => mix(.5, s.u[2 * ((k + phase) % row)], .5, s.u[2 * ((k + phase) % row) + 1]);
    data.series[0].values = Array.from({ length: n }, (_, i) => data.t.map((_, k) => u(k)[i]));
    data.series[1] = { name: "|X - average|", unit: "", labels: [""], values: [gap] };
    element("time").max = last;
    place = Math.min(place, last);
    return { actual, mean };
  }
  element("knobs").innerHTML = '<label>Amplitude eps <input id="eps" type="range" min="0.02" step="0.01"> <output id="eps_now"></output></label>' +
    '<label>Phase at the start <input id="phase" type="range" min="0" step="1" value="0"> <output id="phase_now"></output></label>';
  element("eps").max = s.largest; element("eps").value = s.eps; element("phase").max = row - 1;
  const told = () => {
    element("eps_now").textContent = (+element("eps").value).toFixed(2);
    element("phase_now").textContent = (360 * element("phase").value / row).toFixed(0) + "\u00b0";
  };
  const turn = () => { told(); solve(+element("eps").value, +element("phase").value); show(); };
  element("eps").addEventListener("input", turn);
  element("phase").addEventListener("input", turn);
  told();
  window.lieAverage = { states };
})();
