// Charts by plotly: the theme, one way to draw a figure into its place, and pictures of it.
// A figure is {title, keys, data, layout}; the page writes title and keys, pictures carry both inside.

import { CYCLE, theme } from "./colours.js";

const { Plotly } = window;
const CONFIG = { displayModeBar: false, responsive: false, doubleClick: "reset" };
const FONT = 'system-ui, "DejaVu Sans", Arial, sans-serif';
const PRINT = { width: 900, height: 675 };
const watched = new WeakSet();

// A colour of the style sheet that charts alone use.
export const tint = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
// The colours of the runs; lighter ones on dark.
const ON_DARK = ["#56B4E9", "#E69F00", "#2CC295", "#CC79A7", "#F0E442", "#FF8C69"];
export function runColour(k) {
  const cycle = document.documentElement.classList.contains("dark") ? ON_DARK : CYCLE;
  return cycle[k % cycle.length];
}
export const letters = () => Math.max(parseFloat(getComputedStyle(document.documentElement).fontSize) - 1, 12);

function dressed(more, size) {
  const colours = theme();
  const axis = {
    gridcolor: colours.line, zerolinecolor: colours.line, linecolor: colours.soft, tickcolor: colours.soft, ticks: "outside", ticklen: 3, showline: true,
    automargin: true, tickfont: { size: size - 1 },
  };
  const found = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: colours.ink, size, family: FONT },
    margin: { l: 46, r: 12, t: 8, b: 38 }, showlegend: false, hovermode: "closest", uirevision: "kept", dragmode: "zoom",
    hoverlabel: { font: { size } }, ...more,
  };
  for (const name of Object.keys(found)) {
    if (!/^[xy]axis/.test(name)) continue;
    const { title, ...rest } = found[name];
    found[name] = { ...axis, ...(title ? { title: { standoff: 4, font: { size }, ...title } } : {}), ...rest };
  }
  return found;
}

// Draws a figure, and fits it again whenever its place changes size.
export async function put(place, figure, after = () => {}) {
  await Plotly.react(place, figure.data, dressed(figure.layout, letters()), CONFIG);
  if (!watched.has(place)) {
    watched.add(place);
    place.on("plotly_afterplot", () => after());
    new ResizeObserver(() => { if (place.clientHeight > 20 && place.clientWidth > 20) Plotly.Plots.resize(place); }).observe(place);
  }
  after();
}

// The plane of a drawn chart in pixels of its place; null before the first drawing.
export function plane(place) {
  const { xaxis, yaxis } = place._fullLayout || {}; // plotly names no other way to its scales
  if (!xaxis || !xaxis._length) return null;
  return {
    x: (value) => xaxis._offset + xaxis.l2p(value), y: (value) => yaxis._offset + yaxis.l2p(value),
    fromX: (pixel) => xaxis.p2l(pixel - xaxis._offset), left: xaxis._offset, right: xaxis._offset + xaxis._length,
    range: [...xaxis.range], height: place._fullLayout.height, margin: place._fullLayout._size,
  };
}

// What a short click hits, in pixels of the chart; a drag is plotly's zoom.
export function clicked(place, done) {
  place.addEventListener("pointerdown", (down) => {
    if (down.target.closest("[role=slider]")) return;
    addEventListener("pointerup", (up) => {
      if (Math.hypot(up.clientX - down.clientX, up.clientY - down.clientY) > 4) return;
      const box = place.getBoundingClientRect();
      done(up.clientX - box.left, up.clientY - box.top);
    }, { once: true });
  }, { capture: true });
}

// A picture of a figure on the theme's background, of a size for print.
export async function picture(figure, type) {
  const size = 14;
  const layout = dressed(figure.layout, size);
  const { t: top } = layout.margin;
  Object.assign(layout, {
    paper_bgcolor: theme().back, width: PRINT.width, height: PRINT.height, margin: { ...layout.margin, t: top + 58 }, showlegend: figure.keys.length > 0,
    legend: { orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom" },
    title: { text: figure.title, font: { size: size + 2 }, x: 0.02, xanchor: "left", y: 0.985, yanchor: "top" },
  });
  const image = await Plotly.toImage({ data: figure.data, layout }, { format: type, ...PRINT, scale: type === "png" ? 2 : 1 });
  const text = image.slice(image.indexOf(",") + 1);
  if (type === "svg") return new Blob([decodeURIComponent(text)], { type: "image/svg+xml" });
  return new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], { type: "image/png" });
}
