// The packing: one scene, drawn by WebGL2 or Canvas2D, turned and picked by hand.

import { Camera } from "./camera.js";
import { CanvasRenderer } from "./canvas2d.js";
import { theme } from "./colours.js";
import { gestures } from "./gestures.js";
import { drawnLegend, lineKey } from "./legend.js";
import { identity, located, rings, under, words } from "./picking.js";
import { pngPicture, svgPicture } from "./pictures.js";
import { scene } from "./scene.js";
import { TONES, edges, segments } from "./segments.js";
import { shades } from "./shades.js";
import { WebglRenderer } from "./webgl.js";

const REST = 160; // ms without a move until the picture is drawn at its best
const SLOW = 26; // ms of a picture above which fewer pixels are drawn while it moves
const QUICK = 9;
const COARSEST = 0.3;
const HOPELESS = 45; // ms of a picture at rest: no graphics unit needs so long, the processor plays one

export class PackingView {
  // `place`: the section or the canvas in it; `picked` is called with words on what was picked.
  constructor(place, picked) {
    this.section = place.closest("section");
    this.picked = picked;
    this.options = { colour: "contact_number", lines: "force", images: "border" };
    this.camera = new Camera();
    this.legend = "";
    this.drawn = 0;
    this.coarse = 1;
    this.wanted = new URLSearchParams(location.hash.slice(1)).get("renderer");
    this.take(this.section.querySelector("canvas"), this.wanted === "canvas2d");
    new ResizeObserver(() => this.resized()).observe(this.canvas.parentElement);
    new MutationObserver(() => this.dressed()).observe(document.documentElement, { attributeFilter: ["class"] });
    const images = this.section.querySelector("#images");
    if (images) images.addEventListener("change", () => this.set({ images: images.value }));
  }

  // ---- the canvas and what draws on it

  take(canvas, plain) {
    this.canvas = canvas;
    try {
      this.drawer = plain ? new CanvasRenderer(canvas) : new WebglRenderer(canvas);
    } catch (error) {
      if (error.message !== "no WebGL2") console.warn(error.message); // programs that this device refuses
      this.fallBack();
      return;
    }
    this.section.dataset.renderer = this.drawer.name;
    gestures(canvas, {
      zoom: (factor, at) => { this.camera.zoomAt(factor, at); this.moved(); },
      drag: (step, aside) => { if (this.camera.flat || aside) this.camera.pan(step); else this.camera.rotate(step); this.moved(); },
      click: (at) => this.pick(at),
      whole: () => this.whole(),
    });
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.lost = setTimeout(() => this.fallBack(), 1500);
    });
    canvas.addEventListener("webglcontextrestored", () => { clearTimeout(this.lost); this.lost = null; this.drawer.setUp(); this.reload(); });
  }

  // A canvas that once had WebGL can have nothing else: another takes its place.
  fallBack() {
    this.lost = null;
    const other = this.canvas.cloneNode(false);
    this.canvas.replaceWith(other);
    this.take(other, true);
    this.reload();
  }

  // Where WebGL2 is only played by the processor, the pixels are written directly: several times
  // quicker. Told by time, not by name: the best of three pictures, the first of which sets up.
  judge() {
    if (this.wanted === "webgl2" || this.renderer !== "webgl2" || !this.data) return;
    for (let k = 0; k < 2; k++) if (this.spent < HOPELESS || this.render(1) < HOPELESS) return;
    this.fallBack();
  }

  get renderer() { return this.drawer.name; }

  // ---- what is shown

  show(data) {
    const started = performance.now();
    this.data = data;
    this.reload();
    this.judge();
    if (this.mark) this.said();
    this.drawn = performance.now() - started;
  }

  set(options) {
    const changed = Object.keys(options).filter((name) => options[name] !== undefined && options[name] !== this.options[name]);
    for (const name of changed) this.options[name] = options[name];
    const images = this.section.querySelector("#images");
    if (images) images.value = this.options.images;
    if (changed.includes("images")) this.reload();
    else if (changed.length) this.dressed(changed.includes("lines"));
  }

  whole() { this.camera.reset(); this.still(); }
  draw() { this.dressed(); }

  reload() {
    if (!this.data) return;
    const { header } = this.data;
    this.world = scene(this.data, this.options.images);
    const wide = this.world.copies.length ? 1.5 : 1;
    this.camera.fit(header.dimension === 2, this.world.extent.map((size) => size * wide));
    this.drawer.load(this.world);
    this.drawer.stroke("over", edges(this.world));
    this.dressed(true);
  }

  // Colours, and lines where they are others.
  dressed(lines = false) {
    if (!this.world) return;
    const colours = theme();
    this.shade = shades(this.data, this.options.colour, colours);
    this.legend = this.shade.legend;
    this.drawer.paint(this.shade);
    if (lines) {
      this.lines = segments(this.data, this.world, this.options.lines);
      this.drawer.stroke("lines", this.lines);
    }
    this.colours = colours;
    this.key = drawnLegend(this.shade, lineKey(this.data, this.options.lines), colours);
    const scale = this.section.querySelector("#scale");
    if (scale) scale.innerHTML = this.key;
    this.atOnce();
  }

  // How the grains look: fainter, and small among spheres, where lines are to be seen.
  look() {
    const { colours, world } = this;
    const lined = this.lines && this.lines.count > 0;
    return {
      back: colours.panel, rim: colours.rim, tones: TONES.map((name) => colours[name]), away: world.flat ? 0.45 : 0.7, dim: lined ? (world.flat ? 0.45 : 0.3) : 0,
      shrink: lined && !world.flat ? 0.3 : 1, fog: world.flat ? 0 : 0.55, perPixel: this.camera.scale,
    };
  }

  // ---- drawing, at rest and while it moves

  resized() { this.snapped(); if (this.world) this.still(); }

  // The canvas on whole pixels of the page, lest the browser smear them.
  snapped() {
    const box = this.canvas.parentElement.getBoundingClientRect();
    const [left, top] = [Math.ceil(box.left), Math.ceil(box.top)];
    const size = { left: left - box.left, top: top - box.top, width: Math.floor(box.right) - left, height: Math.floor(box.bottom) - top };
    for (const [name, value] of Object.entries(size)) this.canvas.style[name] = `${Math.max(value, 0)}px`;
  }

  still() { clearTimeout(this.resting); this.render(1); }

  // A picture at once, smoothed when it stays for a while: frames follow one another quickly.
  atOnce() {
    clearTimeout(this.resting);
    this.render(1, true);
    if (this.drawer.smooths) this.resting = setTimeout(() => this.still(), REST);
  }

  moved() {
    if (this.asked || !this.world) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = null;
      const spent = this.render(this.coarse);
      if (spent > SLOW) this.coarse = Math.max(this.coarse * Math.max(Math.sqrt(0.7 * SLOW / spent), 0.4), COARSEST);
      else if (spent < QUICK && this.coarse < 1) this.coarse = Math.min(this.coarse / 0.75, 1);
      clearTimeout(this.resting);
      if (this.coarse < 1) this.resting = setTimeout(() => this.still(), REST);
    });
  }

  render(coarse, quick = false) {
    const [wide, high] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!this.world || !wide || !high || this.lost) return 0;
    const started = performance.now();
    this.camera.size = [wide, high];
    const look = this.look();
    this.marked(look);
    this.drawer.draw(this.camera, look, coarse, quick);
    this.spent = performance.now() - started;
    return this.spent;
  }

  // ---- what is picked

  marked(look) {
    if (!this.mark && !this.ringed) return;
    this.ringed = Boolean(this.mark);
    this.drawer.stroke("marks", rings(this.data, this.world, this.lines, located(this.data, this.mark), this.camera, look.shrink));
  }

  pick(at) {
    if (!this.world) return;
    this.mark = identity(this.data, under(this.world, this.lines, this.camera, at, this.look().shrink));
    this.said();
    this.still();
  }

  said() { this.picked(words(this.data, this.mark, located(this.data, this.mark))); }

  // ---- pictures to keep

  picture(type) {
    const seen = { camera: this.camera, look: this.look(), key: this.key, colours: this.colours };
    if (type === "image/svg+xml") return svgPicture({ world: this.world, shade: this.shade, strokes: this.strokes() }, seen);
    return pngPicture(this.drawer, seen);
  }

  strokes() {
    const { look, mark } = { look: this.look(), mark: located(this.data, this.mark) };
    return { lines: this.lines, over: edges(this.world), marks: rings(this.data, this.world, this.lines, mark, this.camera, look.shrink) };
  }
}
