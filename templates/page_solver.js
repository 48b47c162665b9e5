// Moving the target solves again: the generated C in WebAssembly, the same text that is compiled for Python and for flight.
(() => {
  const s = data.solver, d = s.basis[0].length, n = s.basis.length, bytes = Uint8Array.from(atob(s.wasm), c => c.charCodeAt(0));
  const hat = hatted(s.basis);
  // what the C library may ask of a system: nothing is given
  const none = new Proxy({}, { get: () => () => 52 });
  const module = new WebAssembly.Module(bytes), program = new WebAssembly.Instance(module, { wasi_snapshot_preview1: none }).exports;
  if (program._initialize) program._initialize();
  const doubles = (at, count) => new Float64Array(program.memory.buffer, at, count);
  function solve(x) {
    const goal = expm(hat(x));
    doubles(program.lie_target(), d * d).set(goal.flat());
    doubles(program.lie_weights(), s.controls).set(s.weights);
    const started = performance.now(), status = program.lie_solve(), spent = performance.now() - started;
    const X = Array.from(doubles(program.lie_X(), s.points * d * d)), u = Array.from(doubles(program.lie_u(), s.points * s.controls));
    return { status, spent, cost: doubles(program.lie_cost(), 1)[0] / s.duration, X, u, goal };
  }
  function take(found) {
    const m = data.motions[0], size = d * d;
    data.t = Array.from({ length: s.points }, (_, k) => s.duration * k / (s.points - 1));
    m.R = []; if (m.p) m.p = [];
    for (let k = 0; k < s.points; k++) {
      const X = found.X.slice(size * k, size * (k + 1)), at = (i, j) => X[d * i + j];
      if (s.plane) { m.R.push(at(0, 0), at(0, 1), 0, at(1, 0), at(1, 1), 0, 0, 0, 1); m.p.push(at(0, 2), at(1, 2), 0); }
      else { for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) m.R.push(at(i, j)); if (m.p) m.p.push(at(0, 3), at(1, 3), at(2, 3)); }
    }
    if (data.target) data.target.p = s.plane ? [found.goal[0][2], found.goal[1][2], 0] : [0, 1, 2].map(i => found.goal[i][3]);
    data.series[0].values = Array.from({ length: s.controls }, (_, c) => data.t.map((_, k) => found.u[s.controls * k + c] / s.duration));
    data.series[1].name = "|X - target|";
    data.series[1].values = [data.t.map((_, k) => Math.hypot(...found.goal.flat().map((v, i) => found.X[size * k + i] - v)))];
    data.facts = [["cost", found.cost.toPrecision(12)], ["solver", found.status === 1 ? "an extremal that ends at the target, the cheapest found" : "no plan found for this target"], ["time of the solver", found.spent.toFixed(2) + " ms"]];
    element("time").max = s.points - 1;
    place = Math.min(place, s.points - 1);
    facts();
  }
  const x = [...s.target];
  let goal;
  const sliders = x.map((_, i) => {
    const label = document.createElement("label"), range = document.createElement("input"), now = document.createElement("output");
    range.type = "range"; range.max = 3; range.step = .01; range.id = "target_" + i;
    label.append("target " + s.labels[i] + " ", range, now);
    range.addEventListener("input", () => moveTo(x.map((value, k) => k === i ? +range.value : value)));
    element("knobs").append(label);
    return { range, now };
  });
  // the target's logarithm, from a slider or from elsewhere: every slider shows it, to its step; the solver has it to the last bit
  function moveTo(values) {
    values.forEach((value, i) => {
      const { range, now } = sliders[i], most = Math.max(+range.max, Math.ceil(Math.abs(value)));
      x[i] = value;
      range.max = most; range.min = -most; range.value = value;
      now.textContent = value.toFixed(2) + " " + s.units[i];
    });
    const found = solve(x);
    goal = found.goal;
    take(found);
    show();
  }
  element("words").textContent = "Move the target: the generated C solves again in this page.";
  window.lieSolver = { solve, moveTo, get x() { return [...x]; }, get goal() { return goal; } };
  moveTo(x);
})();
