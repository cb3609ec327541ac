// Colour maps that colour-blind readers can tell apart, and the colours of the theme.

const CIVIDIS = [[0, 34, 78], [53, 69, 108], [102, 105, 112], [148, 142, 119], [200, 184, 102], [254, 232, 56]];
const TURNED = [[45, 0, 75], [128, 115, 172], [230, 230, 235], [224, 130, 20], [127, 59, 8]];

const mix = (stops, share) => {
  const x = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(x), stops.length - 2);
  return `rgb(${stops[k].map((low, c) => Math.round(low + (x - k) * (stops[k + 1][c] - low))).join(",")})`;
};

export const LEVELS = 48;
export const rising = Array.from({ length: LEVELS }, (_, k) => mix(CIVIDIS, k / (LEVELS - 1)));
export const signed = Array.from({ length: LEVELS }, (_, k) => mix(TURNED, k / (LEVELS - 1)));
export const CYCLE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"];

export function theme() {
  const style = getComputedStyle(document.documentElement);
  const names = ["back", "ink", "soft", "line", "panel", "grain", "rim", "force", "weak", "gain", "loss", "mark"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}
