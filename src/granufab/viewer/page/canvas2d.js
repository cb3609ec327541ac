// The packing on a Canvas2D, where WebGL2 is missing or slow: the processor writes the pixels.

import { seen } from "./camera.js";
import { rgb } from "./colours.js";
import { Raster } from "./raster.js";
import { IMAGES, byDepth, steps } from "./scene.js";
import { Segments } from "./segments.js";

const FINER = 2; // spheres at rest are drawn so much larger, then made small, for smooth edges
const LEAST = 0.12; // strength of the thinnest line

export class CanvasRenderer {
  name = "canvas2d";

  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
    this.strokes = { lines: new Segments(0), over: new Segments(0), marks: new Segments(0) };
  }

  setUp() {}
  get smooths() { return Boolean(this.world) && !this.world.flat; }
  load(world) { this.world = world; }
  paint(shade) { this.shade = shade; }
  stroke(name, found) { this.strokes[name] = found; }

  draw(camera, look, coarse = 1, quick = false) {
    const ratio = (devicePixelRatio || 1) * coarse;
    const size = camera.size.map((value) => Math.max(Math.round(value * ratio), 1));
    if (this.canvas.width !== size[0]) this.canvas.width = size[0];
    if (this.canvas.height !== size[1]) this.canvas.height = size[1];
    this.into(this.canvas, camera, look, this.smooths && coarse === 1 && !quick ? FINER : 1);
  }

  picture(camera, look) {
    const canvas = Object.assign(document.createElement("canvas"), { width: Math.round(camera.size[0]), height: Math.round(camera.size[1]) });
    this.into(canvas, camera, look, this.smooths ? FINER : 1);
    return canvas;
  }

  into(canvas, camera, look, finer) {
    const size = [canvas.width * finer, canvas.height * finer];
    const raster = this.raster(size);
    raster.clear(bytes(look.back));
    if (this.world && this.shade) this.fill(raster, camera.enlarged(size[0] / camera.size[0]), look);
    const context = canvas.getContext("2d");
    if (finer === 1) context.putImageData(raster.image, 0, 0);
    else {
      this.large.getContext("2d").putImageData(raster.image, 0, 0);
      context.imageSmoothingQuality = "medium";
      context.drawImage(this.large, 0, 0, canvas.width, canvas.height);
    }
  }

  // Room for so many pixels, kept from picture to picture.
  raster([wide, high]) {
    const known = this.kept && this.kept.wide === wide && this.kept.high === high;
    if (!known) {
      this.kept = new Raster(wide, high);
      this.large = Object.assign(document.createElement("canvas"), { width: wide, height: high });
    }
    return this.kept;
  }

  fill(raster, camera, look) {
    const { world, strokes } = this;
    const axes = camera.axes();
    const [left, top] = camera.toScreen(0, 0);
    const view = { raster, axes, left, top, scale: camera.scale, back: bytes(look.back), reach: camera.scale * 0.5 * Math.hypot(...world.extent), ratio: camera.scale / look.perPixel, fog: look.fog };
    for (const copy of [...world.copies, [0, 0, 0]]) {
      const away = copy.some((value) => value !== 0) ? look.away : 0;
      const shift = seen(axes, ...copy);
      if (!away) raster.depth.fill(-Infinity); // the cell itself stands before its copies
      this.grains(view, look, shift, 1 - (1 - away) * (1 - look.dim));
      lines(view, strokes.lines, look, shift, away, !world.flat);
    }
    if (world.cut) outside(view, world);
    lines(view, strokes.over, look, [0, 0, 0], 0, !world.flat);
    lines({ ...view, fog: 0 }, strokes.marks, look, [0, 0, 0], 0, false);
  }

  grains({ raster, axes, left, top, scale, back, reach, ratio, fog }, look, shift, fade) {
    const { world, shade } = this;
    const { place, cell, flat } = world;
    const palette = shade.colours.map((text) => faded(bytes(text), back, fade));
    const rim = faded(bytes(look.rim), back, fade);
    const width = Math.min(0.7 * ratio, 0.1 * world.meanRadius * scale);
    const moved = Array.from({ length: IMAGES }, (_, image) => steps(image).reduce((sum, step, axis) => seen(axes, ...cell.rows[axis]).map((value, i) => sum[i] + step * value), shift));
    for (const code of flat ? world.code : byDepth(world, axes, true)) {
      const k = 4 * Math.floor(code / IMAGES);
      const by = moved[code % IMAGES];
      const [a, b, c] = [place[k], place[k + 1], place[k + 2]];
      const x = left + scale * (axes[0] * a + axes[1] * b + axes[2] * c + by[0]);
      const y = top - scale * (axes[3] * a + axes[4] * b + axes[5] * c + by[1]);
      const radius = scale * place[k + 3] * look.shrink;
      if (x < -radius || y < -radius || x > raster.wide + radius || y > raster.high + radius) continue;
      const colour = palette[shade.level[k / 4]];
      if (flat) { raster.disk(x, y, radius, colour[0], colour[1], colour[2], rim, width); continue; }
      const z = scale * (axes[6] * a + axes[7] * b + axes[8] * c + by[2]);
      const haze = fog * Math.min(Math.max(0.5 - 0.5 * (z / reach), 0), 1);
      raster.ball(x, y, z, radius, colour[0] + haze * (back[0] - colour[0]), colour[1] + haze * (back[1] - colour[1]), colour[2] + haze * (back[2] - colour[2]));
    }
  }
}

const bytes = (text) => rgb(text).map((share) => Math.round(255 * share));
const faded = (colour, back, share) => colour.map((value, k) => value + share * (back[k] - value));

function lines({ raster, axes, left, top, scale, back, reach, ratio, fog }, found, look, shift, fade, solid) {
  const tones = look.tones.map((text) => faded(bytes(text), back, fade));
  const d = found.data;
  for (let k = 0; k < 8 * found.count; k += 8) {
    const [a, b, c, u, v, w] = [d[k], d[k + 1], d[k + 2], d[k + 3], d[k + 4], d[k + 5]];
    const x = left + scale * (axes[0] * a + axes[1] * b + axes[2] * c + shift[0]);
    const y = top - scale * (axes[3] * a + axes[4] * b + axes[5] * c + shift[1]);
    const dx = scale * (axes[0] * u + axes[1] * v + axes[2] * w);
    const dy = -scale * (axes[3] * u + axes[4] * v + axes[5] * w);
    const wanted = d[k + 6] < 0 ? -d[k + 6] * ratio : d[k + 6] * scale;
    const half = Math.max(wanted, 0.5);
    if (Math.max(x, x + dx) < -half || Math.max(y, y + dy) < -half || Math.min(x, x + dx) > raster.wide + half || Math.min(y, y + dy) > raster.high + half) continue;
    const z = scale * (axes[6] * a + axes[7] * b + axes[8] * c + shift[2]);
    const dz = scale * (axes[6] * u + axes[7] * v + axes[8] * w);
    const tone = tones[d[k + 7]];
    const haze = solid ? fog * Math.min(Math.max(0.5 - (0.5 * (z + dz / 2)) / reach, 0), 1) : 0;
    const strength = Math.min(Math.max(wanted / half, LEAST), 1);
    raster.line(x, y, z, dx, dy, dz, half, strength, tone[0] + haze * (back[0] - tone[0]), tone[1] + haze * (back[1] - tone[1]), tone[2] + haze * (back[2] - tone[2]), solid);
  }
}

// The background again where the cell is not, row by row.
function outside({ raster, left, top, scale, back }, { cell }) {
  const word = (255 << 24) | (back[2] << 16) | (back[1] << 8) | back[0];
  const pixels = new Uint32Array(raster.bytes.buffer);
  for (let row = 0; row < raster.high; row++) {
    const y = (top - row - 0.5) / scale - cell.begin[1];
    let [low, high] = [-Infinity, Infinity];
    for (const [p, q] of cell.inverse.slice(0, 2)) { // 0 ≤ p x + q y ≤ 1
      if (Math.abs(p) < 1e-9) { if (q * y < 0 || q * y > 1) high = -Infinity; continue; }
      const ends = [(-q * y) / p, (1 - q * y) / p].sort((one, other) => one - other);
      [low, high] = [Math.max(low, ends[0]), Math.min(high, ends[1])];
    }
    const at = (x) => Math.min(Math.max(Math.round(left + scale * (x + cell.begin[0])), 0), raster.wide);
    const [from, to] = low < high ? [at(low), at(high)] : [0, 0];
    pixels.fill(word, row * raster.wide, row * raster.wide + from);
    pixels.fill(word, row * raster.wide + to, (row + 1) * raster.wide);
  }
}
