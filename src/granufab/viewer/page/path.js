// The path of the runs in (z, a') or (z, a'z), the accessible domain, and where the states lie.

import { runColour, tint } from "./charts.js";
import { theme } from "./colours.js";

export const shortName = (name) => name.split("/").slice(-3).join("/").replace(/\/run\.h5$/, "");
const times = (a, z) => a.map((value, k) => (value === null || z[k] === null ? null : value * z[k]));

export function pathFigure(context) {
  const { series, domain, fitted, state, view } = context;
  const drawable = series.some((run) => run.columns.a_signed);
  if (!drawable && !domain && (!state || state.point.a === null)) return null;
  const scaled = view.plane === "az";
  const found = marks(context);
  const sides = usedSides(domain, found, series);
  const data = [...areas(sides, scaled), ...runTraces(series, scaled, view.definition), ...stars(sides, scaled), unseen([...found, ...corners(domain)], series, view.definition, scaled)];
  return {
    head: "Path and domain", title: `Path and domain (z [-], ${scaled ? "a′z" : "a′"} [-])`, keys: keys(series, domain, fitted, view.definition), data,
    layout: {
      xaxis: { title: { text: "coordination number z [-]" }, nticks: 7 },
      yaxis: { title: { text: scaled ? "a′z [-]" : "anisotropy a′ [-]" }, nticks: 6 },
      shapes: bands(fitted),
    },
  };
}

// The sides of the domain; that of a' < 0 only where states lie well within it.
function usedSides(domain, found, series) {
  if (!domain) return [];
  const reached = [...series.flatMap((run) => run.columns.a_signed || []), ...found.map((one) => one.a)];
  const both = reached.some((a) => a !== null && a < -0.25 * Math.abs(domain.a_star));
  return domain.sides.filter((side) => side.sign > 0 || both);
}

const corners = (domain) => (domain ? [{ z: domain.z_min, y: 0 }, { z: domain.z_max, y: 0 }] : []);

// The states, which rings over the chart show, and the ends of domain and runs: unseen, so that the axes reach beyond them.
function unseen(found, series, definition, scaled) {
  const points = found.map((one) => [one.z, one.y]);
  for (const { columns } of series) {
    const [z, a] = [columns[definition], columns.a_signed];
    const known = z && a ? z.map((value, k) => [value, a[k] === null || !scaled ? a[k] : a[k] * value]).filter(([x, y]) => x !== null && y !== null) : [];
    for (const axis of known.length ? [0, 1] : []) {
      points.push(known.reduce((best, one) => (one[axis] < best[axis] ? one : best)), known.reduce((best, one) => (one[axis] > best[axis] ? one : best)));
    }
  }
  return { mode: "markers", x: points.map(([x]) => x), y: points.map(([, y]) => y), marker: { opacity: 0, size: 14 }, hoverinfo: "skip", showlegend: false };
}

function keys(series, domain, fitted, definition) {
  const colours = theme();
  const drawn = series.map((run, k) => ({ name: shortName(run.name), colour: runColour(k), kind: "line", shown: (run.columns.a_signed || []).some((a) => a !== null) && run.columns[definition] }));
  return [
    { name: "this state", colour: colours.mark, kind: "ring" }, ...drawn.filter((one) => one.shown),
    ...(domain ? [{ name: "accessible", colour: colours.soft, kind: "dash" }, { name: "critical", colour: "#f7d84a", kind: "star" }] : []),
    ...(fitted && fitted.intervals ? [{ name: "95 % interval", colour: tint("band"), kind: "band" }] : []),
  ];
}

const areas = (sides, scaled) => sides.map((side) => ({
  mode: "lines", x: side.z, y: scaled ? times(side.a_max, side.z) : side.a_max, fill: "tozeroy", fillcolor: tint("area"), hoverinfo: "skip",
  line: { color: theme().soft, width: 1.2, dash: "dash" }, name: "accessible", showlegend: side.sign > 0,
}));

const stars = (sides, scaled) => sides.map((side) => ({
  mode: "markers", x: [side.z_star], y: [scaled ? side.a_star * side.z_star : side.a_star], showlegend: side.sign > 0,
  marker: { symbol: "star", size: 12, color: "#f7d84a", line: { color: theme().ink, width: 1 } }, name: "critical state",
  hovertemplate: "z* = %{x:.3f}, %{y:.3f}<extra>critical state</extra>",
}));

function runTraces(series, scaled, definition) {
  return series.flatMap((run, k) => {
    const [z, a] = [run.columns[definition], run.columns.a_signed];
    if (!z || !a) return [];
    return [{
      mode: z.length > 1 ? "lines" : "markers", x: z.map((value, at) => (a[at] === null ? null : value)), y: scaled ? times(a, z) : a,
      line: { color: runColour(k), width: 1.5 }, marker: { color: runColour(k), size: 6 },
      name: shortName(run.name), hovertemplate: "z = %{x:.3f}, %{y:.3f}<extra>%{fullData.name}</extra>",
    }];
  });
}

// The intervals of the fitted limits.
function bands(fitted) {
  return Object.values((fitted && fitted.intervals) || {}).filter(([low, high]) => low !== null && high !== null).map(([low, high]) => ({
    type: "rect", layer: "below", xref: "x", yref: "paper", x0: low, x1: high, y0: 0, y1: 1, fillcolor: tint("band"), line: { width: 0 },
  }));
}

// The states to mark: this one, and of every other run the record nearest in strain.
export function marks({ series, state, eps, view }) {
  const found = [];
  series.forEach((run, k) => {
    if (k === view.run) return;
    const [z, a] = [run.columns[view.definition], run.columns.a_signed];
    const at = nearest(run.columns.eps_q, eps);
    if (z && a && at >= 0 && z[at] !== null && a[at] !== null) found.push({ z: z[at], a: a[at], colour: runColour(k), own: false, name: shortName(run.name) });
  });
  const { z, a } = state.point;
  if (z !== null && a !== null) found.push({ z, a, colour: theme().mark, own: true, name: "this state" });
  return found.map((one) => ({ ...one, y: view.plane === "az" ? one.a * one.z : one.a }));
}

export function markTraces(found) {
  return found.map((one) => ({
    mode: "markers", x: [one.z], y: [one.y], name: one.own ? one.name : `${one.name}, same ε<sub>q</sub>`,
    marker: { size: one.own ? 13 : 10, symbol: "circle-open", color: one.colour, line: { width: 3 } },
  }));
}

// The place of the value nearest to another, the last where there is nothing to compare.
export function nearest(values, value) {
  if (!values || !values.length) return -1;
  if (value === null || value === undefined) return values.length - 1;
  let best = -1;
  values.forEach((one, k) => { if (one !== null && (best < 0 || Math.abs(one - value) < Math.abs(values[best] - value))) best = k; });
  return best < 0 ? values.length - 1 : best;
}
