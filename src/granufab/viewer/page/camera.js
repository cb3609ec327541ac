// Where the packing is looked at from: turn, zoom and shift, and the way to the screen and back.

const ZOOMS = [0.2, 80];
const FILLED = 0.96;

export class Camera {
  constructor() {
    this.size = [1, 1];
    this.reach = [1, 1];
    this.flat = true;
    this.reset();
  }

  reset() { this.zoom = 1; this.shift = [0, 0]; this.turn = [0.5, 0.4]; }

  // Pixels of the screen per unit of length.
  get scale() { return FILLED * this.zoom * Math.min(this.size[0] / (2 * this.reach[0]), this.size[1] / (2 * this.reach[1])); }

  // What lies in `box`, an extent of the data, fills the screen at zoom 1.
  fit(flat, extent) {
    this.flat = flat;
    this.reach = flat ? [0.5 * extent[0], 0.5 * extent[1]] : Array(2).fill(0.5 * Math.hypot(...extent));
  }

  // Rows of the rotation into the view: right, up, towards the eye.
  axes() {
    if (this.flat) return [1, 0, 0, 0, 1, 0, 0, 0, 1];
    const [s, c] = [Math.sin(this.turn[0]), Math.cos(this.turn[0])];
    const [u, w] = [Math.sin(this.turn[1]), Math.cos(this.turn[1])];
    return [c, -s, 0, u * s, u * c, w, -w * s, -w * c, u];
  }

  // The screen point (from its upper left corner) of a point in the view, and back.
  toScreen(x, y) { return [this.size[0] / 2 + this.shift[0] + x * this.scale, this.size[1] / 2 + this.shift[1] - y * this.scale]; }
  fromScreen(x, y) { return [(x - this.size[0] / 2 - this.shift[0]) / this.scale, -(y - this.size[1] / 2 - this.shift[1]) / this.scale]; }

  // The point of the screen under `at` stays where it is.
  zoomAt(factor, at) {
    const before = this.zoom;
    this.zoom = Math.min(Math.max(this.zoom * factor, ZOOMS[0]), ZOOMS[1]);
    this.shift = this.shift.map((s, k) => {
      const from = at[k] - this.size[k] / 2;
      return from + (s - from) * (this.zoom / before);
    });
  }

  pan(step) { this.shift = this.shift.map((s, k) => s + step[k]); }

  rotate(step) {
    const steep = Math.min(Math.max(this.turn[1] + 0.008 * step[1], -1.57), 1.57);
    this.turn = [this.turn[0] + 0.008 * step[0], steep];
  }

  // The same view on another screen, `times` as large.
  enlarged(times) {
    const other = Object.assign(new Camera(), this);
    other.size = this.size.map((value) => value * times);
    other.shift = this.shift.map((value) => value * times);
    return other;
  }
}

// Points (x, y, z in a row, `width` apart) seen along the axes, relative to nothing.
export function seen(axes, x, y, z) {
  return [
    axes[0] * x + axes[1] * y + axes[2] * z,
    axes[3] * x + axes[4] * y + axes[5] * z,
    axes[6] * x + axes[7] * y + axes[8] * z,
  ];
}
