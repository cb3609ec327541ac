// What is seen, in pixels and in the order of painting: for vector pictures.
//
// A list of groups. Disks: {level, tint, disks: [x, y, radius, level, …]}, level −1 where they
// differ; lines: {tone, width, strength, tint, lines: [x, y, x, y, …]}. tint is the share of the
// background. Spheres and lines are sorted into slabs by depth, the farthest first.

import { seen } from "./camera.js";
import { HOME, IMAGES, byDepth, steps } from "./scene.js";

const SLABS = 32;
const WIDTHS = 24; // steps of width, each 15 % wider
const LEAST = 0.12; // strength of the thinnest line

export function plan(world, shade, strokes, camera, look) {
  const axes = camera.axes();
  const groups = [];
  const shifts = world.copies.map((copy) => [copy, look.away]);
  if (!world.flat) shifts.sort((one, two) => seen(axes, ...one[0])[2] - seen(axes, ...two[0])[2]);
  shifts.push([[0, 0, 0], 0]); // the cell itself stands before its copies
  const view = viewing(camera, axes);
  for (const [copy, tint] of shifts) {
    const slabs = Array.from({ length: world.flat ? 1 : SLABS }, () => ({ disks: new Map(), lines: new Map() }));
    disks(world, shade, view, look, copy, slabs);
    lines(world, strokes.lines, view, copy, slabs);
    slabs.forEach((slab, k) => {
      const far = world.flat ? tint : mixed(tint, look.fog * (1 - (k + 0.5) / SLABS));
      for (const [level, items] of slab.disks) groups.push({ level, tint: mixed(far, look.dim), disks: items });
      for (const group of slab.lines.values()) groups.push({ ...group, tint: far });
    });
  }
  // The cell behind the spheres, for a line has no depth here; marks before all.
  const flat = { ...world, flat: true };
  for (const name of ["over", "marks"]) {
    const found = [{ lines: new Map() }];
    lines(flat, strokes[name], view, [0, 0, 0], found);
    const drawn = [...found[0].lines.values()].map((group) => ({ ...group, tint: 0, over: world.flat || name === "marks" }));
    if (name === "over" && !world.flat) groups.unshift(...drawn);
    else groups.push(...drawn);
  }
  return groups;
}

const mixed = (one, other) => 1 - (1 - one) * (1 - other);

function viewing(camera, axes) {
  const [wide, high] = camera.size;
  const [left, top] = camera.toScreen(0, 0);
  const scale = camera.scale;
  return { axes, scale, left, top, wide, high, inside: (x, y, r) => x > -r && y > -r && x < wide + r && y < high + r };
}

function slabOf(world, depth) {
  if (world.flat) return 0;
  const reach = 0.5 * Math.hypot(...world.extent);
  return Math.min(Math.max(Math.floor(SLABS * (0.5 + 0.5 * (depth / reach))), 0), SLABS - 1);
}

function disks(world, shade, view, look, copy, slabs) {
  const { axes, scale, left, top, inside } = view;
  const { place, cell } = world;
  const order = world.flat ? world.code : byDepth(world, axes, false);
  const moved = Array.from({ length: IMAGES }, (_, image) => {
    const by = steps(image);
    return seen(axes, ...[0, 1, 2].map((i) => copy[i] + by.reduce((sum, step, axis) => sum + step * cell.rows[axis][i], 0)));
  });
  const home = moved[HOME];
  for (const code of order) {
    const k = Math.floor(code / IMAGES);
    const [mx, my, mz] = code % IMAGES === HOME ? home : moved[code % IMAGES];
    const [a, b, c] = [place[4 * k], place[4 * k + 1], place[4 * k + 2]];
    const x = left + scale * (axes[0] * a + axes[1] * b + axes[2] * c + mx);
    const y = top - scale * (axes[3] * a + axes[4] * b + axes[5] * c + my);
    const r = scale * place[4 * k + 3] * look.shrink;
    if (!inside(x, y, r)) continue;
    const level = shade.level[k];
    const slab = slabs[slabOf(world, axes[6] * a + axes[7] * b + axes[8] * c + mz - home[2])].disks;
    const name = world.flat ? level : -1;
    let items = slab.get(name);
    if (!items) slab.set(name, items = []);
    items.push(x, y, r, level);
  }
}

function lines(world, found, view, copy, slabs) {
  const { axes, scale, left, top, inside } = view;
  const shift = seen(axes, ...copy);
  const d = found.data;
  for (let k = 0; k < 8 * found.count; k += 8) {
    const [x, y, z] = [d[k], d[k + 1], d[k + 2]];
    const [u, v, w] = [d[k + 3], d[k + 4], d[k + 5]];
    const px = left + scale * (axes[0] * x + axes[1] * y + axes[2] * z + shift[0]);
    const py = top - scale * (axes[3] * x + axes[4] * y + axes[5] * z + shift[1]);
    const dx = scale * (axes[0] * u + axes[1] * v + axes[2] * w);
    const dy = -scale * (axes[3] * u + axes[4] * v + axes[5] * w);
    if (!inside(px + 0.5 * dx, py + 0.5 * dy, 0.5 * (Math.abs(dx) + Math.abs(dy)) + 4)) continue;
    const wanted = 2 * (d[k + 6] < 0 ? -d[k + 6] : d[k + 6] * scale);
    const step = wanted > 0 ? Math.max(Math.round(Math.log(wanted) / Math.log(1.15)), -WIDTHS) : -WIDTHS;
    const slab = slabs[slabOf(world, axes[6] * (x + u / 2) + axes[7] * (y + v / 2) + axes[8] * (z + w / 2))].lines;
    const name = 1000 * d[k + 7] + step;
    let group = slab.get(name);
    if (!group) {
      const width = 1.15 ** step;
      slab.set(name, group = { tone: d[k + 7], width: Math.max(width, 1), strength: Math.min(Math.max(width, LEAST), 1), lines: [] });
    }
    group.lines.push(px, py, px + dx, py + dy);
  }
}
