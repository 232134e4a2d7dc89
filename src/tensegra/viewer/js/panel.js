// What stands around the canvas: views, colours, switches, the path's slider, the legend, what is selected.
import { MODES, digits } from "./colours.js";
import { Viewer } from "./viewer.js";

function make(tag, properties = {}, ...children) {
  const { data, ...plain } = properties;
  const element = Object.assign(document.createElement(tag), plain);
  for (const [name, value] of Object.entries(data || {})) element.dataset[name] = value;
  element.append(...children);
  return element;
}

function save(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// A viewer with its controls in an element; returns the viewer.
export function mount(element, content, options = {}) {
  const bar = make("div", { className: "tv-bar", role: "group" });
  bar.setAttribute("aria-label", "View");
  const stage = make("div", { className: "tv-stage" });
  const foot = make("div", { className: "tv-foot" });
  const told = make("p", { className: "tv-told" });
  told.setAttribute("aria-live", "polite");
  const legend = make("div", { className: "tv-legend" });
  element.classList.add("tensegra-panel");
  element.append(bar, stage, foot);
  stage.append(legend, told);
  const viewer = new Viewer(stage, content, options);
  fillBar(bar, viewer);
  if (!options.still) fillFoot(foot, viewer);
  const redraw = () => { showLegend(legend, viewer); showSelected(told, viewer); };
  for (const type of ["look", "scene", "select"]) viewer.addEventListener(type, redraw);
  let shown = 0;
  viewer.addEventListener("draw", () => {
    // The words follow the picture, but not sixty times a second.
    if (performance.now() - shown < 100 && viewer.playing) return;
    shown = performance.now();
    showSelected(told, viewer);
    if (viewer.range !== legend.range || viewer.colours !== legend.colours) showLegend(legend, viewer);
  });
  redraw();
  if (viewer.fault) told.textContent = `${viewer.fault}: the picture is drawn as lines.`;
  return viewer;
}

function button(text, title, act) {
  return make("button", { type: "button", textContent: text, title, onclick: act });
}

function fillBar(bar, viewer) {
  const views = { oblique: "3D", front: "xz", side: "yz", top: "xy" };
  for (const [view, text] of Object.entries(views)) {
    bar.append(button(text, `${view} view`, () => viewer.view(view)));
  }
  const colour = make("select", { title: "What the colours show" });
  colour.setAttribute("aria-label", "Colour by");
  colour.onchange = () => viewer.set({ mode: colour.value });
  bar.append(colour);
  const switches = { nodeNames: "nodes", memberNames: "members", ghost: "reference", supports: "supports", forces: "forces" };
  const boxes = Object.entries(switches).map(([name, text]) => {
    const box = make("input", { type: "checkbox" });
    box.onchange = () => viewer.set({ [name]: box.checked });
    bar.append(make("label", {}, box, ` ${text}`));
    return [name, box];
  });
  const file = () => viewer.scene.name.replace(/[^\w.-]+/g, "_") || "structure";
  bar.append(
    button("PNG", "Save the picture as PNG", async () => save(`${file()}.png`, await viewer.png())),
    button("SVG", "Save the picture as SVG", () => save(`${file()}.svg`, new Blob([viewer.svg], { type: "image/svg+xml" }))),
  );
  const reflect = () => {
    for (const [name, box] of boxes) box.checked = Boolean(viewer.look[name]);
    const offered = Object.keys(MODES).filter((mode) => mode === "kind" || (viewer.scene.tensions && (mode !== "utilisation" || viewer.scene.hasLimits)));
    colour.replaceChildren(...offered.map((mode) => make("option", { value: mode, textContent: MODES[mode] })));
    colour.value = viewer.look.mode;
  };
  viewer.addEventListener("look", reflect);
  viewer.addEventListener("scene", () => { viewer.range = null; reflect(); });
  reflect();
}

function fillFoot(foot, viewer) {
  const play = button("▶", "Play", () => viewer.play());
  const slider = make("input", { type: "range", min: 0, step: "any" });
  slider.setAttribute("aria-label", "Place along the path");
  slider.oninput = () => { viewer.play(false); viewer.goto(Number(slider.value)); };
  const where = make("output", { className: "tv-where" });
  const mode = make("select", { title: "Mode shapes and mechanisms" });
  mode.setAttribute("aria-label", "Mode");
  mode.onchange = () => viewer.swing(Number(mode.value));
  foot.append(play, slider, where, mode);
  const place = () => {
    slider.value = viewer.frame;
    const nearest = Math.round(viewer.frame);
    const status = viewer.scene.statuses[nearest];
    where.textContent = `${viewer.scene.labels[nearest]}${status ? ` · ${status}` : ""}`;
    slider.setAttribute("aria-valuetext", where.textContent);
  };
  const renew = () => {
    const { scene } = viewer;
    slider.max = scene.nFrames - 1;
    slider.hidden = scene.nFrames < 2;
    mode.replaceChildren(
      make("option", { value: -1, textContent: "no mode" }),
      ...scene.modes.map(({ name }, i) => make("option", { value: i, textContent: name })),
    );
    mode.value = viewer.modeIndex;
    mode.hidden = scene.modes.length === 0;
    play.hidden = slider.hidden && mode.hidden;
    foot.hidden = play.hidden && scene.labels.length < 2;
    place();
  };
  viewer.addEventListener("frame", place);
  viewer.addEventListener("scene", renew);
  viewer.addEventListener("play", () => {
    play.textContent = viewer.playing ? "❚❚" : "▶";
    play.setAttribute("aria-label", viewer.playing ? "Pause" : "Play");
    mode.value = viewer.modeIndex;
  });
  renew();
}

function showLegend(legend, viewer) {
  const { title, stops, ticks, unit } = viewer.legend;
  Object.assign(legend, { range: viewer.range, colours: viewer.colours });
  if (!stops) {
    legend.replaceChildren(...viewer.kinds.map(([label, colour, look]) => {
      const sample = make("span", { className: `tv-sample ${look}` });
      sample.style.background = look === "striped" ? `linear-gradient(${colour} 36%, ${viewer.colours.paper} 36% 64%, ${colour} 64%)` : colour;
      return make("span", { className: "tv-entry" }, sample, label);
    }), make("span", { className: "tv-entry" }, make("span", { className: "tv-sample dashed" }), "slack"));
    return;
  }
  const scale = make("div", { className: "tv-scale" });
  scale.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
  const marks = make("div", { className: "tv-ticks" }, ...ticks.map((tick) => make("span", { textContent: digits(tick, 3) })));
  const words = viewer.look.mode === "utilisation" ? "" : " (− compression)";
  legend.replaceChildren(make("div", { textContent: `${title}${unit ? `, ${unit}` : ""}${words}` }), make("div", {}, scale, marks));
}

function showSelected(told, viewer) {
  const { look, scene } = viewer;
  const text = look.selected !== null ? memberText(scene, viewer.state, look.selected)
    : look.node !== null ? nodeText(scene, viewer.state, look.node) : "";
  if (told.textContent !== text && !(viewer.fault && !text)) told.textContent = text;
}

function memberText(scene, state, e) {
  const word = { strut: "strut", cable: "cable", clustered: "clustered cable" }[scene.kinds[e]];
  const { length, force } = scene.units;
  const parts = [`${scene.members[e]}, ${word}`, `length ${digits(state.lengths[e], 5)} ${length}`];
  if (state.tensions) {
    if (state.slack(e)) parts.push("slack");
    else {
      parts.push(`tension ${digits(state.tensions[e], 5)} ${force}`, `strain ${digits(state.strain(e), 3)}`);
      const share = state.utilisation(e);
      if (Number.isFinite(share)) parts.push(`utilisation ${digits(100 * share, 3)} %`);
    }
  }
  return parts.join(" · ");
}

function nodeText(scene, state, n) {
  const { length, force } = scene.units;
  const vector = (values) => Array.from(values.slice(3 * n, 3 * n + 3), (value) => digits(value, 5)).join(", ");
  const parts = [`node ${scene.nodes[n]}`, `at ${vector(state.positions)} ${length}`];
  if (scene.reference) parts.push(`moved ${vector(state.positions.map((x, i) => x - scene.reference[i]))} ${length}`);
  const held = scene.supports.find(([node]) => node === n);
  if (held) parts.push(`held along ${held[1]}`);
  if (held && state.reactions) parts.push(`reaction ${vector(state.reactions)} ${force}`);
  return parts.join(" · ");
}
