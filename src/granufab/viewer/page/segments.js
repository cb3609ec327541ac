// Contacts of a frame as lines to draw: force chains, weak and strong, changes, normals.
//
// data: Float32Array, 8 numbers a line: where it begins, the vector along it, half its width
// (of length; below 0 in pixels) and the place of its colour in TONES. contact: which one each line
// is; lost ones are −1 − their place in lost_pair, others (walls, the cell) NONE.

export const TONES = ["force", "weak", "gain", "loss", "soft", "ink", "mark", "back"];
export const NONE = 0x7fffffff;
const STRIDE = 8;
const [FORCE, WEAK, GAIN, LOSS, SOFT] = TONES.keys();

export class Segments {
  constructor(room) { this.data = new Float32Array(STRIDE * room); this.contact = new Int32Array(room); this.count = 0; }

  // One line; the room doubles when it is short.
  put(x, y, z, dx, dy, dz, half, tone, contact) {
    if (this.count === this.contact.length) this.grow();
    const d = this.data;
    const k = STRIDE * this.count;
    d[k] = x; d[k + 1] = y; d[k + 2] = z; d[k + 3] = dx; d[k + 4] = dy; d[k + 5] = dz; d[k + 6] = half; d[k + 7] = tone;
    this.contact[this.count++] = contact;
  }

  grow() {
    const room = 2 * this.contact.length + 64;
    const [data, contact] = [new Float32Array(STRIDE * room), new Int32Array(room)];
    data.set(this.data);
    contact.set(this.contact);
    Object.assign(this, { data, contact });
  }
}

// Half the width of a line for a mean force, in mean radii: thin in 3D, where lines hide one another.
const UNIT = { 2: 0.175, 3: 0.1 };
const WIDEST = 4;

// How a contact is dressed: [half width, tone], or null where it is not drawn.
function dresses(data, kind) {
  const { normal_force: force, gained, header } = data;
  const unit = UNIT[header.dimension] * header.mean_radius;
  const size = (c) => (force ? Math.min(Math.max(force[c], 0), WIDEST) : 0.5);
  if (kind === "force") return (c) => [unit * size(c), FORCE];
  if (kind === "strong") return (c) => [unit * size(c), force && force[c] > 1 ? FORCE : WEAK];
  if (kind === "changes") return (c) => (gained && gained[c] ? [0.9 * unit, GAIN] : [0.4 * unit, SOFT]);
  return () => [0.5 * unit, FORCE];
}

export function segments(data, world, kind) {
  const { pair, branch, image, header } = data;
  const found = new Segments(kind === "none" || !pair ? 0 : header.contact_count + 1024);
  if (kind === "none" || !pair) return found;
  const draw = kind === "normal" ? tick(data, world, found) : whole(data, world, found);
  const dress = dresses(data, kind);
  const late = []; // what is drawn above the rest
  const dimension = header.dimension;
  for (let c = 0; c < header.contact_count; c++) {
    const worn = dress(c);
    if (kind === "strong" && worn[1] === FORCE || kind === "changes" && worn[1] === GAIN) { late.push(c, worn); continue; }
    draw(pair[2 * c], pair[2 * c + 1], branch, c, worn, c, outside(image, c, dimension));
  }
  for (let k = 0; k < late.length; k += 2) draw(pair[2 * late[k]], pair[2 * late[k] + 1], branch, late[k], late[k + 1], late[k], outside(image, late[k], dimension));
  if (kind === "changes" && data.lost_pair) {
    const { lost_pair: lost, lost_branch: line } = data;
    const worn = [0.9 * UNIT[dimension] * header.mean_radius, LOSS];
    for (let c = 0; 2 * c < lost.length; c++) draw(lost[2 * c], lost[2 * c + 1], line, c, worn, -1 - c, true);
  }
  if (kind === "force" || kind === "strong") walls(data, world, found, kind);
  return found;
}

function outside(image, c, dimension) {
  for (let k = c * dimension; k < (c + 1) * dimension; k++) if (image[k]) return true;
  return false;
}

// From centre to centre; through the border from both ends, each to the other's image.
function whole({ header }, { place }, found) {
  const d = header.dimension;
  return (i, j, array, c, [half, tone], name, beyond) => {
    const [dx, dy, dz] = [array[d * c], array[d * c + 1], d === 3 ? array[3 * c + 2] : 0];
    found.put(place[4 * i], place[4 * i + 1], place[4 * i + 2], dx, dy, dz, half, tone, name);
    if (beyond) found.put(place[4 * j], place[4 * j + 1], place[4 * j + 2], -dx, -dy, -dz, half, tone, name);
  };
}

// A stroke along the normal, through the point of contact.
function tick({ header, normal }, { place }, found) {
  const d = header.dimension;
  const long = 0.9 * header.mean_radius;
  return (i, j, array, c, [half, tone], name, beyond) => {
    const [ri, rj] = [place[4 * i + 3], place[4 * j + 3]];
    const n = [normal[d * c], normal[d * c + 1], d === 3 ? normal[3 * c + 2] : 0];
    const b = [array[d * c], array[d * c + 1], d === 3 ? array[3 * c + 2] : 0];
    for (const [k, share] of beyond ? [[i, ri / (ri + rj)], [j, -rj / (ri + rj)]] : [[i, ri / (ri + rj)]]) {
      const from = [0, 1, 2].map((m) => place[4 * k + m] + share * b[m] - 0.5 * long * n[m]);
      found.put(...from, ...n.map((value) => long * value), half, tone, name);
    }
  };
}

// Forces on walls, from the centre of the grain to the wall.
function walls({ wall_grain: grain, wall_normal: normal, wall_force: force, header }, { place }, found, kind) {
  if (!grain || !force) return;
  const d = header.dimension;
  for (let c = 0; c < grain.length; c++) {
    const k = grain[c];
    const r = place[4 * k + 3];
    const n = [normal[d * c], normal[d * c + 1], d === 3 ? normal[3 * c + 2] : 0];
    let size = 0;
    for (let m = 0; m < d; m++) size += force[d * c + m] * n[m];
    const half = UNIT[d] * header.mean_radius * Math.min(Math.max(size, 0), WIDEST);
    found.put(place[4 * k], place[4 * k + 1], place[4 * k + 2], ...n.map((value) => r * value), half, kind === "strong" && size <= 1 ? WEAK : FORCE, NONE);
  }
}

// The edges of the cell.
export function edges({ cell, flat }) {
  const found = new Segments(12);
  const tone = TONES.indexOf("ink");
  const at = (by) => [0, 1, 2].map((i) => cell.begin[i] + by.reduce((sum, step, axis) => sum + step * cell.rows[axis][i], 0));
  for (const axis of flat ? [0, 1] : [0, 1, 2]) {
    for (const corner of flat ? [0, 1] : [0, 1, 2, 3]) {
      const by = [0, 0, 0];
      const others = [0, 1, 2].filter((other) => other !== axis);
      by[others[0]] = corner & 1;
      if (!flat) by[others[1]] = corner >> 1;
      found.put(...at(by), ...cell.rows[axis], -0.6, tone, NONE);
    }
  }
  return found;
}
