// The target in the view: its axes, dashed, with rings where a pointer takes hold of it; each move solves again, as its sliders do.
(() => {
  const s = data.solver, m = data.motions[0], canvas = element("space"), plane = m.kind === "plane";
  // only where the three sliders are all of the target: SO(3), SU(2), SE(2); elsewhere a pointer could ask for what the group has not
  if (s.basis.length !== 3 || !(plane || m.kind === "rotation")) return;
  const axes = plane ? [0, 1] : [0, 1, 2];
  const centre = () => window.lieSolver.frame.p;
  const axis = k => window.lieSolver.frame.R.map(row => row[k]);
  const along = (k, share) => add(centre(), scaled(axis(k), share * m.axes));
  const skew = ([x, y, z]) => [[0, -z, y], [z, 0, -x], [-y, x, 0]], hat = hatted(s.basis);
  // the element that turns the body by a rotation vector; on SU(2) ad_w = c [w]x, with [A_1, A_2] = c A_3
  const twist = s.complex ? dot(s.vee[2], product(s.basis[0], s.basis[1]).flat().map((a, i) => a - product(s.basis[1], s.basis[0]).flat()[i])) : 1;
  const turning = w => expm(s.complex ? hat(scaled(w, 1 / twist)) : skew(w));

  // the principal logarithm, a matrix of the algebra
  function logarithm(goal) {
    if (plane) {
      const turn = Math.atan2(goal[1][0], goal[0][0]), half = turn / 2, a = half ? half / Math.tan(half) : 1, x = goal[0][2], y = goal[1][2];
      return [[0, -turn, a * x + half * y], [turn, 0, a * y - half * x], [0, 0, 0]];
    }
    if (s.complex) {
      // exp(W) = cos(f) 1 + sin(f)/f W, with |W| = 2 f in its four rows of real numbers
      const odd = goal.map((row, i) => row.map((a, j) => (a - goal[j][i]) / 2)), sine = Math.hypot(...odd.flat()) / 2;
      const f = Math.atan2(sine, goal.reduce((sum, row, i) => sum + row[i], 0) / 4);
      return odd.map(row => scaled(row, sine ? f / sine : 1));
    }
    // row i is 4 q_i q of the unit quaternion q; the row of the largest q_i keeps its digits at half turns too
    const [[a, b, c], [d, e, f], [g, h, i]] = goal;
    const rows = [[1 + a + e + i, h - f, c - g, d - b], [h - f, 1 + a - e - i, b + d, c + g], [c - g, b + d, 1 - a + e - i, f + h], [d - b, c + g, f + h, 1 - a - e + i]];
    const row = rows.reduce((best, each, k) => each[k] > best[0] ? [each[k], each] : best, [0, null])[1];
    const q = scaled(unit(row), row[0] < 0 ? -1 : 1), sine = Math.hypot(q[1], q[2], q[3]);
    return skew(scaled(q.slice(1), sine ? 2 * Math.atan2(sine, q[0]) / sine : 2));
  }
  const moveTo = goal => { const W = logarithm(goal).flat(); window.lieSolver.moveTo(s.vee.map(row => dot(row, W))); };

  // where a pointer takes hold: of a ring, or of an axis; near the middle axes meet, and a small move would be a large turn
  const NEAREST = .35;
  function gripAt(x, y, wide) {
    const project = projector(canvas.clientWidth, canvas.clientHeight);
    const apart = v => { const p = project(v); return Math.hypot(p[0] - x, p[1] - y); };
    const rings = axes.map(k => ({ k, share: 1, apart: apart(along(k, 1)) }));
    if (plane) rings.push({ k: -1, share: 0, apart: apart(centre()) });
    const nearest = list => list.reduce((a, b) => b.apart < a.apart ? b : a);
    const ring = nearest(rings);
    if (ring.apart < (wide ? 26 : 13)) return ring;
    const line = nearest(axes.map(k => {
      const from = project(centre()), to = project(along(k, 1)), way = [to[0] - from[0], to[1] - from[1]];
      const foot = ((x - from[0]) * way[0] + (y - from[1]) * way[1]) / (way[0] ** 2 + way[1] ** 2 || 1), share = Math.max(NEAREST, Math.min(1, foot));
      return { k, share, apart: apart(along(k, share)) };
    }));
    return line.apart < (wide ? 14 : 7) ? line : null;
  }

  // a point of the view, in units of space from its middle, to the right and up
  function inView(x, y) {
    const project = projector(canvas.clientWidth, canvas.clientHeight), view = camera();
    const o = project(data.middle), scale = project(add(data.middle, view.right))[0] - o[0];
    return [(x - o[0]) / scale, (o[1] - y) / scale];
  }
  function drag(grip, x, y) {
    const goal = window.lieSolver.goal.map(row => [...row]), [across, up] = inView(x, y), view = camera();
    if (plane) {
      const at = add(data.middle, [across, up, 0]);
      if (grip.k < 0) { goal[0][2] = at[0]; goal[1][2] = at[1]; moveTo(goal); return; }
      const turn = Math.atan2(at[1] - goal[1][2], at[0] - goal[0][2]) - grip.k * Math.PI / 2, c = Math.cos(turn), n = Math.sin(turn);
      moveTo([[c, -n, goal[0][2]], [n, c, goal[1][2]], [0, 0, 1]]);
      return;
    }
    // on the sphere of what is held, the side of it that was taken; past its rim the axis rolls over to the other side
    const size = grip.share * m.axes, out = Math.hypot(across, up), over = out > size, r = over ? Math.max(0, 2 * size - out) : out;
    const depth = (over ? -1 : 1) * grip.side * Math.sqrt(size ** 2 - r ** 2), shrink = out ? r / out : 0;
    const to = unit(add(add(scaled(view.right, across * shrink), scaled(view.up, up * shrink)), scaled(view.out, depth)));
    // the least turn that takes the axis there
    const from = axis(grip.k), about = cross(from, to), sine = Math.hypot(...about);
    if (sine > 1e-12) moveTo(product(turning(scaled(about, Math.atan2(sine, dot(from, to)) / sine)), goal));
  }

  const here = e => { const box = canvas.getBoundingClientRect(); return [e.clientX - box.left, e.clientY - box.top]; };
  let held = null;
  // before the camera hears of it: what takes hold of the target does not turn the view
  const first = (name, hears) => canvas.addEventListener(name, hears, { capture: true });
  first("pointerdown", e => {
    if (held || pointers.size || e.button) return;
    const [x, y] = here(e), grip = gripAt(x, y, e.pointerType !== "mouse");
    if (!grip) return;
    const v = grip.k < 0 ? centre() : along(grip.k, grip.share);
    const p = projector(canvas.clientWidth, canvas.clientHeight)(v);
    held = { ...grip, id: e.pointerId, off: [p[0] - x, p[1] - y], side: dot(v, camera().out) < 0 ? -1 : 1 };
    canvas.setPointerCapture(e.pointerId); canvas.style.cursor = "grabbing";
    e.stopImmediatePropagation();
  });
  first("pointermove", e => {
    const [x, y] = here(e);
    if (held && held.id === e.pointerId) {
      // the target stays in sight
      drag(held, Math.max(0, Math.min(canvas.clientWidth, x + held.off[0])), Math.max(0, Math.min(canvas.clientHeight, y + held.off[1])));
      e.stopImmediatePropagation();
    } else if (!held && !pointers.size) canvas.style.cursor = gripAt(x, y, false) ? "grab" : "";
  });
  for (const end of ["pointerup", "pointercancel"]) first(end, e => {
    if (!held || held.id !== e.pointerId) return;
    held = null; canvas.style.cursor = "";
    e.stopImmediatePropagation();
  });

  overlays.push((pen, project) => {
    const ring = (v, tint) => {
      const [x, y] = project(v);
      pen.beginPath(); pen.arc(x, y, 6, 0, 2 * Math.PI);
      pen.fillStyle = colour("panel"); pen.fill(); pen.strokeStyle = tint; pen.lineWidth = 2; pen.stroke();
    };
    for (const k of axes) path(pen, [project(centre()), project(along(k, 1))], colour(SERIES[k]), 1.6, [4, 4]);
    for (const k of axes) ring(along(k, 1), colour(SERIES[k]));
    if (plane) ring(centre(), colour("ink"));
  });
  // where a pointer would take hold, in pixels of the page: for tests and for those who drive the page by script
  window.lieSolver.ring = k => {
    const box = canvas.getBoundingClientRect(), p = projector(canvas.clientWidth, canvas.clientHeight)(k < 0 ? centre() : along(k, 1));
    return [box.left + p[0], box.top + p[1]];
  };
  element("words").textContent = "Drag the target or move its sliders: the generated C solves again in this page.";
  element("legend").textContent += plane ? " Dashed: the target; drag the ring at its middle to move it, those at the tips of its axes to turn it." : " Dashed: the target; drag the rings at the tips of its axes to turn it.";
  canvas.setAttribute("aria-label", canvas.getAttribute("aria-label") + "; the target is dragged by its rings, or moved by its sliders, which keys reach");
})();
