// The grains of a frame as numbers to draw: places from the middle of the cell, periodic images.
//
// place: Float32Array (x, y, z, radius) of each grain. code: Uint32Array, one per disk to draw,
// 27 grain + image, where image is (m + 1) + 3 (n + 1) + 9 (o + 1) for the copy moved by
// m, n, o lattice vectors; HOME is none. copies: the whole is drawn at each of these shifts too.

export const HOME = 13;
export const IMAGES = 27;

export function steps(image) { return [(image % 3) - 1, (Math.floor(image / 3) % 3) - 1, Math.floor(image / 9) - 1]; }

export function scene(data, images) {
  const { header, position, radius } = data;
  const count = header.grain_count;
  const flat = header.dimension === 2;
  const middle = [0, 1, 2].map((k) => (k < header.dimension ? 0.5 * (header.low[k] + header.high[k]) : 0));
  const place = new Float32Array(4 * count);
  for (let k = 0; k < count; k++) {
    for (let i = 0; i < header.dimension; i++) place[4 * k + i] = position[header.dimension * k + i] - middle[i];
    place[4 * k + 3] = radius[k];
  }
  const extent = header.high.map((high, k) => high - header.low[k]);
  const cell = lattice(header, middle, extent);
  const code = Array.from({ length: count }, (_, k) => IMAGES * k + HOME);
  if (images === "border" && header.cell) closing(cell, place, count, code);
  const copies = images === "all" && header.cell ? around(cell, flat) : [];
  return { count, flat, middle, place, code: Uint32Array.from(code), copies, cell, extent, meanRadius: header.mean_radius, cut: images === "border" && flat && Boolean(header.cell) };
}

// Lattice vectors (rows), their inverse (columns), the corner where the cell begins.
function lattice(header, middle, extent) {
  const flat = header.dimension === 2;
  const bare = extent.map((size, k) => extent.map((_, i) => (i === k ? size : 0)));
  const rows = (header.cell ? header.cell.vectors : bare).map((row) => [...row, 0].slice(0, 3));
  if (flat) rows.push([0, 0, 1]);
  const periodic = [...(header.cell ? header.cell.periodic : []), false, false, false].slice(0, 3);
  const begin = [0, 1, 2].map((k) => (header.cell || k >= header.dimension ? 0 : header.low[k]) - middle[k]);
  return { rows, inverse: inverted(rows), periodic, begin };
}

function inverted([a, b, c]) {
  const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const volume = a.reduce((sum, value, k) => sum + value * cross(b, c)[k], 0);
  return [cross(b, c), cross(c, a), cross(a, b)].map((column) => column.map((value) => value / volume));
}

// Copies that reach into the cell from beyond its faces.
function closing({ rows, inverse, periodic, begin }, place, count, code) {
  const room = inverse.map((column) => Math.hypot(...column));
  for (let k = 0; k < count; k++) {
    const moved = [0, 1, 2].map((axis) => {
      if (!periodic[axis]) return [0];
      let part = 0;
      for (let i = 0; i < 3; i++) part += inverse[axis][i] * (place[4 * k + i] - begin[i]);
      const near = place[4 * k + 3] * room[axis];
      return [0, ...(part < near ? [1] : []), ...(part > 1 - near ? [-1] : [])];
    });
    if (moved.every((steps) => steps.length === 1)) continue;
    for (const m of moved[0]) for (const n of moved[1]) for (const o of moved[2]) {
      if (m || n || o) code.push(IMAGES * k + (m + 1) + 3 * (n + 1) + 9 * (o + 1));
    }
  }
}

// Shifts to the neighbouring cells: 8 in a periodic plane, 26 in space.
function around({ rows, periodic }, flat) {
  const found = [];
  for (let image = 0; image < IMAGES; image++) {
    const by = steps(image);
    if (image === HOME || (flat && by[2]) || by.some((step, axis) => step && !periodic[axis])) continue;
    found.push([0, 1, 2].map((i) => by.reduce((sum, step, axis) => sum + step * rows[axis][i], 0)));
  }
  return found;
}

// The middle of a disk: grain and copy.
export function centre({ place, cell }, code) {
  const k = Math.floor(code / IMAGES);
  if (code % IMAGES === HOME) return [place[4 * k], place[4 * k + 1], place[4 * k + 2]];
  const by = steps(code % IMAGES);
  return [0, 1, 2].map((i) => place[4 * k + i] + by.reduce((sum, step, axis) => sum + step * cell.rows[axis][i], 0));
}

// The disks by depth, the farthest first, or the nearest: a counting sort of 4096 steps.
export function byDepth(world, axes, nearestFirst) {
  const { code, place, cell } = world;
  const deep = Float32Array.from({ length: IMAGES }, (_, image) => steps(image).reduce((sum, step, axis) => sum + step * dot(axes, cell.rows[axis]), 0));
  const depth = new Float32Array(code.length);
  let [low, high] = [Infinity, -Infinity];
  for (let c = 0; c < code.length; c++) {
    const k = 4 * Math.floor(code[c] / IMAGES);
    const value = axes[6] * place[k] + axes[7] * place[k + 1] + axes[8] * place[k + 2] + deep[code[c] % IMAGES];
    depth[c] = value;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  const times = (nearestFirst ? -1 : 1) * (4095 / (high - low || 1));
  const from = nearestFirst ? high : low;
  const begin = new Uint32Array(4097);
  for (let c = 0; c < code.length; c++) begin[1 + Math.floor((depth[c] - from) * times)]++;
  for (let b = 0; b < 4096; b++) begin[b + 1] += begin[b];
  const sorted = new Uint32Array(code.length);
  for (let c = 0; c < code.length; c++) sorted[begin[Math.floor((depth[c] - from) * times)]++] = code[c];
  return sorted;
}

const dot = (axes, row) => axes[6] * row[0] + axes[7] * row[1] + axes[8] * row[2];
