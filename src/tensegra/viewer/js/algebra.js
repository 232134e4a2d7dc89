// Vectors as arrays of three numbers, matrices as 16 numbers in columns, as WebGL takes them.

export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const plus = (a, b, factor = 1) => [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const norm = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => {
  const size = norm(a) || 1;
  return [a[0] / size, a[1] / size, a[2] / size];
};
export const at = (flat, i) => [flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]];
export const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

export function median(values) {
  const sorted = Array.from(values).sort((a, b) => a - b);
  return sorted.length ? sorted[sorted.length >> 1] : 1;
}

// Distance of a point from the segment between two others, in the plane.
export function distanceToSegment(x, y, a, b) {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const square = dx * dx + dy * dy;
  const share = square > 0 ? clamp(((x - a[0]) * dx + (y - a[1]) * dy) / square, 0, 1) : 0;
  return [Math.hypot(x - a[0] - share * dx, y - a[1] - share * dy), share];
}
