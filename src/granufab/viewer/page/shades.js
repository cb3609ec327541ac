// The colour of every grain: a level for each, the colours of the levels, and a legend in words.

import { LEVELS, rising, signed } from "./colours.js";

const share = (value, low, high) => (high > low ? (value - low) / (high - low) : 0.5);
const round = (value) => Number(value.toPrecision(3));

export function shades(data, kind, colours) {
  const count = data.header.grain_count;
  const level = new Uint8Array(count);
  const plain = { level, colours: [colours.grain], legend: "" };
  if (kind === "rattler" && data.held) {
    for (let k = 0; k < count; k++) level[k] = data.held[k] ? 0 : 1;
    return { level, colours: [colours.grain, colours.weak], legend: "blue: rattlers" };
  }
  if (kind === "contact_number" && data.contact_number) {
    const most = Math.max(data.header.dimension === 2 ? 6 : 12, 1);
    for (let k = 0; k < count; k++) level[k] = Math.round((LEVELS - 1) * Math.min(data.contact_number[k] / most, 1));
    return { level, colours: rising, legend: `contacts: dark 0 … bright ${most} and more` };
  }
  if (kind === "speed" && data.velocity) {
    const size = lengths(data.velocity, count);
    const high = quantile(size, 0.98);
    for (let k = 0; k < count; k++) level[k] = Math.round((LEVELS - 1) * Math.min(share(size[k], 0, high), 1));
    return { level, colours: rising, legend: `|c|: dark 0 … bright ${round(high)}` };
  }
  if (kind === "spin" && data.spin) {
    const flat = data.header.dimension === 2;
    const value = flat ? data.spin : lengths(data.spin, count);
    const high = quantile(value.map(Math.abs), 0.98);
    const low = flat ? -high : 0;
    for (let k = 0; k < count; k++) level[k] = Math.round((LEVELS - 1) * Math.min(Math.max(share(value[k], low, high), 0), 1));
    return { level, colours: flat ? signed : rising, legend: `ω: ${round(low)} … ${round(high)}` };
  }
  return kind === "none" ? plain : { ...plain, legend: "not in these data" };
}

function lengths(vectors, count) {
  const width = vectors.length / count;
  const size = new Float32Array(count);
  for (let k = 0; k < count; k++) size[k] = Math.hypot(...vectors.subarray(k * width, (k + 1) * width));
  return size;
}

function quantile(values, part) {
  const sorted = Float32Array.from(values).sort();
  return sorted[Math.floor(part * (sorted.length - 1))] || 0;
}
