// The camera: it turns about a target, z upwards.
import { at, clamp, cross, dot, minus, plus } from "./algebra.js";

export const FIELD = (24 * Math.PI) / 180; // of view, upright: narrow, so that parallels look parallel

export const VIEWS = {
  oblique: [-1.05, 0.32],
  front: [-Math.PI / 2, 0],
  side: [0, 0],
  top: [-Math.PI / 2, Math.PI / 2],
};

export class Camera {
  constructor() {
    this.target = [0, 0, 0];
    this.distance = 10;
    [this.azimuth, this.elevation] = VIEWS.oblique;
    this.width = this.height = 1;
  }

  get axes() {
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    const back = [ce * ca, ce * sa, se];
    const right = [-sa, ca, 0];
    return { right, up: cross(back, right), back };
  }

  get eye() {
    return plus(this.target, this.axes.back, this.distance);
  }

  // Size of a pixel at distance one.
  get pixel() {
    return (2 * Math.tan(FIELD / 2)) / this.height;
  }

  turn(right, up) {
    this.azimuth -= right;
    this.elevation = clamp(this.elevation + up, -Math.PI / 2, Math.PI / 2);
  }

  // Move the target by pixels of the picture.
  pan(x, y) {
    const { right, up } = this.axes;
    const scale = this.pixel * this.distance;
    this.target = plus(plus(this.target, right, -x * scale), up, y * scale);
  }

  zoom(factor) {
    this.distance = clamp(this.distance * factor, this.size * 0.02, this.size * 50);
  }

  // Show all points, as large as they fit: x' ≤ t (d − z') for each of them gives the distance d.
  fit(points, margin = 1.12) {
    if (!points.length) return;
    const { right, up, back } = this.axes;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < points.length / 3; i++) {
      const p = at(points, i);
      [dot(p, right), dot(p, up), dot(p, back)].forEach((value, axis) => {
        low[axis] = Math.min(low[axis], value);
        high[axis] = Math.max(high[axis], value);
      });
    }
    const middle = low.map((value, axis) => (value + high[axis]) / 2);
    this.target = [0, 1, 2].map((k) => middle[0] * right[k] + middle[1] * up[k] + middle[2] * back[k]);
    this.size = Math.max(...high.map((value, axis) => value - low[axis]), 1e-12);
    const tangent = Math.tan(FIELD / 2) / margin;
    const aspect = this.width / this.height;
    this.distance = 0;
    for (let i = 0; i < points.length / 3; i++) {
      const p = minus(at(points, i), this.target);
      const wide = Math.abs(dot(p, right)) / (tangent * aspect);
      const high_ = Math.abs(dot(p, up)) / tangent;
      this.distance = Math.max(this.distance, Math.max(wide, high_) + dot(p, back));
    }
    this.distance = Math.max(this.distance, this.size * 0.1);
  }

  look(view) {
    [this.azimuth, this.elevation] = VIEWS[view];
  }

  // To camera axes: x to the right, y up, z towards the eye (negative in front).
  get viewMatrix() {
    const { right, up, back } = this.axes;
    const eye = this.eye;
    return new Float32Array([
      right[0], up[0], back[0], 0,
      right[1], up[1], back[1], 0,
      right[2], up[2], back[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(back, eye), 1,
    ]);
  }

  get projectionMatrix() {
    const f = 1 / Math.tan(FIELD / 2);
    const near = Math.max(this.distance - 2.5 * this.size, this.distance * 0.02);
    const far = this.distance + 4 * this.size;
    return new Float32Array([
      (f * this.height) / this.width, 0, 0, 0,
      0, f, 0, 0,
      0, 0, (far + near) / (near - far), -1,
      0, 0, (2 * far * near) / (near - far), 0,
    ]);
  }

  // Where a point falls in the picture: x and y in pixels from the upper left, and its depth.
  project(point) {
    const { right, up, back } = this.axes;
    const p = minus(point, this.target);
    const depth = this.distance - dot(p, back);
    const scale = 1 / (this.pixel * Math.max(depth, 1e-9));
    return [this.width / 2 + dot(p, right) * scale, this.height / 2 - dot(p, up) * scale, depth];
  }
}
