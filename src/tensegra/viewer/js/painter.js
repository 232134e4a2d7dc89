// WebGL2: rods and balls as quads that face the eye, shaded as if they were round. Three calls a picture.
//
// Corners are written out, not instanced: drawn by software, an instance of four corners costs ten times as
// much. Edges are smoothed by what of a pixel they cover: multisampling costs three times as much there.
import { dot } from "./algebra.js";
import { rgb } from "./colours.js";

const ROD_VERTEX = `#version 300 es
uniform mat4 view, projection; uniform float pixel;
in vec2 corner; in vec3 from, to; in vec2 size; in vec4 colour; in float style;
out vec3 place; out vec4 tint; flat out int kind;
void main() {
  vec3 p = (view * vec4(from, 1.)).xyz, q = (view * vec4(to, 1.)).xyz;
  vec3 c = mix(p, q, corner.y), along = q - p;
  vec3 side = cross(along, c);
  side *= inversesqrt(max(dot(side, side), 1e-30));
  kind = int(style + .5);
  float grain = max(-c.z, 1e-9) * pixel;
  float radius = max(size.x / grain, size.y) * ((kind & 4) != 0 ? 1. - corner.y : 1.);
  float reach = radius + 1.;
  place = vec3(corner.x * reach, corner.y * length(along) / (max(-.5 * (p.z + q.z), 1e-9) * pixel), radius);
  tint = colour;
  gl_Position = projection * vec4(c + side * corner.x * reach * grain, 1.);
  if ((kind & 8) != 0) gl_Position.z += 2e-4 * gl_Position.w;
  if ((kind & 2) != 0) gl_Position.z -= 2e-4 * gl_Position.w; // beside a classical one on the same way
}`;

const ROD_FRAGMENT = `#version 300 es
precision mediump float;
uniform vec3 paper;
in vec3 place; in vec4 tint; flat in int kind; out vec4 drawn;
void main() {
  float cover = clamp(place.z - abs(place.x) + .5, 0., 1.);
  if (cover == 0. || ((kind & 1) != 0 && mod(place.y, 13.) > 7.)) discard;
  float across = min(abs(place.x) / max(place.z, 1e-3), 1.);
  vec3 base = (kind & 2) != 0 ? mix(tint.rgb, paper, .72 * clamp((.27 - across) * place.z + .5, 0., 1.)) : tint.rgb;
  float light = (kind & 8) != 0 ? 1. : .62 + .38 * sqrt(1. - across * across);
  drawn = vec4(base * light, tint.a * cover);
}`;

const BALL_VERTEX = `#version 300 es
uniform mat4 view, projection; uniform float pixel;
in vec2 corner; in vec3 centre; in vec2 size; in vec4 colour; in float style;
out vec3 place; out vec4 tint; flat out int ring;
void main() {
  vec3 c = (view * vec4(centre, 1.)).xyz;
  float grain = max(-c.z, 1e-9) * pixel, radius = max(size.x / grain, size.y);
  place = vec3(vec2(corner.x, 2. * corner.y - 1.) * (radius + 1.), radius);
  tint = colour; ring = int(style + .5);
  gl_Position = projection * vec4(c + vec3(place.xy, radius) * grain, 1.);
}`;

const BALL_FRAGMENT = `#version 300 es
precision mediump float;
uniform vec3 paper;
in vec3 place; in vec4 tint; flat in int ring; out vec4 drawn;
void main() {
  float distance = length(place.xy), cover = clamp(place.z - distance + .5, 0., 1.);
  if (cover == 0.) discard;
  float r = min(distance / place.z, 1.), light = .6 + .4 * sqrt(1. - r * r);
  float inner = ring != 0 ? clamp((.52 - r) * place.z + .5, 0., 1.) : 0.;
  drawn = vec4(mix(tint.rgb * light, paper, inner), cover);
}`;

const CORNERS = [[-1, 0], [1, 0], [-1, 1], [1, 1]];
const ROD_LAYOUT = { names: [["corner", 2], ["from", 3], ["to", 3], ["size", 2], ["colour", 4], ["style", 1]], floats: 15 };
const BALL_LAYOUT = { names: [["corner", 2], ["centre", 3], ["size", 2], ["colour", 4], ["style", 1]], floats: 12 };

export class Painter {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
    if (!gl) throw new Error("WebGL2 is not to be had");
    this.gl = gl;
    this.indices = gl.createBuffer();
    this.nQuads = 0;
    this.rods = this.pipeline(ROD_VERTEX, ROD_FRAGMENT, ROD_LAYOUT);
    this.balls = this.pipeline(BALL_VERTEX, BALL_FRAGMENT, BALL_LAYOUT);
  }

  pipeline(vertex, fragment, { names, floats }) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const array = gl.createVertexArray();
    const buffer = gl.createBuffer();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    let offset = 0;
    for (const [name, n] of names) {
      const location = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, n, gl.FLOAT, false, 4 * floats, offset);
      offset += 4 * n;
    }
    gl.bindVertexArray(null);
    const uniforms = {};
    for (const name of ["view", "projection", "pixel", "paper"]) uniforms[name] = gl.getUniformLocation(program, name);
    return { program, array, buffer, uniforms, floats, data: new Float32Array(0) };
  }

  // Two triangles of each four corners, for as many quads as there are.
  room(n) {
    if (n <= this.nQuads) return;
    const { gl } = this;
    const indices = new Uint32Array(6 * n);
    for (let i = 0; i < n; i++) indices.set([4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3], 6 * i);
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    this.nQuads = n;
  }

  draw(camera, parts, colours) {
    const { gl } = this;
    const paper = rgb(colours.paper).map((value) => value / 255);
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(...paper, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    // What is behind hides nothing; the rest goes from far to near, as half covered pixels need it.
    const { back } = camera.axes;
    const depth = ({ from, to, style }) => dot(from, back) + dot(to, back) + (style & 2 ? 1e-3 * camera.size : 0);
    const near = parts.rods.filter((rod) => !rod.behind).map((rod) => [depth(rod), rod]).sort((a, b) => a[0] - b[0]);
    const writeRod = (data, at, rod) => {
      data.set(rod.from, at + 2);
      data.set(rod.to, at + 5);
      tint(data, at + 8, rod, rod.alpha, rod.style | (rod.behind ? 8 : 0));
    };
    gl.depthMask(false);
    this.run(this.rods, parts.rods.filter((rod) => rod.behind), camera, paper, writeRod);
    gl.depthMask(true);
    this.run(this.rods, near.map(([, rod]) => rod), camera, paper, writeRod);
    this.run(this.balls, parts.balls, camera, paper, (data, at, ball) => {
      data.set(ball.at, at + 2);
      tint(data, at + 5, ball, 1, ball.ring ? 1 : 0);
    });
  }

  run(pipeline, quads, camera, paper, write) {
    const { gl } = this;
    const { floats, uniforms } = pipeline;
    this.room(quads.length);
    if (pipeline.data.length < 4 * floats * quads.length) pipeline.data = new Float32Array(4 * floats * quads.length);
    const { data } = pipeline;
    for (let i = 0; i < quads.length; i++) {
      const start = 4 * floats * i;
      write(data, start, quads[i]);
      for (let c = 0; c < 4; c++) {
        const at = start + c * floats;
        if (c) data.copyWithin(at, start, start + floats);
        [data[at], data[at + 1]] = CORNERS[c];
      }
    }
    gl.useProgram(pipeline.program);
    gl.bindVertexArray(pipeline.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, pipeline.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW, 0, 4 * floats * quads.length);
    gl.uniformMatrix4fv(uniforms.view, false, camera.viewMatrix);
    gl.uniformMatrix4fv(uniforms.projection, false, camera.projectionMatrix);
    gl.uniform1f(uniforms.pixel, camera.pixel);
    gl.uniform3fv(uniforms.paper, paper);
    gl.drawElements(gl.TRIANGLES, 6 * quads.length, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
  }
}

function tint(data, at, { radius, pixels, colour }, alpha, style) {
  data[at] = radius;
  data[at + 1] = pixels;
  data[at + 2] = colour[0] / 255;
  data[at + 3] = colour[1] / 255;
  data[at + 4] = colour[2] / 255;
  data[at + 5] = alpha;
  data[at + 6] = style;
}
