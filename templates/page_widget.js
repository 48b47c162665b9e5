// The widget of lc.widget: the page in a frame, its place in time shared with Python.
function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.title = "A motion, its controls and errors over time";
  frame.style.cssText = "width: 100%; border: 0; display: block;";
  // as tall as the page, whose charts lie beside the view or below it as the cell is wide, unless a height was asked for
  const tall = () => {
    const inside = frame.contentDocument && frame.contentDocument.documentElement;
    frame.style.height = (model.get("height") || Math.max(200, inside ? inside.offsetHeight : 0)) + "px";
  };
  let watch = null;
  const go = () => {
    const view = frame.contentWindow && frame.contentWindow.lieView;
    if (view && view.place !== model.get("place")) view.go(model.get("place"));
  };
  frame.addEventListener("load", () => {
    const view = frame.contentWindow.lieView;
    if (!view) return;
    tall();
    if (watch) watch.disconnect();
    watch = new ResizeObserver(tall);
    watch.observe(frame.contentDocument.documentElement);
    go();
    view.heard = place => { if (place !== model.get("place")) { model.set("place", place); model.save_changes(); } };
  });
  const load = () => { frame.srcdoc = model.get("page"); };
  model.on("change:page", load);
  model.on("change:height", tall);
  model.on("change:place", go);
  tall(); load();
  el.appendChild(frame);
  return () => { if (watch) watch.disconnect(); model.off("change:page", load); model.off("change:height", tall); model.off("change:place", go); };
}
export default { render };
