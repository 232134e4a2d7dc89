// WebGL2: rods and balls as quads that face the eye, shaded as if they were round. Two calls a picture.
import { rgb } from "./colours.js";

const ROD_VERTEX = `#version 300 es
uniform mat4 view, projection; uniform float pixel;
in vec2 corner; in vec3 from, to; in vec2 size; in vec4 colour; in float style;
out vec2 place; out vec4 tint; flat out int kind;
void main() {
  vec3 p = (view * vec4(from, 1.)).xyz, q = (view * vec4(to, 1.)).xyz;
  vec3 c = mix(p, q, corner.y), along = q - p;
  vec3 side = cross(along, c);
  side *= inversesqrt(max(dot(side, side), 1e-30));
  kind = int(style + .5);
  float grain = max(-c.z, 1e-9) * pixel;
  float radius = max(size.x, size.y * grain) * ((kind & 4) != 0 ? 1. - corner.y : 1.);
  place = vec2(corner.x, corner.y * length(along) / (max(-.5 * (p.z + q.z), 1e-9) * pixel));
  tint = colour;
  gl_Position = projection * vec4(c + side * corner.x * radius, 1.);
  if ((kind & 8) != 0) gl_Position.z += 2e-4 * gl_Position.w;
}`;

const ROD_FRAGMENT = `#version 300 es
precision mediump float;
uniform vec3 paper;
in vec2 place; in vec4 tint; flat in int kind; out vec4 drawn;
void main() {
  if ((kind & 1) != 0 && mod(place.y, 13.) > 7.) discard;
  float across = abs(place.x);
  vec3 base = (kind & 2) != 0 && across < .27 ? mix(tint.rgb, paper, .72) : tint.rgb;
  float light = (kind & 8) != 0 ? 1. : .62 + .38 * sqrt(max(0., 1. - across * across));
  drawn = vec4(base * light, tint.a);
}`;

const BALL_VERTEX = `#version 300 es
uniform mat4 view, projection; uniform float pixel;
in vec2 corner; in vec3 centre; in vec2 size; in vec4 colour; in float style;
out vec2 place; out vec4 tint; flat out int ring;
void main() {
  vec3 c = (view * vec4(centre, 1.)).xyz;
  float radius = max(size.x, size.y * max(-c.z, 1e-9) * pixel);
  place = vec2(corner.x, 2. * corner.y - 1.);
  tint = colour; ring = int(style + .5);
  gl_Position = projection * vec4(c + vec3(place * radius, radius), 1.);
}`;

const BALL_FRAGMENT = `#version 300 es
precision mediump float;
uniform vec3 paper;
in vec2 place; in vec4 tint; flat in int ring; out vec4 drawn;
void main() {
  float r = length(place);
  if (r > 1.) discard;
  float light = .6 + .4 * sqrt(1. - r * r);
  drawn = vec4(ring != 0 && r < .52 ? paper : tint.rgb * light, 1.);
}`;

const ROD_FLOATS = 13; // from, to, two sizes, colour, style
const BALL_FLOATS = 10;

export class Painter {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true, alpha: false });
    if (!gl) throw new Error("WebGL2 is not to be had");
    this.gl = gl;
    this.corners = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, 0, 1, 0, -1, 1, 1, 1]), gl.STATIC_DRAW);
    this.rods = this.pipeline(ROD_VERTEX, ROD_FRAGMENT, [["from", 3], ["to", 3], ["size", 2], ["colour", 4], ["style", 1]]);
    this.balls = this.pipeline(BALL_VERTEX, BALL_FRAGMENT, [["centre", 3], ["size", 2], ["colour", 4], ["style", 1]]);
  }

  pipeline(vertex, fragment, attributes) {
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
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    const corner = gl.getAttribLocation(program, "corner");
    gl.enableVertexAttribArray(corner);
    gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    const stride = 4 * attributes.reduce((sum, [, n]) => sum + n, 0);
    let offset = 0;
    for (const [name, n] of attributes) {
      const location = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, n, gl.FLOAT, false, stride, offset);
      gl.vertexAttribDivisor(location, 1);
      offset += 4 * n;
    }
    gl.bindVertexArray(null);
    const uniforms = {};
    for (const name of ["view", "projection", "pixel", "paper"]) uniforms[name] = gl.getUniformLocation(program, name);
    return { program, array, buffer, uniforms };
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
    const { rods, balls } = parts;
    const rodData = new Float32Array(ROD_FLOATS * rods.length);
    rods.forEach((rod, i) => {
      const [r, g, b] = rod.colour;
      rodData.set([...rod.from, ...rod.to, rod.radius, rod.pixels, r / 255, g / 255, b / 255, rod.alpha,
        rod.style | (rod.behind ? 8 : 0)], ROD_FLOATS * i);
    });
    this.run(this.rods, rodData, rods.length, camera, paper);
    const ballData = new Float32Array(BALL_FLOATS * balls.length);
    balls.forEach((ball, i) => {
      const [r, g, b] = ball.colour;
      ballData.set([...ball.at, ball.radius, ball.pixels, r / 255, g / 255, b / 255, 1, ball.ring ? 1 : 0], BALL_FLOATS * i);
    });
    this.run(this.balls, ballData, balls.length, camera, paper);
  }

  run(pipeline, data, n, camera, paper) {
    const { gl } = this;
    gl.useProgram(pipeline.program);
    gl.bindVertexArray(pipeline.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, pipeline.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.uniformMatrix4fv(pipeline.uniforms.view, false, camera.viewMatrix);
    gl.uniformMatrix4fv(pipeline.uniforms.projection, false, camera.projectionMatrix);
    gl.uniform1f(pipeline.uniforms.pixel, camera.pixel);
    gl.uniform3fv(pipeline.uniforms.paper, paper);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, n);
    gl.bindVertexArray(null);
  }
}
