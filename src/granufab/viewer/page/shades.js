// The colour of every grain: a level for each, the colours of the levels, and what the legend says.
//
// level: Uint8Array; colours: one per level; scale: {title, colours, low, high} for a colour bar, or
// items: [[colour, words]] for a key; legend: the same in words.

import { LEVELS, rising, signed } from "./colours.js";

const round = (value) => String(Number(value.toPrecision(2)));
const ABSENT = "not in these data";

export function shades(data, kind, colours) {
  const level = new Uint8Array(data.header.grain_count);
  const plain = { level, colours: [colours.grain], scale: null, items: [], legend: "" };
  if (kind === "none") return plain;
  const found = KINDS[kind] && KINDS[kind](data, level, colours);
  return found ? { ...plain, ...found } : { ...plain, legend: ABSENT, items: [[colours.grain, ABSENT]] };
}

const KINDS = {
  rattler({ held, header }, level, colours) {
    if (!held) return null;
    for (let k = 0; k < header.grain_count; k++) level[k] = held[k] ? 0 : 1;
    return { colours: [colours.grain, colours.weak], items: [[colours.grain, "held"], [colours.weak, "rattler"]], legend: "blue: rattlers" };
  },
  contact_number({ contact_number: number, header }, level) {
    if (!number) return null;
    const most = header.dimension === 2 ? 6 : 12;
    return bar(level, number, [0, most], rising, ["c [-], contacts of a grain", "0", `${most} and more`]);
  },
  speed({ velocity, header }, level) {
    if (!velocity) return null;
    const size = lengths(velocity, header.grain_count);
    const high = quantile(size, 0.98);
    return bar(level, size, [0, high], rising, ["|v| [m/s], velocity", "0", `≥ ${round(high)}`]);
  },
  spin({ spin, header }, level) {
    if (!spin) return null;
    const flat = header.dimension === 2;
    const value = flat ? spin : lengths(spin, header.grain_count);
    const high = quantile(value.map(Math.abs), 0.98);
    const ends = flat ? [`≤ ${round(-high)}`, `≥ ${round(high)}`] : ["0", `≥ ${round(high)}`];
    return bar(level, value, [flat ? -high : 0, high], flat ? signed : rising, [flat ? "ω [rad/s], rotation" : "|ω| [rad/s], rotation", ...ends]);
  },
};

function bar(level, value, [low, high], colours, [title, least, most]) {
  const wide = high > low ? high - low : 1;
  for (let k = 0; k < level.length; k++) {
    const share = Math.min(Math.max((value[k] - low) / wide, 0), 1);
    level[k] = Math.round((LEVELS - 1) * share);
  }
  return { colours, scale: { title, colours, low: least, high: most }, legend: `${title}: ${least} … ${most}` };
}

function lengths(vectors, count) {
  const width = vectors.length / count;
  const size = new Float32Array(count);
  for (let k = 0; k < count; k++) {
    let sum = 0;
    for (let i = k * width; i < (k + 1) * width; i++) sum += vectors[i] * vectors[i];
    size[k] = Math.sqrt(sum);
  }
  return size;
}

function quantile(values, part) {
  const sorted = Float32Array.from(values).sort();
  return sorted[Math.floor(part * (sorted.length - 1))] || 0;
}
