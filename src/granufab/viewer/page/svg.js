// The packing as a vector picture: what is seen, circles and lines.

import { blend } from "./colours.js";
import { plan } from "./plan.js";

const short = (value) => String(Math.round(100 * value) / 100);

// The legend, `key`, stands beneath in a strip of its own height.
export function vectors({ world, shade, strokes }, camera, look, key, strip) {
  const [wide, high] = camera.size.map(short);
  const looks = new Map(); // gradients of the spheres by colour
  const parts = [];
  let inside = true;
  for (const group of plan(world, shade, strokes, camera, look)) {
    if (group.over && inside) { parts.push("</g>"); inside = false; }
    if (!group.disks) parts.push(lines(group, look));
    else if (world.flat) parts.push(disks(group, look, shade, Math.min(0.7, 0.1 * world.meanRadius * camera.scale)));
    else parts.push(spheres(group, look, shade, looks));
  }
  if (inside) parts.push("</g>");
  const clip = world.cut ? `<clipPath id="cell"><polygon points="${corners(world, camera)}"/></clipPath>` : "";
  return [
    `<svg xmlns="http://www.w3.org/2000/svg" width="${wide}" height="${Number(high) + strip}" viewBox="0 0 ${wide} ${Number(high) + strip}" font-family="system-ui, DejaVu Sans, sans-serif">`,
    `<defs>${clip}${[...looks].map(gradient).join("")}</defs>`,
    `<rect width="${wide}" height="${Number(high) + strip}" fill="${look.back}"/>`,
    `<g${world.cut ? ' clip-path="url(#cell)"' : ""}>`, ...parts, `<g transform="translate(0 ${high})">${key}</g>`, "</svg>",
  ].join("\n");
}

const circle = (items, k, more) => `<circle cx="${short(items[k])}" cy="${short(items[k + 1])}" r="${short(items[k + 2])}"${more}/>`;

function disks({ level, tint, disks: items }, look, shade, rim) {
  const found = [];
  for (let k = 0; k < items.length; k += 4) found.push(circle(items, k, ""));
  return `<g fill="${blend(shade.colours[level], look.back, tint)}" stroke="${blend(look.rim, look.back, tint)}" stroke-width="${short(rim)}">${found.join("")}</g>`;
}

function spheres({ tint, disks: items }, look, shade, looks) {
  const found = [];
  for (let k = 0; k < items.length; k += 4) {
    const colour = blend(shade.colours[items[k + 3]], look.back, Math.round(16 * tint) / 16);
    if (!looks.has(colour)) looks.set(colour, `s${looks.size}`);
    found.push(circle(items, k, ` fill="url(#${looks.get(colour)})"`));
  }
  return `<g>${found.join("")}</g>`;
}

const gradient = ([colour, name]) =>
  `<radialGradient id="${name}" cx="0.5" cy="0.5" r="0.5" fx="0.3" fy="0.25">` +
  [[0, "#ffffff", 0.15], [0.5, "#000000", 0.12], [1, "#000000", 0.55]].map(([at, other, share]) => `<stop offset="${at}" stop-color="${blend(colour, other, share)}"/>`).join("") +
  "</radialGradient>";

function lines({ tone, width, strength, tint, lines: items }, look) {
  const found = [];
  for (let k = 0; k < items.length; k += 4) found.push(`M${short(items[k])} ${short(items[k + 1])}L${short(items[k + 2])} ${short(items[k + 3])}`);
  return `<path d="${found.join("")}" fill="none" stroke="${blend(look.tones[tone], look.back, tint)}" stroke-opacity="${short(strength)}" stroke-width="${short(width)}" stroke-linecap="round"/>`;
}

function corners({ cell }, camera) {
  const [a, b] = cell.rows;
  const at = ([m, n]) => camera.toScreen(cell.begin[0] + m * a[0] + n * b[0], cell.begin[1] + m * a[1] + n * b[1]);
  return [[0, 0], [1, 0], [1, 1], [0, 1]].map((corner) => at(corner).map(short).join(",")).join(" ");
}
