// From a state to the few primitives that both WebGL and SVG draw: rods, some tapered, and balls.
import { at, norm, plus, unit } from "./algebra.js";
import { coloursOf, rgb } from "./colours.js";

export const PLAIN = 0;
export const DASHED = 1;
export const STRIPED = 2;
export const TAPERED = 4;

const ROD = { strut: [0.02, 2.1], cable: [0.006, 0.75], clustered: [0.013, 2] }; // radius: world, least pixels
const FADED = 0.45;

// `crowd` makes all that has a least width in pixels thinner, where a segment is only some pixels long.
// A rod is {from, to, radius, pixels, colour, alpha, style, member}; a ball {at, radius, pixels, colour, ring, node}.
export function partsOf(state, look, colours, range, crowd = 1) {
  const { scene } = state;
  const rods = [];
  const balls = [];
  const length = scene.unitLength;
  const tints = coloursOf(look.mode, state, range, colours);
  if (look.ghost && scene.reference) addGhost(rods, scene, look.ghost === true ? scene.reference : look.ghost, colours);
  for (let s = 0; s < scene.nSegments; s++) {
    const [n, m, e] = scene.segments.subarray(3 * s, 3 * s + 3);
    const kind = scene.kinds[e];
    const slack = state.slack(e);
    const [radius, pixels] = ROD[kind];
    const thick = scene.thickness[e];
    const rod = {
      from: at(state.positions, n), to: at(state.positions, m), member: e,
      radius: radius * length * thick, pixels: pixels * Math.max(thick, 0.6),
      colour: tints[e], alpha: slack ? FADED : 1,
      style: (slack ? DASHED : PLAIN) | (kind === "clustered" ? STRIPED : PLAIN),
    };
    if (look.selected === e) {
      rods.push({ ...rod, radius: rod.radius * 2.2, pixels: rod.pixels + 3.5, colour: rgb(colours.lit), style: PLAIN, alpha: 1, behind: true });
    }
    rods.push(rod);
  }
  scene.nodes.forEach((_, n) => {
    const pulley = scene.pulleys.has(n);
    balls.push({
      at: at(state.positions, n), node: n, radius: (pulley ? 0.03 : 0.022) * length,
      pixels: pulley ? 3.4 : 2.5, ring: pulley,
      colour: rgb(look.node === n ? colours.lit : colours.strut),
    });
  });
  if (look.supports) addSupports(rods, state, colours);
  if (look.forces) addForces(rods, state, colours);
  if (crowd < 1) for (const part of [...rods, ...balls]) part.pixels *= crowd;
  return { rods, balls };
}

function addGhost(rods, scene, positions, colours) {
  for (let s = 0; s < scene.nSegments; s++) {
    const [n, m, e] = scene.segments.subarray(3 * s, 3 * s + 3);
    rods.push({
      from: at(positions, n), to: at(positions, m), member: -1, radius: 0,
      pixels: scene.kinds[e] === "strut" ? 1.3 : 0.6, colour: rgb(colours.faint), alpha: 0.75,
      style: PLAIN, behind: true,
    });
  }
}

// A cone for each axis that is held, its tip at the node, along the axis.
function addSupports(rods, state, colours) {
  const size = 0.1 * state.scene.unitLength;
  for (const [n, axes] of state.scene.supports) {
    for (const axis of axes) {
      const tip = at(state.positions, n);
      const away = [0, 0, 0];
      away["xyz".indexOf(axis)] = -size;
      rods.push({
        from: plus(tip, away), to: tip, member: -1, radius: 0.42 * size, pixels: 3, colour: rgb(colours.support),
        alpha: 0.9, style: TAPERED,
      });
    }
  }
}

function addForces(rods, state, colours) {
  const { scene } = state;
  for (const [values, colour] of [[state.forces, colours.load], [state.reactions, colours.reaction]]) {
    if (!values) continue;
    let most = 0;
    scene.nodes.forEach((_, n) => { most = Math.max(most, norm(at(values, n))); });
    if (!(most > 0)) continue;
    scene.nodes.forEach((_, n) => {
      const force = at(values, n);
      if (norm(force) < 1e-3 * most) return;
      addArrow(rods, at(state.positions, n), force, (0.7 * scene.unitLength * norm(force)) / most, colour);
    });
  }
}

// An arrow that ends in a point, as long as the force is large beside the largest of its kind.
function addArrow(rods, tip, force, length, colour) {
  const along = unit(force);
  const head = 0.35 * length;
  const neck = plus(tip, along, -head);
  const common = { member: -1, colour: rgb(colour), alpha: 1 };
  rods.push({ ...common, from: plus(tip, along, -length), to: neck, radius: 0.03 * head, pixels: 1, style: PLAIN });
  rods.push({ ...common, from: neck, to: tip, radius: 0.2 * head, pixels: 2.5, style: TAPERED });
}
