// What is shown: names, topology and frames, unpacked from the JSON that Python writes.
import { at, minus, median, norm, unit } from "./algebra.js";

function unpack(packed) {
  if (packed == null) return null;
  const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
  return packed.type === "i4" ? new Int32Array(bytes.buffer) : new Float32Array(bytes.buffer);
}

export class Scene {
  constructor(content) {
    this.name = content.name;
    this.units = content.units;
    this.nodes = content.nodes;
    this.members = content.members;
    this.kinds = content.kinds; // "strut", "cable" or "clustered"
    this.stiffness = unpack(content.stiffness);
    this.thickness = unpack(content.thickness); // share of the thickest of its kind
    this.tensionLimit = unpack(content.tension_limit);
    this.compressionLimit = unpack(content.compression_limit);
    this.segments = unpack(content.segments); // node, node, member
    this.nSegments = this.segments.length / 3;
    this.supports = content.supports.map(([node, axes]) => [this.nodes.indexOf(node), axes]);
    this.reference = unpack(content.reference);
    this.positions = unpack(content.positions); // frames × nodes × 3
    this.tensions = unpack(content.tensions); // frames × members, or null before any solve
    this.forces = unpack(content.forces); // frames × nodes × 3, or null
    this.labels = content.labels;
    this.statuses = content.statuses || [];
    this.modes = (content.modes || []).map((mode) => ({ name: mode.name, shape: unpack(mode.shape) }));
    this.nFrames = this.labels.length;
    this.unitLength = this.typicalLength();
    this.pulleys = this.findPulleys();
    this.clusters = this.members.map((_, e) => e).filter((e) => this.kinds[e] === "clustered");
    this.hasLimits = this.tensionLimit.some(isFinite) || this.compressionLimit.some(isFinite);
  }

  typicalLength() {
    const x = this.reference || this.positions;
    const lengths = [];
    for (let s = 0; s < this.nSegments; s++) {
      lengths.push(norm(minus(at(x, this.segments[3 * s]), at(x, this.segments[3 * s + 1]))));
    }
    return median(lengths) || 1;
  }

  // Nodes over which a clustered cable runs.
  findPulleys() {
    const pulleys = new Set();
    for (let s = 1; s < this.nSegments; s++) {
      if (this.segments[3 * s + 2] === this.segments[3 * s - 1]) pulleys.add(this.segments[3 * s]);
    }
    return pulleys;
  }

  // The state at a frame, between two where it is no whole number.
  state(frame) {
    const first = Math.min(Math.floor(frame), this.nFrames - 1);
    const second = Math.min(first + 1, this.nFrames - 1);
    const share = frame - first;
    const between = (values, n) => {
      if (!values) return null;
      const start = values.subarray(first * n, (first + 1) * n);
      if (share === 0 || first === second) return start;
      const end = values.subarray(second * n, (second + 1) * n);
      return start.map((value, i) => value + share * (end[i] - value));
    };
    return new State(
      this,
      between(this.positions, 3 * this.nodes.length),
      between(this.tensions, this.members.length),
      between(this.forces, 3 * this.nodes.length),
    );
  }
}

export class State {
  constructor(scene, positions, tensions, forces) {
    Object.assign(this, { scene, positions, tensions, forces });
  }

  get lengths() {
    const { segments, nSegments, members } = this.scene;
    const lengths = new Float64Array(members.length);
    for (let s = 0; s < nSegments; s++) {
      const [p, q] = [at(this.positions, segments[3 * s]), at(this.positions, segments[3 * s + 1])];
      lengths[segments[3 * s + 2]] += norm(minus(p, q));
    }
    return lengths;
  }

  slack(e) {
    return this.tensions !== null && this.scene.kinds[e] !== "strut" && this.tensions[e] === 0;
  }

  strain(e) {
    return this.tensions[e] / this.scene.stiffness[e];
  }

  // Force as a share of what the member may carry; NaN where nothing limits it.
  utilisation(e) {
    const force = this.tensions[e];
    const { tensionLimit, compressionLimit } = this.scene;
    const shares = [];
    if (isFinite(tensionLimit[e])) shares.push(Math.abs(force) / tensionLimit[e]);
    if (isFinite(compressionLimit[e])) shares.push(Math.max(0, -force) / compressionLimit[e]);
    return shares.length ? Math.max(...shares) : NaN;
  }

  // What the supports do to the structure: against loads and members, along the axes that they hold.
  get reactions() {
    if (!this.tensions) return null;
    const { segments, nSegments, supports } = this.scene;
    const sum = this.forces ? Float64Array.from(this.forces) : new Float64Array(this.positions.length);
    for (let s = 0; s < nSegments; s++) {
      const [n, m, e] = segments.subarray(3 * s, 3 * s + 3);
      const along = unit(minus(at(this.positions, m), at(this.positions, n)));
      for (let k = 0; k < 3; k++) {
        sum[3 * n + k] += this.tensions[e] * along[k];
        sum[3 * m + k] -= this.tensions[e] * along[k];
      }
    }
    const held = new Float64Array(this.positions.length);
    for (const [n, axes] of supports) {
      for (const axis of axes) held[3 * n + "xyz".indexOf(axis)] = -sum[3 * n + "xyz".indexOf(axis)];
    }
    return held;
  }
}
