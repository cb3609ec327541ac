// The surface E(n) of a 3D state: radius and colour by E, drawn as shaded faces on a canvas or as SVG.

import { rising, theme } from "./colours.js";
import { unit } from "./rose.js";

const LIGHT = [-0.35, 0.45, 0.82];
const NAMES = ["x", "y", "z"];
const COLOURS = rising.map((text) => text.match(/\d+/g).map(Number));

// From the axes of the data to right, up and towards the eye.
function eye([around, up]) {
  const [s, c, u, w] = [Math.sin(around), Math.cos(around), Math.sin(up), Math.cos(up)];
  return ([x, y, z]) => [c * x - s * y, w * z + u * (s * x + c * y), u * z - w * (s * x + c * y)];
}

function shaded(share, normal) {
  const light = 0.55 + 0.45 * Math.abs(normal.reduce((sum, n, k) => sum + n * LIGHT[k], 0));
  const colour = COLOURS[Math.round(Math.min(Math.max(share, 0), 1) * (COLOURS.length - 1))];
  return `rgb(${colour.map((value) => Math.round(value * light)).join(",")})`;
}

function normalOf([a, b, c, d]) {
  const [p, q] = [[0, 1, 2].map((k) => c[k] - a[k]), [0, 1, 2].map((k) => d[k] - b[k])];
  const cross = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
  const size = Math.hypot(...cross) || 1;
  return cross.map((value) => value / size);
}

// Everything to draw, from far to near, in units of the largest E, with its range.
export function scene(surface, turn) {
  const see = eye(turn);
  const all = surface.E.flat();
  const [least, most] = [Math.min(...all), Math.max(...all)];
  const points = surface.theta.map((theta, i) => surface.azimuth.map((azimuth, k) => {
    const r = Math.max(surface.E[i][k], 0) / most; // harmonics of few contacts may fall below 0
    return see([r * Math.sin(theta) * Math.cos(azimuth), r * Math.sin(theta) * Math.sin(azimuth), r * Math.cos(theta)]);
  }));
  const items = [];
  for (let i = 0; i + 1 < points.length; i++) {
    for (let k = 0; k + 1 < points[i].length; k++) {
      const corners = [points[i][k], points[i + 1][k], points[i + 1][k + 1], points[i][k + 1]];
      const mean = (surface.E[i][k] + surface.E[i + 1][k] + surface.E[i + 1][k + 1] + surface.E[i][k + 1]) / 4;
      const share = most > least ? (mean - least) / (most - least) : 0.5;
      items.push({ corners, depth: corners.reduce((sum, one) => sum + one[2], 0) / 4, colour: shaded(share, normalOf(corners)) });
    }
  }
  NAMES.forEach((name, k) => {
    const end = see(NAMES.map((_, other) => (other === k ? 1.22 : 0)));
    items.push({ axis: name, end, depth: 0.6 * end[2] });
  });
  items.sort((one, two) => one.depth - two.depth);
  return { items, least, most };
}

export class SurfaceView {
  constructor(canvas) {
    this.canvas = canvas;
    this.turn = [0.6, 0.35];
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("pointerdown", (event) => { this.from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { this.from = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.from) return;
      this.rotate(0.01 * (event.clientX - this.from[0]), 0.01 * (event.clientY - this.from[1]));
      this.from = [event.clientX, event.clientY];
    });
  }

  rotate(around, up) {
    this.turn = [this.turn[0] + around, Math.min(Math.max(this.turn[1] + up, -1.57), 1.57)];
    this.draw();
  }

  show(rose) { this.rose = rose; this.draw(); }

  draw() {
    const { canvas, rose } = this;
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
    if (!rose || !rose.surface || !wide || !high) return;
    const ratio = devicePixelRatio || 1;
    [canvas.width, canvas.height] = [Math.round(wide * ratio), Math.round(high * ratio)];
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    paint(context, rose, this.turn, wide, high);
  }

  async picture(type, title) {
    const [wide, high] = [900, 675];
    if (type === "svg") return new Blob([written(this.rose, this.turn, wide, high, title)], { type: "image/svg+xml" });
    const canvas = Object.assign(document.createElement("canvas"), { width: 2 * wide, height: 2 * high });
    const context = canvas.getContext("2d");
    context.scale(2, 2);
    context.fillStyle = theme().back;
    context.fillRect(0, 0, wide, high);
    paint(context, this.rose, this.turn, wide, high);
    context.font = "16px system-ui, sans-serif";
    context.fillStyle = theme().ink;
    context.textAlign = "left";
    context.fillText(title, 14, 24);
    return new Promise((done) => { canvas.toBlob(done, "image/png"); });
  }
}

const scaleOf = (wide, high) => 0.37 * Math.min(wide, high - 30);
const steps = (least, most) => [0, 0.5, 1].map((part) => (least + part * (most - least)).toFixed(3));

function paint(context, rose, turn, wide, high) {
  const colours = theme();
  const { items, least, most } = scene(rose.surface, turn);
  const scale = scaleOf(wide, high);
  const at = ([x, y]) => [wide / 2 + scale * x, (high - 30) / 2 - scale * y];
  context.font = "13px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 0.6;
  for (const item of items) {
    context.beginPath();
    if (item.axis) {
      context.moveTo(...at([0, 0]));
      context.lineTo(...at(item.end));
      context.strokeStyle = context.fillStyle = colours.ink;
      context.stroke();
      const [x, y] = at(item.end.map((value) => 1.09 * value));
      context.fillText(item.axis, x, y);
      continue;
    }
    item.corners.forEach((corner, k) => (k ? context.lineTo(...at(corner)) : context.moveTo(...at(corner))));
    context.closePath();
    context.fillStyle = context.strokeStyle = item.colour;
    context.fill();
    context.stroke();
  }
  const bar = [0.2 * wide, high - 28, 0.6 * wide];
  rising.forEach((colour, k) => {
    context.fillStyle = colour;
    context.fillRect(bar[0] + (bar[2] * k) / rising.length, bar[1], bar[2] / rising.length + 1, 8);
  });
  context.fillStyle = colours.ink;
  steps(least, most).forEach((text, k) => context.fillText(text + (k === 2 ? ` ${unit(rose)}` : ""), bar[0] + (bar[2] * k) / 2, high - 10));
}

function written(rose, turn, wide, high, title) {
  const colours = theme();
  const { items, least, most } = scene(rose.surface, turn);
  const scale = scaleOf(wide, high);
  const at = ([x, y]) => `${(wide / 2 + scale * x).toFixed(2)},${((high - 30) / 2 - scale * y).toFixed(2)}`;
  const text = (place, words, anchor = "middle") => {
    const [x, y] = place.split(",");
    return `<text x="${x}" y="${y}" text-anchor="${anchor}" dominant-baseline="middle">${words}</text>`;
  };
  const parts = items.map((item) => (item.axis
    ? `<polyline points="${at([0, 0])} ${at(item.end)}" stroke="${colours.ink}"/>${text(at(item.end.map((value) => 1.09 * value)), item.axis)}`
    : `<polygon points="${item.corners.map(at).join(" ")}" fill="${item.colour}" stroke="${item.colour}"/>`));
  const step = (0.6 * wide) / rising.length;
  rising.forEach((colour, k) => parts.push(`<rect x="${0.2 * wide + step * k}" y="${high - 28}" width="${step + 0.5}" height="8" fill="${colour}"/>`));
  steps(least, most).forEach((words, k) => parts.push(text(`${wide * (0.2 + 0.3 * k)},${high - 10}`, words + (k === 2 ? ` ${unit(rose)}` : ""))));
  const font = `font-family="system-ui, DejaVu Sans, sans-serif" font-size="14" fill="${colours.ink}" stroke-width="0.6"`;
  const back = `<rect width="${wide}" height="${high}" fill="${colours.back}"/>`;
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${wide}" height="${high}" viewBox="0 0 ${wide} ${high}" ${font}>${back}${text("14,22", title, "start")}${parts.join("")}</svg>`;
}
