// The packing on a Canvas2D: disks in their cell, spheres seen from a side, contacts as lines.

import { theme } from "./colours.js";
import { shades } from "./shades.js";

const WIDTHS = 16;

export class PackingView {
  constructor(canvas, picked) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.options = { colour: "contact_number", lines: "force" };
    this.turn = [0.5, 0.4];
    this.whole();
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("wheel", (event) => this.zoomed(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => { this.from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    canvas.addEventListener("pointerup", () => { this.from = null; });
    canvas.addEventListener("click", (event) => { picked(this.pick(event)); });
  }

  show(data) { this.data = data; this.prepared = null; this.draw(); }
  set(options) { Object.assign(this.options, options); this.prepared = null; this.draw(); }
  whole() { this.zoom = 1; this.shift = [0, 0]; this.draw(); }

  zoomed(event) {
    event.preventDefault();
    const factor = Math.exp(-0.0015 * event.deltaY);
    const box = this.canvas.getBoundingClientRect();
    const at = [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
    const before = this.zoom;
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.5), 60);
    this.shift = this.shift.map((s, k) => at[k] + (s - at[k]) * (this.zoom / before));
    this.draw();
  }

  moved(event) {
    if (!this.from || !this.data) return;
    const step = [event.clientX - this.from[0], event.clientY - this.from[1]];
    this.from = [event.clientX, event.clientY];
    if (this.data.header.dimension === 3 && !event.shiftKey) {
      this.turn = [this.turn[0] + 0.008 * step[0], Math.min(Math.max(this.turn[1] + 0.008 * step[1], -1.57), 1.57)];
      this.prepared = null;
    } else this.shift = this.shift.map((s, k) => s + step[k]);
    this.draw();
  }

  // Everything in the plane of the screen, once for a frame and a direction of view.
  prepare() {
    const { header } = this.data;
    const flat = header.dimension === 2;
    const middle = header.low.map((low, k) => 0.5 * (low + header.high[k]));
    const [s, c] = [Math.sin(this.turn[0]), Math.cos(this.turn[0])];
    const [u, w] = [Math.sin(this.turn[1]), Math.cos(this.turn[1])];
    const see = flat
      ? (x, y) => [x - middle[0], y - middle[1], 0]
      : (x, y, z) => {
        const [a, b, e] = [x - middle[0], y - middle[1], z - middle[2]];
        return [c * a - s * b, w * e + u * (s * a + c * b), -(w * (s * a + c * b) - u * e)];
      };
    const far = (array, k) => (flat ? see(array[2 * k], array[2 * k + 1]) : see(array[3 * k], array[3 * k + 1], array[3 * k + 2]));
    const origin = far(new Float32Array(header.dimension), 0);
    const along = (array, k) => far(array, k).map((value, i) => value - origin[i]);
    const disks = flat ? this.images(header, far) : spheres(header, this.data, far);
    const reach = flat
      ? [0.5 * (header.high[0] - header.low[0]), 0.5 * (header.high[1] - header.low[1])]
      : Array(2).fill(0.5 * Math.hypot(...header.high.map((high, k) => high - header.low[k])));
    this.prepared = { disks, far, along, reach, frame: outline(header, see), shade: shades(this.data, this.options.colour, theme()) };
  }

  // Each disk and its periodic copies that reach into the cell, as [index, x, y].
  images(header, far) {
    const { radius } = this.data;
    const found = [];
    const cell = header.cell;
    for (let k = 0; k < header.grain_count; k++) found.push([k, ...far(this.data.position, k)]);
    if (!cell) return found;
    const [[a, b], [p, q]] = cell.vectors;
    const det = a * q - b * p;
    const rows = [[q / det, -p / det], [-b / det, a / det]];
    const room = rows.map((row) => Math.hypot(...row));
    for (let k = 0; k < header.grain_count; k++) {
      const [x, y] = [this.data.position[2 * k], this.data.position[2 * k + 1]];
      const steps = rows.map((row, axis) => {
        const part = row[0] * x + row[1] * y;
        const near = radius[k] * room[axis];
        if (!cell.periodic[axis]) return [0];
        return [0, ...(part < near ? [1] : []), ...(part > 1 - near ? [-1] : [])];
      });
      const [, px, py] = found[k];
      for (const m of steps[0]) for (const n of steps[1]) if (m || n) found.push([k, px + m * a + n * p, py + m * b + n * q, 0]);
    }
    return found;
  }

  draw() {
    if (!this.data) return;
    const started = performance.now();
    const { canvas, context } = this;
    const ratio = devicePixelRatio || 1;
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
    if (!wide || !high) return;
    if (canvas.width !== Math.round(wide * ratio)) canvas.width = Math.round(wide * ratio);
    if (canvas.height !== Math.round(high * ratio)) canvas.height = Math.round(high * ratio);
    if (!this.prepared) this.prepare();
    const { reach, frame } = this.prepared;
    const scale = 0.96 * this.zoom * Math.min(wide / (2 * reach[0]), high / (2 * reach[1]));
    this.scale = scale;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, wide, high);
    context.setTransform(ratio * scale, 0, 0, -ratio * scale, ratio * (wide / 2 + this.shift[0]), ratio * (high / 2 + this.shift[1]));
    context.save();
    if (this.data.header.dimension === 2 && this.data.header.cell) { context.clip(frame); }
    this.grains(context, scale);
    this.lines(context);
    context.restore();
    context.lineWidth = 1.2 / scale;
    context.strokeStyle = theme().ink;
    context.stroke(frame);
    this.drawn = performance.now() - started;
  }

  grains(context, scale) {
    const { disks, shade } = this.prepared;
    const { radius, header } = this.data;
    const colours = theme();
    context.strokeStyle = colours.rim;
    context.lineWidth = Math.min(0.7 / scale, 0.1 * header.mean_radius);
    if (header.dimension === 3) {
      for (const [k, x, y] of disks) {
        context.beginPath();
        context.arc(x, y, radius[k], 0, 2 * Math.PI);
        context.fillStyle = shade.colours[shade.level[k]];
        context.fill();
        context.stroke();
      }
      return;
    }
    const paths = shade.colours.map(() => new Path2D());
    for (const [k, x, y] of disks) {
      const path = paths[shade.level[k]];
      path.moveTo(x + radius[k], y);
      path.arc(x, y, radius[k], 0, 2 * Math.PI);
    }
    context.globalAlpha = this.options.lines === "none" ? 1 : 0.55;
    paths.forEach((path, level) => { context.fillStyle = shade.colours[level]; context.fill(path); context.stroke(path); });
    context.globalAlpha = 1;
  }

  // Contacts by colour and width; those through the border are drawn from both ends.
  lines(context) {
    const kind = this.options.lines;
    const { pair, branch, image, normal_force: force, gained, header } = this.data;
    if (kind === "none" || !pair) return;
    const colours = theme();
    const unit = (header.dimension === 2 ? 0.35 : 0.12) * header.mean_radius; // thin: spheres lie behind one another
    const groups = new Map();
    const put = (colour, width, i, j, array, c, outside) => {
      const level = Math.max(1, Math.min(Math.round(width * WIDTHS / 4), WIDTHS));
      const key = `${colour} ${level}`;
      if (!groups.has(key)) groups.set(key, [colour, (4 * level * unit) / WIDTHS, new Path2D()]);
      const path = groups.get(key)[2];
      const [x, y] = this.prepared.along(array, c);
      const ends = outside ? [[i, 1], [j, -1]] : [[i, 1]];
      for (const [k, sign] of ends) {
        const [p, q] = this.prepared.far(this.data.position, k);
        path.moveTo(p, q);
        path.lineTo(p + sign * x, q + sign * y);
      }
    };
    const dimension = header.dimension;
    for (let c = 0; c < header.contact_count; c++) {
      let [colour, width] = [colours.force, 0.5];
      const size = force ? Math.max(force[c], 0) : 0.5;
      if (kind === "force") width = size;
      if (kind === "strong") { width = size; colour = size > 1 ? colours.force : colours.weak; }
      if (kind === "changes") colour = gained && gained[c] ? colours.gain : colours.line;
      const outside = image.subarray(c * dimension, (c + 1) * dimension).some((step) => step !== 0);
      put(colour, width, pair[2 * c], pair[2 * c + 1], branch, c, outside);
    }
    if (kind === "changes" && this.data.lost_pair) {
      const { lost_pair: lost, lost_branch: line } = this.data;
      for (let c = 0; 2 * c < lost.length; c++) put(colours.loss, 0.5, lost[2 * c], lost[2 * c + 1], line, c, true);
    }
    context.lineCap = "round";
    for (const [colour, width, path] of groups.values()) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.stroke(path);
    }
  }

  // The grain under the pointer, the nearest to the eye, as words.
  pick(event) {
    if (!this.prepared) return "";
    const box = this.canvas.getBoundingClientRect();
    const x = (event.clientX - box.left - box.width / 2 - this.shift[0]) / this.scale;
    const y = -(event.clientY - box.top - box.height / 2 - this.shift[1]) / this.scale;
    const hit = this.prepared.disks.findLast(([k, p, q]) => Math.hypot(p - x, q - y) < this.data.radius[k]);
    if (!hit) return "";
    const [k] = hit;
    const { number, radius, contact_number: contacts, held, spin, velocity, header } = this.data;
    const words = [`grain ${number[k]}`, `R = ${radius[k].toPrecision(4)}`];
    if (contacts) words.push(`${contacts[k]} contacts`, held[k] ? "held" : "rattler");
    const row = (array) => { const w = array.length / header.grain_count; return Math.hypot(...array.subarray(k * w, (k + 1) * w)).toPrecision(3); };
    if (velocity) words.push(`|c| = ${row(velocity)}`);
    if (spin) words.push(header.dimension === 2 ? `ω = ${spin[k].toPrecision(3)}` : `|ω| = ${row(spin)}`);
    return words.join(" · ");
  }
}

function spheres(header, data, far) {
  const found = [];
  for (let k = 0; k < header.grain_count; k++) found.push([k, ...far(data.position, k)]);
  return found.sort((one, two) => one[3] - two[3]);
}

function outline(header, see) {
  const path = new Path2D();
  const zero = Array(header.dimension).fill(0);
  const vectors = header.cell ? header.cell.vectors : header.high.map((high, k) => zero.map((_, i) => (i === k ? high - header.low[k] : 0)));
  const start = header.cell ? zero : header.low;
  const at = (steps) => see(...zero.map((_, i) => start[i] + steps.reduce((sum, step, k) => sum + step * vectors[k][i], 0)));
  const draw = (corners) => corners.forEach((steps, k) => { const [x, y] = at(steps); if (k) path.lineTo(x, y); else path.moveTo(x, y); });
  if (header.dimension === 2) { draw([[0, 0], [1, 0], [1, 1], [0, 1]]); path.closePath(); return path; }
  for (const end of [0, 1]) { draw([[0, 0, end], [1, 0, end], [1, 1, end], [0, 1, end], [0, 0, end]]); }
  for (const [a, b] of [[0, 0], [0, 1], [1, 0], [1, 1]]) draw([[a, b, 0], [a, b, 1]]);
  return path;
}
