// Colours that the colour-blind tell apart, in light and dark, and what they mean.
import { clamp } from "./algebra.js";

// Okabe & Ito 2008 for kinds; blue through grey to orange for signs; viridis, its ends cut off, for shares.
const LIGHT = {
  paper: "#ffffff", ink: "#1b1f24", faint: "#b4bac2", strut: "#2b3038", cable: "#0072b2",
  clusters: ["#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#7b4ba3"],
  support: "#00785a", load: "#a3195b", reaction: "#00785a", lit: "#ffb000",
  signs: ["#08519c", "#6baed6", "#9a9a9a", "#f0883e", "#a63603"],
  shares: ["#443983", "#31688e", "#21918c", "#35b779", "#b8a500"],
};
const DARK = {
  paper: "#14181d", ink: "#e8ebee", faint: "#59626d", strut: "#d5dae0", cable: "#5ab4ec",
  clusters: ["#ff8a3c", "#2fd0a0", "#eba4cb", "#e0c341", "#9ad7ff", "#c09be6"],
  support: "#2fd0a0", load: "#ff6fae", reaction: "#2fd0a0", lit: "#ffe066",
  signs: ["#7cc0ff", "#4a90c8", "#8d949c", "#e08a45", "#ffb27d"],
  shares: ["#8f86e0", "#5aa0cf", "#35b6a8", "#7ed957", "#fde725"],
};

export const MODES = {
  kind: "kind of member",
  tension: "tension",
  density: "force density",
  utilisation: "utilisation",
};

export function palette(dark) {
  return dark ? DARK : LIGHT;
}

export function rgb(hex) {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
}

function along(stops, share) {
  const place = clamp(share, 0, 1) * (stops.length - 1);
  const first = Math.min(Math.floor(place), stops.length - 2);
  const [a, b] = [rgb(stops[first]), rgb(stops[first + 1])];
  return a.map((value, k) => Math.round(value + (place - first) * (b[k] - value)));
}

// What each member's colour says, `null` where there is nothing to say.
export function valuesOf(mode, state) {
  const { members } = state.scene;
  if (mode === "kind" || !state.tensions) return null;
  if (mode === "tension") return Array.from(state.tensions);
  if (mode === "utilisation") return members.map((_, e) => state.utilisation(e));
  const lengths = state.lengths;
  return members.map((_, e) => state.tensions[e] / lengths[e]);
}

// The largest size of a value over all frames, so that a colour means the same while a path is played.
export function rangeOf(mode, scene, state) {
  if (mode === "kind") return 0;
  if (mode === "utilisation") return 1;
  let most = 0;
  const look = (values) => (values || []).forEach((v) => { most = Math.max(most, Math.abs(v) || 0); });
  if (mode === "tension") look(scene.tensions);
  else for (let frame = 0; frame < scene.nFrames; frame++) look(valuesOf(mode, scene.state(frame)));
  look(valuesOf(mode, state));
  return most || 1;
}

export function coloursOf(mode, state, range, colours) {
  const { kinds, members, clusters } = state.scene;
  const values = valuesOf(mode, state);
  return members.map((_, e) => {
    if (values) {
      if (Number.isNaN(values[e])) return rgb(colours.faint);
      return mode === "utilisation"
        ? along(colours.shares, values[e] / range)
        : along(colours.signs, 0.5 + values[e] / range / 2);
    }
    if (kinds[e] === "clustered") return rgb(colours.clusters[clusters.indexOf(e) % colours.clusters.length]);
    return rgb(colours[kinds[e]]);
  });
}

export function legendOf(mode, scene, range, colours) {
  const unit = mode === "tension" ? scene.units.force
    : mode === "density" ? `${scene.units.force}/${scene.units.length}` : "";
  if (mode === "kind") return { title: "", stops: null, ticks: [], unit };
  if (mode === "utilisation") return { title: MODES[mode], stops: colours.shares, ticks: [0, 0.5, 1], unit };
  return { title: MODES[mode], stops: colours.signs, ticks: [-range, 0, range], unit };
}

export function digits(value, n = 4) {
  if (!Number.isFinite(value)) return "–";
  const text = Number(value.toPrecision(n));
  const size = Math.abs(text);
  return (size !== 0 && (size < 1e-3 || size >= 1e6) ? text.toExponential() : String(text)).replace("-", "−");
}
