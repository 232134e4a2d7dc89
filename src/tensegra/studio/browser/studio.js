// The page: the viewer in its middle, inputs to the left, where it stands to the right.

let viewer = null;
let units = null;
let latest = null;
let snapped = null;

const talk = new Talk((message) => (ANSWERS[message.type] || (() => {}))(message));
const inputs = new Inputs(byId("knobs"), (values, gesture) => {
  if (snapped && snapped.gesture !== gesture) forgetSnap();
  talk.say({ type: "move", values, gesture });
});
const campaign = new Campaign(byId("campaign"), talk);
const editing = new Editing(byId("editing"), talk);

const ANSWERS = {
  opened(message) {
    units = message.units;
    byId("title").textContent = message.scene.name;
    byId("kind").textContent = message.structure;
    document.title = `${message.scene.name} – tensegra studio`;
    if (viewer) viewer.setScene(message.scene, { keepView: Boolean(viewer.touched) });
    else {
      viewer = mount(byId("viewer"), message.scene);
      viewer.addEventListener("draw", () => { document.body.dataset.drawn = viewer.drawn; });
    }
    inputs.show(message.knobs, Boolean(message.state));
    fillWatch(message);
    campaign.show(message);
    editing.show(message, viewer);
    tellFault(message.fault ? `It does not stand: ${message.fault}` : "");
    forgetSnap();
    if (message.state) apply(message.state);
    else showFallen(message.fault);
    if (byId("editing").open) editing.ask();
    document.body.dataset.ready = "yes";
  },
  state(message) {
    latest = message;
    viewer.show(message.positions, message.tensions, message.forces, snapped && snapped.before ? snapped.before : true);
    if (message.before) tellSnap(message);
    requestAnimationFrame(() => { if (latest === message) apply(message.state); });
  },
  knob({ knob }) {
    inputs.add(knob);
    tellFault("");
  },
  modes(message) {
    const size = 3 * viewer.scene.nodes.length;
    viewer.scene.modes = message.names.map((name, i) => ({ name, shape: message.shapes.subarray(i * size, (i + 1) * size) }));
    viewer.tell("scene");
    viewer.swing(0);
  },
  spread: (message) => campaign.spread(message),
  optimum: (message) => campaign.found(message, (values) => {
    inputs.gesture += 1;
    talk.say({ type: "move", values, gesture: inputs.gesture });
  }),
  verdict: (message) => editing.tell(message),
  export: (message) => offerExport(message),
  file(message) {
    const name = `${fileName()}${message.standing ? "-standing" : ""}.yaml`;
    save(name, new Blob([message.text], { type: "application/yaml" }));
  },
  fault(message) {
    tellFault(message.text);
    if (message.to === "spread") campaign.answered();
    if (message.to === "optimise") campaign.optimum.textContent = "";
    if (message.to === "move" && inputs.values) inputs.reflect(inputs.values, false);
  },
};

// What is shown, to be looked at from the browser's console and by tests.
window.tensegra = {
  get viewer() { return viewer; },
  get values() { return inputs.values; },
  get state() { return latest && latest.state; },
};

function apply(state) {
  showState(state, units);
  inputs.reflect(state.values, state.moved);
  campaign.state(state);
  if (state.moved && byId("fault").textContent && !byId("fault").textContent.startsWith("The server")) tellFault("");
}

// A snap is shown as such: where it stood before stays as the ghost until the next gesture.
function tellSnap(message) {
  snapped = { before: message.before, after: message, gesture: inputs.gesture };
  byId("snap-text").textContent = `It snapped: ${message.state.snaps.at(-1) || message.state.reason}`;
  byId("snap").hidden = false;
  viewer.show(message.positions, message.tensions, message.forces, message.before);
}

function forgetSnap() {
  snapped = null;
  byId("snap").hidden = true;
}

function fillWatch(message) {
  const form = byId("watch");
  form.elements.nodes.value = message.watched[0].join(", ");
  form.elements.axis.value = message.watched[1];
  const nodes = byId("add-load").elements.node;
  nodes.replaceChildren(...message.scene.nodes.map((node) => make("option", { textContent: node })));
}

function watch(event) {
  event.preventDefault();
  const { nodes, axis } = byId("watch").elements;
  talk.say({ type: "watch", nodes: nodes.value.split(/[\s,]+/).filter(Boolean), axis: axis.value });
}

const fileName = () => viewer.scene.name.replace(/[^\w.-]+/g, "_");

function offerExport(message) {
  const dialog = byId("export-dialog");
  const texts = { "Command line": message.command, Python: message.python, JSON: message.json };
  dialog.replaceChildren(
    ...Object.entries(texts).flatMap(([title, text]) => {
      const area = make("textarea", { value: text, readOnly: true });
      area.setAttribute("aria-label", title);
      const copy = async () => {
        area.select();
        try { await navigator.clipboard.writeText(text); } catch { /* the text is selected: the keyboard copies it */ }
      };
      return [make("div", { className: "row" }, make("strong", { textContent: title }), button("Copy", `Copy: ${title}`, copy)), area];
    }),
    make("div", { className: "row" },
      button("Save the structure", "As a file that the command line reads", () => talk.say({ type: "file", standing: false })),
      button("Save it as it stands", "With a stage more, that takes it to where it stands", () => talk.say({ type: "file", standing: true })),
      button("Save the JSON", "The state with its certificate", () => save(`${fileName()}.json`, new Blob([message.json], { type: "application/json" }))),
      button("Close", "Close", () => dialog.close())),
  );
  dialog.showModal();
}

// The picture as a film, from one press to the next.
let film = null;
function record() {
  if (film) { film.stop(); return; }
  const parts = [];
  film = new MediaRecorder(viewer.canvas.captureStream(30));
  film.ondataavailable = (event) => parts.push(event.data);
  film.onstop = () => {
    save("structure.webm", new Blob(parts, { type: film.mimeType }));
    film = null;
    byId("record").textContent = "Record";
  };
  film.start();
  byId("record").textContent = "Stop and save";
}

byId("undo").onclick = () => { forgetSnap(); talk.say({ type: "undo" }); };
byId("reset").onclick = () => { forgetSnap(); talk.say({ type: "reset" }); };
byId("modes").onclick = () => talk.say({ type: "modes" });
byId("export").onclick = () => talk.say({ type: "export" });
byId("record").onclick = record;
byId("theme").onclick = () => {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
};
byId("watch").addEventListener("change", watch);
byId("watch").addEventListener("submit", watch);
byId("add-load").addEventListener("submit", (event) => {
  event.preventDefault();
  const { node, axis } = event.target.elements;
  talk.say({ type: "load", node: node.value, axis: axis.value });
});
byId("editing").addEventListener("toggle", () => { if (byId("editing").open) editing.ask(); });
byId("snap-before").onclick = () => viewer.show(snapped.before, null, null, snapped.after.positions);
byId("snap-after").onclick = () => viewer.show(snapped.after.positions, snapped.after.tensions, snapped.after.forces, snapped.before);
document.addEventListener("keydown", (event) => {
  if ((event.ctrlKey || event.metaKey) && event.key === "z" && !/^(INPUT|TEXTAREA)$/.test(event.target.tagName)) byId("undo").click();
});
