// In the plane of the picture: what is under the pointer, names, and the picture as SVG.
import { distanceToSegment } from "./algebra.js";
import { DASHED, STRIPED, TAPERED } from "./parts.js";

const REACH = 9; // pixels within which the pointer finds something; a finger covers more
const NODE_FIRST = 7;

// The node or the member at a place, the nearest to the eye of those in reach; null where there is none.
export function find(x, y, parts, camera, reach = REACH) {
  let best = null;
  for (const ball of parts.balls) {
    const [bx, by, depth] = camera.project(ball.at);
    if (Math.hypot(x - bx, y - by) < Math.min(reach, NODE_FIRST) && (!best || depth < best.depth)) best = { node: ball.node, depth };
  }
  if (best) return best;
  let nearest = reach;
  for (const rod of parts.rods) {
    if (rod.member < 0 || rod.behind) continue;
    const [a, b] = [camera.project(rod.from), camera.project(rod.to)];
    const [distance, share] = distanceToSegment(x, y, a, b);
    const depth = a[2] + share * (b[2] - a[2]);
    if (distance < nearest - 2 || (distance < nearest + 2 && best && depth < best.depth)) {
      best = { member: rod.member, depth };
      nearest = Math.min(nearest, distance);
    }
  }
  return best;
}

// Names that find room, the wanted ones first: [text, x, y].
export function namesOf(scene, state, look, camera) {
  if (!look.nodeNames && !look.memberNames && look.node === null && look.selected === null) return [];
  const wanted = [];
  const point = (n) => Array.from(state.positions.subarray(3 * n, 3 * n + 3));
  const middles = new Map();
  for (let s = 0; s < scene.nSegments; s++) {
    const [n, m, e] = scene.segments.subarray(3 * s, 3 * s + 3);
    if (middles.has(e) || !(look.memberNames || e === look.selected)) continue;
    const [p, q] = [point(n), point(m)];
    middles.set(e, p.map((value, k) => (value + q[k]) / 2));
  }
  const nodeName = (n) => wanted.push([scene.nodes[n], ...camera.project(point(n)).slice(0, 2), n === look.node]);
  const memberName = (e) => wanted.push([scene.members[e], ...camera.project(middles.get(e)).slice(0, 2), e === look.selected]);
  if (look.node !== null) nodeName(look.node);
  if (look.selected !== null) memberName(look.selected);
  if (look.nodeNames) scene.nodes.forEach((_, n) => nodeName(n));
  if (look.memberNames) scene.members.forEach((_, e) => memberName(e));
  const taken = [];
  return wanted.filter(([text, x, y]) => {
    const width = 7 * text.length + 4;
    const free = taken.every(([ox, oy, w]) => Math.abs(y - oy) > 12 || x + width < ox || ox + w < x);
    if (free) taken.push([x, y, width]);
    return free;
  });
}

export function drawNames(context, names, colours, ratio) {
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.lineWidth = 3;
  context.lineJoin = "round";
  context.strokeStyle = colours.paper;
  context.fillStyle = colours.ink;
  for (const [text, x, y, strong] of names) {
    context.font = `${strong ? "bold 13px" : "11px"} system-ui, sans-serif`;
    context.strokeText(text, x + 6, y - 6);
    context.fillText(text, x + 6, y - 6);
  }
}

const escape = (text) => String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
const css = ([r, g, b]) => `rgb(${r},${g},${b})`;
const places = (...numbers) => numbers.map((value) => value.toFixed(2)).join(" ");

// The picture as lines, from the farthest to the nearest.
export function svgOf(title, parts, names, camera, colours, legend = "") {
  const shapes = parts.rods.map((rod) => {
    const [a, b] = [camera.project(rod.from), camera.project(rod.to)];
    return [(a[2] + b[2]) / 2 + (rod.behind ? 1e-3 * camera.size : 0), rodShape(rod, a, b, camera, colours)];
  });
  for (const ball of parts.balls) {
    const [x, y, depth] = camera.project(ball.at);
    const radius = Math.max(ball.radius / (camera.pixel * depth), ball.pixels);
    const look = ball.ring
      ? `fill="${colours.paper}" stroke="${css(ball.colour)}" stroke-width="${(0.48 * radius).toFixed(2)}"`
      : `fill="${css(ball.colour)}"`;
    shapes.push([depth - radius * camera.pixel * depth, `<circle cx="${x.toFixed(2)}" cy="${y.toFixed(2)}" r="${(ball.ring ? 0.76 * radius : radius).toFixed(2)}" ${look}/>`]);
  }
  shapes.sort((a, b) => b[0] - a[0]);
  const texts = names.map(([text, x, y, strong]) => `<text x="${(x + 6).toFixed(1)}" y="${(y - 6).toFixed(1)}" font-size="${strong ? 13 : 11}" fill="${colours.ink}" stroke="${colours.paper}" stroke-width="3" paint-order="stroke">${escape(text)}</text>`);
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${camera.width} ${camera.height}" width="${camera.width}" height="${camera.height}" font-family="sans-serif" role="img"><title>${escape(title)}</title><rect width="100%" height="100%" fill="${colours.paper}"/><g stroke-linecap="round">${shapes.map(([, shape]) => shape).join("")}</g>${texts.join("")}${legend}</svg>`;
}

function rodShape(rod, a, b, camera, colours) {
  const width = (depth) => 2 * Math.max(rod.radius / (camera.pixel * depth), rod.pixels);
  if (rod.style & TAPERED) {
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const half = width(a[2]) / 2 / (Math.hypot(dx, dy) || 1);
    return `<path d="M${places(a[0] - dy * half, a[1] + dx * half)}L${places(a[0] + dy * half, a[1] - dx * half)}L${places(b[0], b[1])}Z" fill="${css(rod.colour)}" fill-opacity="${rod.alpha}"/>`;
  }
  const line = (colour, size, alpha) => `<path d="M${places(a[0], a[1])}L${places(b[0], b[1])}" stroke="${colour}" stroke-width="${size.toFixed(2)}" stroke-opacity="${alpha}"${rod.style & DASHED ? ' stroke-dasharray="7 6" stroke-linecap="butt"' : ""}/>`;
  const size = width((a[2] + b[2]) / 2);
  const drawn = line(css(rod.colour), size, rod.alpha);
  return rod.style & STRIPED && !rod.behind ? drawn + line(colours.paper, 0.3 * size, 0.72) : drawn;
}

// The legend for a picture that leaves the page, at its foot.
export function svgLegend(legend, entries, camera, colours, digits) {
  const y = camera.height - 14;
  const text = (x, label) => `<text x="${x}" y="${y}" font-size="11" fill="${colours.ink}">${escape(label)}</text>`;
  if (legend.stops) {
    const stops = legend.stops.map((colour, i) => `<stop offset="${i / (legend.stops.length - 1)}" stop-color="${colour}"/>`).join("");
    const ticks = legend.ticks.map((tick, i) => `<text x="${12 + (180 * i) / (legend.ticks.length - 1)}" y="${y + 10}" font-size="10" text-anchor="${["start", "middle", "end"][i]}" fill="${colours.ink}">${digits(tick)}</text>`).join("");
    return `<defs><linearGradient id="scale">${stops}</linearGradient></defs><text x="12" y="${y - 18}" font-size="11" fill="${colours.ink}">${escape(`${legend.title} ${legend.unit && `(${legend.unit})`}`)}</text><rect x="12" y="${y - 12}" width="180" height="10" fill="url(#scale)"/>${ticks}`;
  }
  let x = 12;
  return entries.map(([label, colour]) => {
    const drawn = `<rect x="${x}" y="${y - 8}" width="14" height="8" fill="${colour}"/>${text(x + 18, label)}`;
    x += 30 + 6.5 * label.length;
    return drawn;
  }).join("");
}

