// The legend as drawn: a colour bar with its ends or a key of colours, and what the lines mean.

export const HIGH = 44;
const [LEFT, BAR, KEY] = [8, 140, 168];
const BOX = 10;

// The inside of an SVG of height HIGH, colours of the theme written out.
export function drawnLegend(shade, lines, colours) {
  const parts = shade.scale ? bar(shade.scale, colours) : key(shade.items.map(([colour, words]) => [box(colour, colours), words]), LEFT, colours);
  return [...parts, ...key(lines.map(([tone, width, words]) => [rule(colours[tone], width), words]), shade.scale || shade.items.length ? KEY : LEFT, colours)].join("");
}

function bar({ title, colours: steps, low, high }, colours) {
  const wide = BAR / steps.length;
  const found = [text(LEFT, 11, title, colours)];
  steps.forEach((colour, k) => found.push(`<rect x="${LEFT + k * wide}" y="16" width="${wide + 0.4}" height="${BOX}" fill="${colour}" shape-rendering="crispEdges"/>`));
  found.push(`<rect x="${LEFT}" y="16" width="${BAR}" height="${BOX}" fill="none" stroke="${colours.soft}" stroke-width="0.8"/>`);
  return [...found, text(LEFT, 38, low, colours), text(LEFT + BAR, 38, high, colours, "end")];
}

const key = (items, x, colours) => items.flatMap(([draw, words], k) => [draw(x, 11 + 14 * k), text(x + 30, 11 + 14 * k, words, colours)]);
const box = (colour, colours) => (x, y) => `<rect x="${x + 6}" y="${y - 9}" width="${BOX}" height="${BOX}" rx="5" fill="${colour}" stroke="${colours.rim}"/>`;
const rule = (colour, width) => (x, y) => `<path d="M${x} ${y - 4}h22" stroke="${colour}" stroke-width="${width}" stroke-linecap="round"/>`;
const escaped = (words) => words.replace(/&/g, "&amp;").replace(/</g, "&lt;");
const text = (x, y, words, colours, anchor = "start") =>
  `<text x="${x}" y="${y}" font-size="11.5" fill="${colours.ink}" text-anchor="${anchor}">${escaped(words)}</text>`;

// What the lines mean: [colour of the theme, width in pixels, words].
export function lineKey(data, kind) {
  const { header, normal_force: force } = data;
  if (kind === "none") return [];
  if (!data.pair) return [["soft", 1, "no contacts in these data"]];
  const { changes } = header;
  return {
    force: force ? [["force", 1.5, "fₙ = ⟨fₙ⟩, mean normal force"], ["force", 6, "fₙ = 4 ⟨fₙ⟩ and more"]] : [["force", 1, "contacts; no forces in these data"]],
    strong: force ? [["force", 4, "strong, fₙ > ⟨fₙ⟩"], ["weak", 1.5, "weak, fₙ ≤ ⟨fₙ⟩"]] : [["weak", 1, "contacts; no forces in these data"]],
    changes: changes.missing ? [["soft", 1.5, `contacts; ${changes.missing}`]] : [["gain", 3, `gained: ${changes.gained}`], ["loss", 3, `lost: ${changes.lost}`], ["soft", 1.5, "kept since the frame before"]],
    normal: [["force", 1.5, "n, normals of the contacts"]],
    contact: [["force", 1.5, "contacts, from centre to centre"]],
  }[kind] || [];
}
