// The packing on the graphics unit (WebGL2): grains and lines as instances, the camera as uniforms.

import { byDepth } from "./scene.js";
import { rgb } from "./colours.js";
import { DISK_FRAGMENT, FAST_SPHERE_FRAGMENT, GRAIN_VERTEX, LINE_FRAGMENT, LINE_VERTEX, SPHERE_FRAGMENT } from "./shaders.js";

const WIDE = 1024; // grains in a row of the textures
const CORNERS = new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]);
const COLUMNS = [[2, 3, 0], [3, 3, 12], [4, 2, 24]]; // attribute, numbers, bytes from the begin of a line

export class WebglRenderer {
  name = "webgl2";

  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: true, powerPreference: "high-performance" });
    if (!gl) throw new Error("no WebGL2");
    this.gl = gl;
    this.setUp();
  }

  setUp() {
    const { gl } = this;
    this.programs = {
      disk: program(gl, GRAIN_VERTEX, DISK_FRAGMENT), sphere: program(gl, GRAIN_VERTEX, SPHERE_FRAGMENT),
      fast: program(gl, GRAIN_VERTEX, FAST_SPHERE_FRAGMENT), line: program(gl, LINE_VERTEX, LINE_FRAGMENT),
    };
    this.corners = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ARRAY_BUFFER, CORNERS, gl.STATIC_DRAW);
    this.textures = { place: gl.createTexture(), level: gl.createTexture(), palette: gl.createTexture() };
    this.codes = this.instances([[1, 1, 0]], 4);
    this.strokes = { lines: this.instances(COLUMNS, 32), over: this.instances(COLUMNS, 32), marks: this.instances(COLUMNS, 32) };
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.BLEND);
    gl.depthFunc(gl.LEQUAL);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  }

  // A buffer that gives one entry to each instance, with the corners of its square.
  instances(columns, stride) {
    const { gl } = this;
    const [array, buffer] = [gl.createVertexArray(), gl.createBuffer()];
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    for (const [place, size, offset] of columns) {
      gl.enableVertexAttribArray(place);
      if (stride === 4) gl.vertexAttribIPointer(place, size, gl.UNSIGNED_INT, stride, offset);
      else gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
      gl.vertexAttribDivisor(place, 1);
    }
    gl.bindVertexArray(null);
    return { array, buffer, count: 0 };
  }

  fill(target, values, count) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, target.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
    target.count = count;
  }

  // The grains of a frame.
  load(world) {
    const { gl } = this;
    this.world = world;
    this.sorted = "";
    const rows = Math.max(Math.ceil(world.count / WIDE), 1);
    const full = new Float32Array(4 * WIDE * rows);
    full.set(world.place);
    texture(gl, this.textures.place, [gl.RGBA32F, WIDE, rows, gl.RGBA, gl.FLOAT], full);
    this.fill(this.codes, world.code, world.code.length);
  }

  // The colours of the grains.
  paint({ level, colours }) {
    const { gl } = this;
    const rows = Math.max(Math.ceil(level.length / WIDE), 1);
    const full = new Uint8Array(WIDE * rows);
    full.set(level);
    texture(gl, this.textures.level, [gl.R8UI, WIDE, rows, gl.RED_INTEGER, gl.UNSIGNED_BYTE], full);
    const bytes = Uint8Array.from(colours.flatMap((text) => [...rgb(text), 1]), (share) => Math.round(255 * share));
    texture(gl, this.textures.palette, [gl.RGBA8, colours.length, 1, gl.RGBA, gl.UNSIGNED_BYTE], bytes);
  }

  stroke(name, found) { this.fill(this.strokes[name], found.data.subarray(0, 8 * found.count), found.count); }

  // Draws into the canvas; `coarse` < 1 for fewer pixels and depths of the middles, while it moves.
  draw(camera, look, coarse = 1) {
    const ratio = (devicePixelRatio || 1) * coarse;
    const size = camera.size.map((value) => Math.max(Math.round(value * ratio), 1));
    if (this.canvas.width !== size[0]) this.canvas.width = size[0];
    if (this.canvas.height !== size[1]) this.canvas.height = size[1];
    this.into(null, size, camera, look, coarse < 1);
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits until it is drawn
  }

  into(target, size, camera, look, fast) {
    const { gl, world } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.viewport(0, 0, ...size);
    gl.clearColor(...rgb(look.back), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!world) return;
    const shared = this.shared(size, camera, look);
    if (world.flat) gl.disable(gl.DEPTH_TEST);
    else { gl.enable(gl.DEPTH_TEST); this.sort(shared.turn, fast); }
    for (const copy of [...world.copies, [0, 0, 0]]) {
      const away = copy.some((value) => value !== 0) ? 1 - look.away : 1;
      if (away === 1) gl.clear(gl.DEPTH_BUFFER_BIT); // the cell itself stands before its copies
      this.grains(world.flat ? "disk" : fast ? "fast" : "sphere", shared, look, copy, away);
      this.lines("lines", shared, look, copy, 1 - away);
    }
    this.lines("over", { ...shared, cut: 0 }, look, [0, 0, 0], 0);
    gl.disable(gl.DEPTH_TEST);
    this.lines("marks", { ...shared, cut: 0, fog: 0 }, look, [0, 0, 0], 0);
  }

  shared(size, camera, look) {
    const { world } = this;
    const reach = 0.5 * Math.hypot(...world.extent);
    const per = camera.scale;
    const { cell } = world;
    return {
      turn: camera.axes(), scale: [(2 * per) / camera.size[0], (2 * per) / camera.size[1]],
      shift: [(2 * camera.shift[0]) / camera.size[0], (-2 * camera.shift[1]) / camera.size[1]],
      deep: (world.copies.length ? 3.5 : 1.5) * reach + 4 * world.meanRadius, pixel: camera.size[0] / (size[0] * per), unit: 1 / look.perPixel, reach,
      fog: look.fog, back: rgb(look.back), rim: rgb(look.rim), flat_: world.flat ? 1 : 0, cut: world.cut ? 1 : 0,
      lattice: cell.rows.flat(), inverse: cell.inverse.flat(), begin: cell.begin,
    };
  }

  // Nearest first lets hidden spheres be left out early, farthest first lets edges blend.
  sort(axes, nearestFirst) {
    const key = `${nearestFirst} ${axes}`;
    if (key === this.sorted) return;
    this.sorted = key;
    this.fill(this.codes, byDepth(this.world, axes, nearestFirst), this.world.code.length);
  }

  grains(name, shared, look, copy, away) {
    const { gl } = this;
    const used = this.programs[name];
    gl.useProgram(used.program);
    ["place", "level", "palette"].forEach((each, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.textures[each]);
      used.set(each, unit, "integer");
    });
    used.all(shared);
    used.all({ copy, fade: 1 - away * (1 - look.dim), shrink: look.shrink, rimWidth: Math.min(0.7 / look.perPixel, 0.1 * this.world.meanRadius) });
    gl.bindVertexArray(this.codes.array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.codes.count);
  }

  lines(name, shared, look, copy, fade) {
    const { gl } = this;
    const { array, count } = this.strokes[name];
    if (!count) return;
    const used = this.programs.line;
    gl.useProgram(used.program);
    used.all(shared);
    used.all({ copy, fade, tones: look.tones.flatMap(rgb) });
    gl.bindVertexArray(array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
  }

  // The same picture on a canvas of its own.
  picture(camera, look) {
    const { gl } = this;
    const size = camera.size.map((value) => Math.round(value));
    const target = gl.createFramebuffer();
    const buffers = [[gl.COLOR_ATTACHMENT0, gl.RGBA8], [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24]].map(([place, format]) => {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, ...size);
      gl.bindFramebuffer(gl.FRAMEBUFFER, target);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
      return buffer;
    });
    this.into(target, size, camera, look, false);
    const bytes = new Uint8ClampedArray(4 * size[0] * size[1]);
    gl.readPixels(0, 0, ...size, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(bytes.buffer));
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(target);
    buffers.forEach((buffer) => gl.deleteRenderbuffer(buffer));
    return upright(bytes, size);
  }
}

// Rows from below to above, as the graphics unit has them, on a canvas the right way up.
function upright(bytes, [wide, high]) {
  const canvas = Object.assign(document.createElement("canvas"), { width: wide, height: high });
  const turned = new Uint8ClampedArray(bytes.length);
  for (let row = 0; row < high; row++) turned.set(bytes.subarray(4 * wide * (high - 1 - row), 4 * wide * (high - row)), 4 * wide * row);
  for (let k = 3; k < turned.length; k += 4) turned[k] = 255;
  canvas.getContext("2d").putImageData(new ImageData(turned, wide, high), 0, 0);
  return canvas;
}

function texture(gl, target, [inner, wide, high, format, type], values) {
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, target);
  gl.texImage2D(gl.TEXTURE_2D, 0, inner, wide, high, 0, format, type, values);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
}

// A linked program and the way to its uniforms; names it does not have are left out.
function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made));
  const known = new Map();
  const integer = new Set(["flat_", "cut"]);
  const set = (name, value, kind) => {
    if (!known.has(name)) known.set(name, gl.getUniformLocation(made, name));
    const place = known.get(name);
    if (!place) return;
    if (kind === "integer" || integer.has(name)) gl.uniform1i(place, value);
    else if (!Array.isArray(value)) gl.uniform1f(place, value);
    else if (value.length === 2) gl.uniform2fv(place, value);
    else if (value.length === 3) gl.uniform3fv(place, value);
    else if (value.length === 9) gl.uniformMatrix3fv(place, name === "turn" || name === "inverse", value);
    else gl.uniform3fv(place, value);
  };
  return { program: made, set, all: (values) => Object.entries(values).forEach(([name, value]) => set(name, value)) };
}
