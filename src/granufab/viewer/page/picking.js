// What lies under the pointer, what is said of it, and how it is marked from frame to frame.

import { seen } from "./camera.js";
import { IMAGES, centre } from "./scene.js";
import { NONE, Segments, TONES } from "./segments.js";

const NEAR = 4; // pixels
const CORE = 0.3; // share of the radius that is the grain's own, though lines meet there
const TURN = 40; // strokes of a ring

// {grain} or {contact} or {lost}, places in the arrays; null beside everything.
export function under(world, lines, camera, at, shrink) {
  const axes = camera.axes();
  const [x, y] = camera.fromScreen(...at);
  const shifts = [[0, 0, 0], ...world.copies].map((copy) => seen(axes, ...copy));
  const grain = grainUnder(world, axes, x, y, shifts, shrink);
  const line = lineUnder(lines, axes, x, y, shifts, NEAR / camera.scale, world.flat);
  const deeper = grain && line && !world.flat && grain.depth > line.depth + 1e-6;
  if (line && !deeper && !(grain && world.flat && grain.far < CORE)) return line.contact < 0 ? { lost: -1 - line.contact } : { contact: line.contact };
  return grain ? { grain: grain.grain } : null;
}

function grainUnder(world, axes, x, y, shifts, shrink) {
  let best = null;
  for (const code of world.code) {
    const k = Math.floor(code / IMAGES);
    const r = shrink * world.place[4 * k + 3];
    const [a, b, c] = seen(axes, ...centre(world, code));
    for (const [mx, my, mz] of shifts) {
      const far = Math.hypot(a + mx - x, b + my - y);
      if (far > r) continue;
      const depth = world.flat ? r - far : c + mz + Math.sqrt(r * r - far * far);
      if (!best || depth > best.depth) best = { grain: k, depth, far: far / r };
    }
  }
  return best;
}

function lineUnder(lines, axes, x, y, shifts, room, flat) {
  let best = null;
  const d = lines.data;
  for (let c = 0; c < lines.count; c++) {
    if (lines.contact[c] === NONE) continue;
    const [px, py, pz] = seen(axes, d[8 * c], d[8 * c + 1], d[8 * c + 2]);
    const [dx, dy, dz] = seen(axes, d[8 * c + 3], d[8 * c + 4], d[8 * c + 5]);
    const reach = Math.max(d[8 * c + 6], room);
    for (const [mx, my, mz] of shifts) {
      const [u, v] = [x - px - mx, y - py - my];
      const share = Math.min(Math.max((u * dx + v * dy) / (dx * dx + dy * dy || 1), 0), 1);
      const far = Math.hypot(u - share * dx, v - share * dy);
      if (far > reach) continue;
      const depth = pz + mz + share * dz;
      if (!best || (flat ? far < best.far : depth > best.depth)) best = { contact: lines.contact[c], far, depth };
    }
  }
  return best;
}

// The same thing by numbers that other frames know too.
export function identity(data, found) {
  if (!found) return null;
  if (found.grain !== undefined) return { grain: data.number[found.grain] };
  const pair = found.lost === undefined ? data.pair : data.lost_pair;
  const c = found.lost === undefined ? found.contact : found.lost;
  return { pair: [data.number[pair[2 * c]], data.number[pair[2 * c + 1]]] };
}

// Where that is in a frame: {grain, grains, contact, lost}, what there is of it.
export function located(data, mark) {
  if (!mark) return null;
  if (mark.grain !== undefined) return { grain: data.number.indexOf(mark.grain) };
  const grains = mark.pair.map((number) => data.number.indexOf(number));
  return { grains, contact: joint(data.pair, grains), lost: joint(data.lost_pair, grains) };
}

function joint(pair, [i, j]) {
  for (let c = 0; pair && 2 * c < pair.length; c++) {
    const [a, b] = [pair[2 * c], pair[2 * c + 1]];
    if ((a === i && b === j) || (a === j && b === i)) return c;
  }
  return -1;
}

export function words(data, mark, place) {
  if (!mark) return "";
  return (mark.grain === undefined ? contactWords(data, mark, place) : grainWords(data, mark, place)).join(" · ");
}

const number = (value) => {
  const short = Number(value.toPrecision(3));
  return (short && Math.abs(short) < 1e-3 ? short.toExponential() : String(short)).replace(/-/g, "−");
};

function grainWords(data, mark, { grain: k }) {
  if (k < 0) return [`grain ${mark.grain}`, "not in this frame"];
  const { radius, contact_number: contacts, held, spin, velocity, header } = data;
  const row = (array) => { const w = array.length / header.grain_count; return [...array.subarray(k * w, (k + 1) * w)]; };
  const said = [`grain ${mark.grain}`, `R = ${number(radius[k])} m`];
  if (contacts) said.push(`${contacts[k]} contacts`, held[k] ? "held" : "rattler");
  for (const [symbol, array, unit] of [["v", velocity, "m/s"], ["ω", spin, "rad/s"]]) {
    if (!array) continue;
    const value = row(array);
    said.push(value.length === 1 ? `${symbol} = ${number(value[0])} ${unit}` : `${symbol} = (${value.map(number).join(", ")}) ${unit}, |${symbol}| = ${number(Math.hypot(...value))}`);
  }
  return said;
}

function contactWords(data, mark, { grains, contact: c, lost }) {
  const said = [`contact ${mark.pair.join(" – ")}`];
  if (grains.some((k) => k < 0)) return [...said, "not in this frame"];
  if (c < 0) return [...said, lost < 0 ? "no contact in this frame" : "lost since the frame before"];
  const { normal, force, normal_force: along, gap, gained, counted, header } = data;
  const d = header.dimension;
  if (along) {
    const tangent = Array.from({ length: d }, (_, k) => force[d * c + k] - along[c] * normal[d * c + k]);
    said.push(`fₙ = ${number(along[c])} ⟨fₙ⟩`, `|fₜ| = ${number(Math.hypot(...tangent))} ⟨fₙ⟩`, along[c] > 1 ? "strong" : "weak");
  }
  if (gap) said.push(`gap = ${number(gap[c])} m`);
  if (gained) said.push(gained[c] ? "gained since the frame before" : "there in the frame before");
  if (counted && !counted[c]) said.push("not counted by z");
  return said;
}

// Rings around what is marked, in the plane of the screen, and the line of a contact.
export function rings(data, world, lines, place, camera, shrink) {
  const found = new Segments(8 * TURN);
  if (!place) return found;
  const tone = TONES.indexOf("mark");
  const axes = camera.axes();
  const grains = (place.grain === undefined ? place.grains : [place.grain]).filter((k) => k >= 0);
  const width = place.grain === undefined ? -0.7 : -1.5;
  for (const code of world.code) {
    const k = Math.floor(code / IMAGES);
    if (!grains.includes(k)) continue;
    ring(found, centre(world, code), shrink * world.place[4 * k + 3], axes, width, tone);
  }
  const which = place.grain !== undefined ? NONE : place.contact >= 0 ? place.contact : -1 - place.lost;
  if (which === NONE || (place.contact < 0 && place.lost < 0)) return found;
  const d = lines.data;
  for (let c = 0; c < lines.count; c++) {
    if (lines.contact[c] === which) found.put(...d.subarray(8 * c, 8 * c + 6), -Math.max(2, d[8 * c + 6] * camera.scale), tone, NONE);
  }
  return found;
}

function ring(found, [x, y, z], radius, axes, width, tone) {
  const at = (k) => {
    const [c, s] = [radius * Math.cos((2 * Math.PI * k) / TURN), radius * Math.sin((2 * Math.PI * k) / TURN)];
    return [x + c * axes[0] + s * axes[3], y + c * axes[1] + s * axes[4], z + c * axes[2] + s * axes[5]];
  };
  for (let k = 0; k < TURN; k++) {
    const [from, to] = [at(k), at(k + 1)];
    found.put(...from, to[0] - from[0], to[1] - from[1], to[2] - from[2], width, tone, NONE);
  }
}
