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

// Red, green, blue from 0 to 1 of "#rgb", "#rrggbb" or "rgb(r,g,b)".
export function rgb(text) {
  if (text.startsWith("#")) {
    const wide = text.length < 7 ? text.replace(/[^#]/g, "$&$&") : text;
    return [1, 3, 5].map((k) => parseInt(wide.slice(k, k + 2), 16) / 255);
  }
  return text.match(/[\d.]+/g).slice(0, 3).map((part) => Number(part) / 255);
}

// Between two colours, as text again.
export function blend(one, other, share) {
  const [from, to] = [rgb(one), rgb(other)];
  return `rgb(${from.map((value, k) => Math.round(255 * (value + share * (to[k] - value)))).join(",")})`;
}
