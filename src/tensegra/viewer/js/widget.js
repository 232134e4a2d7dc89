// The viewer as a widget of a notebook: `frame`, `inputs` and `selected` go both ways.
function render({ model, el }) {
  const box = el.appendChild(document.createElement("div"));
  box.style.height = model.get("height") + "px";
  const viewer = mount(box, model.get("scene"), { frame: model.get("frame") });
  let quiet = false;
  viewer.addEventListener("frame", () => {
    const frame = Math.round(viewer.frame);
    if (quiet || viewer.playing || frame === model.get("frame")) return;
    model.set("frame", frame);
    model.save_changes();
  });
  viewer.addEventListener("select", () => {
    const { selected, node } = viewer.look;
    model.set("selected", viewer.scene.members[selected] ?? viewer.scene.nodes[node] ?? "");
    model.save_changes();
  });
  model.on("change:scene", () => viewer.setScene(model.get("scene"), { keepView: true }));
  model.on("change:frame", () => { quiet = true; viewer.goto(model.get("frame")); quiet = false; });
  const form = el.appendChild(document.createElement("form"));
  for (const [name, value] of Object.entries(model.get("inputs"))) {
    const label = form.appendChild(document.createElement("label"));
    const slider = make("input", { type: "range", min: Math.min(-0.15, value), max: Math.max(0.15, value), step: "any", value });
    label.append(name + " ", slider);
    slider.oninput = () => {
      model.set("inputs", { ...model.get("inputs"), [name]: Number(slider.value) });
      model.save_changes();
    };
    model.on("change:inputs", () => { slider.value = model.get("inputs")[name]; });
  }
  const told = el.appendChild(document.createElement("output"));
  const tell = () => { told.textContent = model.get("told"); };
  model.on("change:told", tell);
  tell();
}
export default { render };
