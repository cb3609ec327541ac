// Disks, spheres and lines written pixel by pixel into an image: where no graphics unit helps,
// this is several times quicker than paths of a canvas. Places and sizes in pixels of the image.

export class Raster {
  constructor(wide, high) {
    this.image = new ImageData(wide, high);
    this.bytes = this.image.data;
    this.depth = new Float32Array(wide * high);
    Object.assign(this, { wide, high });
  }

  clear([r, g, b]) {
    new Uint32Array(this.bytes.buffer).fill((255 << 24) | (b << 16) | (g << 8) | r);
    this.depth.fill(-Infinity);
  }

  // A disk with a soft edge and a rim.
  disk(x, y, radius, r, g, b, rim, width) {
    const { wide, bytes } = this;
    const outer = radius + 0.5;
    const [inside, full] = [Math.max(radius - width - 0.5, 0), Math.min(width, 1)];
    const [top, bottom] = [Math.max(Math.ceil(y - outer - 0.5), 0), Math.min(Math.floor(y + outer - 0.5), this.high - 1)];
    for (let row = top; row <= bottom; row++) {
      const v = row + 0.5 - y;
      const reach = Math.sqrt(Math.max(outer * outer - v * v, 0));
      const [left, right] = [Math.max(Math.ceil(x - reach - 0.5), 0), Math.min(Math.floor(x + reach - 0.5), wide - 1)];
      for (let column = left; column <= right; column++) {
        const u = column + 0.5 - x;
        const square = u * u + v * v;
        const k = 4 * (row * wide + column);
        if (square < inside * inside) { bytes[k] = r; bytes[k + 1] = g; bytes[k + 2] = b; continue; }
        const far = Math.sqrt(square);
        const cover = Math.min(radius - far + 0.5, 1);
        if (cover <= 0) continue;
        const edge = Math.min(Math.max(far - radius + width + 0.5, 0), 1) * full;
        bytes[k] += cover * (r + edge * (rim[0] - r) - bytes[k]);
        bytes[k + 1] += cover * (g + edge * (rim[1] - g) - bytes[k + 1]);
        bytes[k + 2] += cover * (b + edge * (rim[2] - b) - bytes[k + 2]);
      }
    }
  }

  // A shaded sphere, its depth that of its surface; z towards the eye, in pixels too.
  ball(x, y, z, radius, r, g, b) {
    const { wide, bytes, depth } = this;
    const [top, bottom] = [Math.max(Math.ceil(y - radius - 0.5), 0), Math.min(Math.floor(y + radius - 0.5), this.high - 1)];
    const [slope, rise, share] = [-0.4 / radius, -0.5 / radius, 0.77 / radius];
    for (let row = top; row <= bottom; row++) {
      const v = row + 0.5 - y;
      const room = radius * radius - v * v;
      const reach = Math.sqrt(Math.max(room, 0));
      const [left, right] = [Math.max(Math.ceil(x - reach - 0.5), 0), Math.min(Math.floor(x + reach - 0.5), wide - 1)];
      for (let column = left; column <= right; column++) {
        const place = row * wide + column;
        if (depth[place] >= z + radius) continue;
        const u = column + 0.5 - x;
        const up = Math.sqrt(Math.max(room - u * u, 0));
        if (depth[place] >= z + up) continue;
        depth[place] = z + up;
        const light = 0.42 + 0.58 * Math.max(slope * u + rise * v + share * up, 0);
        bytes[4 * place] = r * light;
        bytes[4 * place + 1] = g * light;
        bytes[4 * place + 2] = b * light;
      }
    }
  }

  // A line with round ends; with `solid` among the spheres, shaded across, else on top of all.
  line(x, y, z, dx, dy, dz, half, strength, r, g, b, solid) {
    const { wide, bytes, depth } = this;
    const length = Math.hypot(dx, dy);
    const [c, s] = length > 1e-6 ? [dx / length, dy / length] : [1, 0];
    const room = half + 0.5;
    const [top, bottom] = [Math.max(Math.ceil(Math.min(y, y + dy) - room - 0.5), 0), Math.min(Math.floor(Math.max(y, y + dy) + room - 0.5), this.high - 1)];
    const [first, last] = [Math.min(x, x + dx) - room, Math.max(x, x + dx) + room];
    for (let row = top; row <= bottom; row++) {
      const v = row + 0.5 - y;
      const [one, other] = Math.abs(s) > 1e-6 ? [x + (v * c - room) / s, x + (v * c + room) / s] : [first, last];
      const left = Math.max(Math.ceil(Math.max(Math.min(one, other), first) - 0.5), 0);
      const right = Math.min(Math.floor(Math.min(Math.max(one, other), last) - 0.5), wide - 1);
      for (let column = left; column <= right; column++) {
        const u = column + 0.5 - x;
        const along = u * c + v * s;
        const beyond = along < 0 ? along : along > length ? along - length : 0;
        const aside = v * c - u * s;
        const far = beyond ? Math.sqrt(aside * aside + beyond * beyond) : Math.abs(aside);
        const cover = Math.min(half - far + 0.5, 1) * strength;
        if (cover <= 0) continue;
        const place = row * wide + column;
        let light = 1;
        if (solid) {
          const high = z + dz * (length > 1e-6 ? (along - beyond) / length : 0.5) + half;
          if (cover < 0.06 || depth[place] > high) continue;
          if (cover > 0.5) depth[place] = high;
          const across = Math.min(far / half, 1);
          light = 0.62 + 0.38 * Math.sqrt(1 - across * across);
        }
        const k = 4 * place;
        bytes[k] += cover * (r * light - bytes[k]);
        bytes[k + 1] += cover * (g * light - bytes[k + 1]);
        bytes[k + 2] += cover * (b * light - bytes[k + 2]);
      }
    }
  }
}
