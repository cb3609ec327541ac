// A saved frame as the server would send it: numbers from their steps, contacts of a criterion.

// Args: the block of the frame, the grains' block, the changes' block or null, which of the
// frame's criteria, and the definition of z. docs/viewer.md tells how a frame is saved.
export function frameOf(block, grains, changes, place, definition) {
  const { criteria, grains: _, position_low, steps, ...rest } = block.header;
  const rule = criteria[place];
  const mean = rule.mean_normal_force[definition] ?? null;
  const header = { ...rest, criterion: rule.criterion, z_definition: definition, contact_count: rule.contact_count, mean_normal_force: mean, missing: rule.missing };
  header.changes = changes ? changes.header.changes : { missing: "a saved file holds changes under the run's own criterion only" };
  const data = { header, radius: grains.radius, number: grains.number, position: positions(block, position_low, steps.position) };
  for (const name of ["velocity", "spin"]) if (block[name]) data[name] = scaled(block[name], steps[name]);
  walls(data, block, mean);
  if (rule.missing) return data;
  contacts(data, block, rule, mean);
  data.held = bits(block.held, header.grain_count, place);
  data.counted = counted(data.pair, definition, data.held, block.touched && bits(block.touched, header.grain_count, 0));
  data.contact_number = numbers(data.pair, header.grain_count);
  if (changes) changed(data, changes);
  return data;
}

const scaled = (whole, step) => Float32Array.from(whole, (value) => value * step);

function positions(block, low, step) {
  const size = low.length;
  return Float32Array.from(block.position, (value, k) => low[k % size] + value * step[k % size]);
}

// Row `row` of flags that were packed eight to a byte, the first in the lowest bit.
function bits(packed, count, row) {
  const begin = row * Math.ceil(count / 8);
  return Uint32Array.from({ length: count }, (_, k) => (packed[begin + (k >> 3)] >> (k & 7)) & 1);
}

// Which pairs of a list are contacts under a criterion.
function chosen(block, rule, count) {
  if (rule.kind === "listed") return Array.from({ length: count }, (_, k) => k);
  const own = rule.kind === "own" ? bits(block[`${rule.list}_own`], count, 0) : null;
  const rank = own ? null : block[`${rule.list}_${rule.kind}_levels`];
  const counts = own ? (k) => own[k] : (k) => rank[k] > (rule.kind === "force" ? rule.level : rule.levels - 1 - rule.level);
  return Array.from({ length: count }, (_, k) => k).filter(counts);
}

function contacts(data, block, rule, mean) {
  const { list } = rule;
  const [delta, second, image] = ["first", "second", "image"].map((name) => block[`${list}_${name}`]);
  const first = delta.slice();
  for (let k = 1; k < first.length; k++) first[k] += first[k - 1]; // differences, which wrap around
  const picked = chosen(block, rule, first.length);
  const size = data.header.dimension;
  const rows = (array) => { const all = new array.constructor(picked.length * size); picked.forEach((c, k) => { for (let d = 0; d < size; d++) all[k * size + d] = array[c * size + d]; }); return all; };
  data.pair = Uint32Array.from(picked.flatMap((c) => [first[c], second[c]]));
  data.image = Int32Array.from(rows(image));
  data.branch = branches(data, data.pair, data.image);
  data.normal = units(data.branch, size);
  const gap = block[`${list}_gap`];
  if (gap) data.gap = Float32Array.from(picked, (c) => gap[c] * block.header.steps[`${list}_gap`]);
  const force = block[`${list}_force`];
  if (!force || mean === null) return;
  data.force = scaled(rows(force), block.header.steps.force / mean);
  data.normal_force = Float32Array.from(picked, (_, k) => dot(data.force, data.normal, k * size, size));
}

function dot(one, two, begin, size) {
  let sum = 0;
  for (let d = begin; d < begin + size; d++) sum += one[d] * two[d];
  return sum;
}

// From the wrapped i to the image of j, along the lattice vectors.
function branches(data, pair, image) {
  const { position, header } = data;
  const size = header.dimension;
  const found = new Float32Array(image.length);
  for (let k = 0; k < pair.length / 2; k++) {
    for (let d = 0; d < size; d++) {
      let along = position[pair[2 * k + 1] * size + d] - position[pair[2 * k] * size + d];
      for (let v = 0; header.cell && v < size; v++) along += image[k * size + v] * header.cell.vectors[v][d];
      found[k * size + d] = along;
    }
  }
  return found;
}

function units(vectors, size) {
  const found = new Float32Array(vectors.length);
  for (let begin = 0; begin < vectors.length; begin += size) {
    const length = Math.sqrt(dot(vectors, vectors, begin, size)) || 1;
    for (let d = begin; d < begin + size; d++) found[d] = vectors[d] / length;
  }
  return found;
}

function counted(pair, definition, held, touched) {
  const count = pair.length / 2;
  const rules = { z: () => 1, z_backbone: (i, j) => held[i] & held[j], z_mechanical: (i, j) => touched[i] | touched[j] };
  return Uint32Array.from({ length: count }, (_, k) => rules[definition](pair[2 * k], pair[2 * k + 1]));
}

function numbers(pair, count) {
  const found = new Uint32Array(count);
  for (const grain of pair) found[grain] += 1;
  return found;
}

function changed(data, changes) {
  if (changes.header.changes.missing) return;
  data.gained = bits(changes.gained, data.header.contact_count, 0);
  data.lost_pair = changes.lost_pair;
  data.lost_branch = branches(data, changes.lost_pair, changes.lost_image);
}

function walls(data, block, mean) {
  for (const name of ["wall_grain", "wall", "wall_normal"]) if (block[name]) data[name] = block[name];
  if (block.wall_force && mean !== null) data.wall_force = scaled(block.wall_force, 1 / mean);
}
