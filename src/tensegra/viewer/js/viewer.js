// The viewer: a canvas that shows a scene, turned by hand, touch and keys.
import { clamp } from "./algebra.js";
import { Camera } from "./camera.js";
import { digits, legendOf, palette, rangeOf } from "./colours.js";
import { drawNames, find, namesOf, svgLegend, svgOf } from "./flat.js";
import { Painter } from "./painter.js";
import { partsOf } from "./parts.js";
import { Scene, State } from "./scene.js";

const SWING = 0.12; // of the structure's size, the amplitude of a mode
const PERIOD = 2400; // milliseconds of a swing
const ROOMY = 30; // pixels of a segment that are enough for full widths
const RUN = 4000; // milliseconds of a path from its beginning to its end

export class Viewer extends EventTarget {
  constructor(element, content, options = {}) {
    super();
    this.element = element;
    element.classList.add("tensegra-viewer");
    this.canvas = element.appendChild(document.createElement("canvas"));
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.overlay = element.appendChild(document.createElement("canvas"));
    this.overlay.className = "names";
    this.overlay.setAttribute("aria-hidden", "true");
    this.camera = new Camera();
    this.look = {
      mode: "kind", ghost: true, supports: true, forces: false, nodeNames: false, memberNames: false,
      selected: null, node: null, ...options.look,
    };
    this.frame = 0;
    this.modeIndex = -1;
    this.playing = false;
    this.drawn = 0;
    try {
      this.painter = new Painter(this.canvas);
    } catch (fault) {
      this.fault = fault.message; // the picture is then drawn as SVG
      this.still = element.appendChild(document.createElement("div"));
      this.still.className = "still";
    }
    this.follow();
    this.setScene(content, options);
    this.listen();
  }

  // Follow the element's size and the reader's choice of light and dark.
  follow() {
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dark.addEventListener("change", () => this.refresh());
    new MutationObserver(() => this.refresh()).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    new ResizeObserver(() => this.resize()).observe(this.element);
  }

  setScene(content, { keepView = false, frame = null } = {}) {
    this.scene = new Scene(content);
    this.live = null;
    this.frame = clamp(frame ?? this.scene.nFrames - 1, 0, this.scene.nFrames - 1);
    if (this.look.selected >= this.scene.members.length) this.look.selected = null;
    if (this.look.node >= this.scene.nodes.length) this.look.node = null;
    if (this.look.mode === "utilisation" && !this.scene.hasLimits) this.look.mode = "kind";
    this.resize();
    if (!keepView) this.fit();
    this.canvas.setAttribute("aria-label", this.description);
    this.refresh();
    this.tell("scene");
  }

  // Show a state that is none of the scene's frames: three arrays, as a solver gives them.
  show(positions, tensions, forces = null, ghost = true) {
    this.live = new State(this.scene, positions, tensions, forces);
    this.look.ghost = ghost;
    this.refresh();
  }

  get colours() {
    const chosen = document.documentElement.dataset.theme;
    return palette(chosen ? chosen === "dark" : this.dark.matches);
  }

  get description() {
    const { scene } = this;
    const count = (kind) => scene.kinds.filter((k) => k === kind).length;
    return `${scene.name}: ${scene.nodes.length} nodes, ${count("strut")} struts, ${count("cable")} classical and ${count("clustered")} clustered cables. Arrow keys turn, plus and minus zoom, comma and full stop go through the members.`;
  }

  get state() {
    const mode = this.scene.modes[this.modeIndex] || null;
    const state = this.live || this.scene.state(this.frame);
    if (!mode) return state;
    const swing = SWING * this.camera.size * Math.sin((2 * Math.PI * this.clock) / PERIOD);
    return new State(this.scene, state.positions.map((x, i) => x + swing * mode.shape[i]), state.tensions, state.forces);
  }

  // Below one where segments are so short in the picture that their least widths would cover each other.
  get crowd() {
    return clamp(this.scene.unitLength / (this.camera.pixel * this.camera.distance) / ROOMY, 0.2, 1);
  }

  resize() {
    const [width, height] = [this.element.clientWidth || 640, this.element.clientHeight || 400];
    const ratio = devicePixelRatio || 1;
    for (const canvas of [this.canvas, this.overlay]) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const first = this.camera.width === 1;
    Object.assign(this.camera, { width, height });
    if (first || !this.touched) this.fit();
    this.refresh();
  }

  fit() {
    if (!this.scene) return;
    const shown = this.live ? this.live.positions : this.scene.positions;
    this.camera.fit([...shown, ...(this.scene.reference || [])]);
    this.refresh();
  }

  view(name) {
    this.camera.look(name);
    this.fit();
  }

  set(changes) {
    Object.assign(this.look, changes);
    this.range = null;
    this.refresh();
    this.tell("look");
  }

  select(found) {
    this.set({ selected: found?.member ?? null, node: found?.node ?? null });
    this.tell("select");
  }

  goto(frame) {
    this.live = null;
    this.frame = clamp(frame, 0, this.scene.nFrames - 1);
    this.refresh();
    this.tell("frame");
  }

  // Animate a mode, none where the index is −1.
  swing(index) {
    this.modeIndex = index;
    this.clock = PERIOD / 4; // at its most, for a still picture
    this.playing = index >= 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.refresh();
    this.tell("play");
  }

  play(playing = !this.playing) {
    this.playing = playing;
    this.since = null;
    if (playing && this.modeIndex < 0 && this.frame >= this.scene.nFrames - 1) this.goto(0);
    this.refresh();
    this.tell("play");
  }

  refresh() {
    if (!this.pending) this.pending = requestAnimationFrame((now) => this.draw(now));
  }

  draw(now) {
    this.pending = null;
    if (this.playing) this.advance(now);
    const { scene, camera, colours, look } = this;
    const state = this.state;
    this.range ??= rangeOf(look.mode, scene, state);
    if (this.live && look.mode !== "kind") this.range = Math.max(this.range, rangeOf(look.mode, { nFrames: 0 }, state));
    this.parts = partsOf(state, look, colours, this.range, this.crowd);
    const names = namesOf(scene, state, look, camera);
    if (this.painter) {
      this.painter.draw(camera, this.parts, colours);
    } else {
      this.still.innerHTML = svgOf(scene.name, this.parts, [], camera, colours);
    }
    // A second canvas costs a frame's worth of composition where all is drawn by software.
    this.overlay.hidden = names.length === 0;
    if (names.length) {
      const context = this.overlay.getContext("2d");
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.clearRect(0, 0, this.overlay.width, this.overlay.height);
      drawNames(context, names, colours, this.overlay.width / camera.width);
    }
    this.drawn += 1;
    this.tell("draw");
  }

  advance(now) {
    const passed = this.since == null ? 0 : now - this.since;
    this.since = now;
    if (this.modeIndex >= 0) {
      this.clock += passed;
    } else {
      this.frame += (passed / RUN) * (this.scene.nFrames - 1);
      if (this.frame >= this.scene.nFrames - 1) {
        this.frame = this.scene.nFrames - 1;
        this.playing = false;
        this.tell("play");
      }
      this.tell("frame");
    }
    if (this.playing) this.refresh();
  }

  tell(type) {
    this.dispatchEvent(new Event(type));
  }

  get legend() {
    this.range ??= rangeOf(this.look.mode, this.scene, this.state);
    return legendOf(this.look.mode, this.scene, this.range, this.colours);
  }

  // What the colours of the kinds mean: [label, colour, look].
  get kinds() {
    const { scene, colours } = this;
    const entries = [];
    if (scene.kinds.includes("strut")) entries.push(["struts", colours.strut, "thick"]);
    if (scene.kinds.includes("cable")) entries.push(["cables", colours.cable, "thin"]);
    scene.clusters.slice(0, 8).forEach((e, i) => entries.push([scene.members[e], colours.clusters[i % colours.clusters.length], "striped"]));
    return entries;
  }

  get svg() {
    const names = namesOf(this.scene, this.state, this.look, this.camera);
    const foot = svgLegend(this.legend, this.kinds, this.camera, this.colours, digits);
    const parts = partsOf(this.state, this.look, this.colours, this.range, this.crowd);
    return svgOf(this.scene.name, parts, names, this.camera, this.colours, foot);
  }

  // The picture as PNG, twice as fine as the screen shows it.
  async png(scale = 2) {
    const picture = new Image();
    picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(this.svg)}`;
    await picture.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [scale * this.camera.width, scale * this.camera.height];
    canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
    return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
  }

  listen() {
    const { canvas } = this;
    const fingers = new Map();
    let moved = 0;
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    canvas.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, place(event));
      canvas.setPointerCapture(event.pointerId);
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = place(event);
      const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
      moved += Math.abs(dx) + Math.abs(dy);
      if (fingers.size === 2) this.pinch(fingers, event.pointerId, now);
      else if (event.shiftKey || event.buttons & 6) this.camera.pan(dx, dy);
      else this.camera.turn(0.008 * dx, 0.008 * dy);
      fingers.set(event.pointerId, now);
      this.touched = true;
      this.refresh();
    });
    const lift = (event) => {
      if (fingers.delete(event.pointerId) && event.type === "pointerup" && moved < 5) {
        const reach = event.pointerType === "touch" ? 18 : 9;
        this.select(find(...place(event), this.parts, this.camera, reach));
      }
    };
    canvas.addEventListener("pointerup", lift);
    canvas.addEventListener("pointercancel", lift);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.touched = true;
      this.camera.zoom(Math.exp(0.0012 * event.deltaY));
      this.refresh();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => { this.touched = false; this.fit(); });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  // Two fingers: their middle pans, their distance zooms.
  pinch(fingers, moving, now) {
    const [other] = [...fingers].filter(([id]) => id !== moving).map(([, p]) => p);
    const before = fingers.get(moving);
    const apart = (a, b) => Math.max(Math.hypot(a[0] - b[0], a[1] - b[1]), 1);
    this.camera.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    this.camera.zoom(apart(before, other) / apart(now, other));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    const { look, scene } = this;
    const next = (by) => {
      const n = scene.members.length;
      this.select({ member: look.selected === null ? (by > 0 ? 0 : n - 1) : (look.selected + by + n) % n });
    };
    const keys = {
      "+": () => this.camera.zoom(0.87), "=": () => this.camera.zoom(0.87), "-": () => this.camera.zoom(1.15),
      0: () => { this.touched = false; this.fit(); },
      1: () => this.view("oblique"), 2: () => this.view("front"), 3: () => this.view("side"), 4: () => this.view("top"),
      n: () => this.set({ nodeNames: !look.nodeNames }), m: () => this.set({ memberNames: !look.memberNames }),
      g: () => this.set({ ghost: !look.ghost }), f: () => this.set({ forces: !look.forces }),
      " ": () => this.play(), ".": () => next(1), ",": () => next(-1), Escape: () => this.select(null),
    };
    if (step) {
      if (event.shiftKey) this.camera.pan(25 * step[0], -25 * step[1]);
      else this.camera.turn(-0.09 * step[0], 0.09 * step[1]);
    } else if (keys[event.key]) keys[event.key]();
    else return;
    event.preventDefault();
    this.touched = true;
    this.refresh();
  }
}
