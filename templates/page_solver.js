// Moving the target solves again: the generated C in WebAssembly, the same text that is compiled for Python and for flight.
(() => {
  // of complex groups d rows of real matrices, a + ib as [[a, -b], [b, a]]; C has the two numbers a, b of each entry
  const s = data.solver, d = s.basis[0].length, size = s.complex ? d * d / 2 : d * d, bytes = Uint8Array.from(atob(s.wasm), c => c.charCodeAt(0));
  const hat = hatted(s.basis), transposed = A => A[0].map((_, j) => A.map(a => a[j]));
  const entries = A => s.complex ? A.flatMap((row, i) => i % 2 ? [] : row.flatMap((a, j) => j % 2 ? [] : [a, A[i + 1][j]])) : A.flat();
  function matrix(X) {
    if (!s.complex) return Array.from({ length: d }, (_, i) => X.slice(d * i, d * (i + 1)));
    return Array.from({ length: d }, (_, i) => Array.from({ length: d }, (_, j) => {
      const at = d * (i >> 1) + 2 * (j >> 1), [a, b] = [X[at], X[at + 1]];
      return (i + j) % 2 === 0 ? a : i % 2 ? b : -b;
    }));
  }
  // where a body stands that an element moves: of SU(2) its Ad, whose column j is X A_j X^-1; X is unitary
  function pose(A) {
    const back = s.complex && transposed(A);
    if (s.complex) return { R: transposed(s.basis.map(basis => { const image = product(product(A, basis), back).flat(); return s.vee.map(row => dot(row, image)); })), p: [0, 0, 0] };
    if (s.plane) return { R: [[A[0][0], A[0][1], 0], [A[1][0], A[1][1], 0], [0, 0, 1]], p: [A[0][2], A[1][2], 0] };
    return { R: [0, 1, 2].map(i => A[i].slice(0, 3)), p: d === 4 ? [0, 1, 2].map(i => A[i][3]) : [0, 0, 0] };
  }
  // what the C library may ask of a system: nothing is given
  const none = new Proxy({}, { get: () => () => 52 });
  const module = new WebAssembly.Module(bytes), program = new WebAssembly.Instance(module, { wasi_snapshot_preview1: none }).exports;
  if (program._initialize) program._initialize();
  const doubles = (at, count) => new Float64Array(program.memory.buffer, at, count);
  function solve(x) {
    const goal = expm(hat(x));
    doubles(program.lie_target(), size).set(entries(goal));
    doubles(program.lie_weights(), s.controls).set(s.weights);
    const started = performance.now(), status = program.lie_solve(), spent = performance.now() - started;
    const X = Array.from(doubles(program.lie_X(), s.points * size)), u = Array.from(doubles(program.lie_u(), s.points * s.controls));
    return { status, spent, cost: doubles(program.lie_cost(), 1)[0] / s.duration, X, u, goal };
  }
  function take(found) {
    const m = data.motions[0], end = entries(found.goal);
    data.t = Array.from({ length: s.points }, (_, k) => s.duration * k / (s.points - 1));
    m.R = []; if (m.p) m.p = [];
    for (let k = 0; k < s.points; k++) {
      const { R, p } = pose(matrix(found.X.slice(size * k, size * (k + 1))));
      m.R.push(...R.flat());
      if (m.p) m.p.push(...p);
    }
    if (data.target) { const { R, p } = pose(found.goal); Object.assign(data.target, { R: R.flat(), p }); }
    data.series[0].values = Array.from({ length: s.controls }, (_, c) => data.t.map((_, k) => found.u[s.controls * k + c] / s.duration));
    data.series[1].name = "|X - target|";
    data.series[1].values = [data.t.map((_, k) => Math.hypot(...end.map((v, i) => found.X[size * k + i] - v)))];
    data.facts = [["cost", found.cost.toPrecision(12)], ["solver", found.status === 1 ? "an extremal that ends at the target, the cheapest found" : "no plan found for this target"], ["time of the solver", found.spent.toFixed(2) + " ms"]];
    element("time").max = s.points - 1;
    place = Math.min(place, s.points - 1);
    facts();
  }
  const x = [...s.target];
  let goal, frame;
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
    goal = found.goal; frame = pose(goal);
    take(found);
    show();
  }
  element("words").textContent = "Move the target: the generated C solves again in this page.";
  window.lieSolver = { solve, moveTo, get x() { return [...x]; }, get goal() { return goal; }, get frame() { return frame; } };
  moveTo(x);
})();
