// z, a', q/p and φ of the runs against ε_q, one below the other.

import { runColour } from "./charts.js";
import { theme } from "./colours.js";
import { shortName } from "./path.js";

const dash = (own) => (own ? "solid" : "dot");

// The columns that at least one run has.
function shown(series, definition) {
  const all = [[definition, "z"], ["a_signed", "a′"], ["q_over_p", "q/p"], ["phi", "φ"]];
  return all.filter(([name]) => series.some((run) => (run.columns[name] || []).some((value) => value !== null)));
}

export const strained = (run) => (run.columns.eps_q || []).some((value) => value !== null);

export function seriesFigure({ series, overview, view }) {
  const columns = shown(series, view.definition);
  if (!columns.length) return null;
  const strain = strained(series[view.run] || series[0]);
  const data = series.flatMap((run, k) => columns.map(([name], row) => ({
    mode: (run.columns[name] || []).length > 1 ? "lines" : "markers",
    x: strain ? run.columns.eps_q || [] : (run.columns[name] || []).map((_, at) => at), y: run.columns[name] || [], yaxis: row ? `y${row + 1}` : "y",
    line: { color: runColour(k), width: k === view.run ? 1.8 : 1.1, dash: dash(k === view.run) }, name: shortName(run.name), showlegend: row === 0,
    hovertemplate: `${strain ? "ε<sub>q</sub>" : "record"} = %{x:.4f}, ${columns[row][1]} = %{y:.4f}<extra>%{fullData.name}</extra>`,
  })));
  const against = strain ? "ε<sub>q</sub>" : "the record";
  return {
    title: `${columns.map(([, symbol]) => symbol).join(", ")} [-] against ${against}${strain ? " [-]" : ""}`,
    keys: series.length < 2 ? [] : series.map((run, k) => ({ name: shortName(run.name), colour: runColour(k), kind: k === view.run ? "line" : "dot" })), data,
    layout: { ...rows(columns), xaxis: { ...across(strain, data, overview.frames.eps_q), anchor: `y${columns.length > 1 ? columns.length : ""}` } },
  };
}

// The axis of all rows, from the first record or frame to the last.
function across(strain, data, frames) {
  if (strain) {
    const known = [...frames, ...data.flatMap((one) => one.x)].filter((value) => value !== null);
    const [low, high] = known.reduce(([least, most], one) => [Math.min(least, one), Math.max(most, one)], [Infinity, -Infinity]);
    const room = 0.01 * (high - low || 0.01);
    return { title: { text: "deviatoric strain ε<sub>q</sub> [-]" }, range: [low - room, high + room] };
  }
  return { title: { text: "record" }, tickformat: "d", dtick: data.every((one) => one.x.length < 9) ? 1 : undefined };
}

function rows(columns) {
  const found = {};
  columns.forEach(([, symbol], k) => {
    const top = 1 - k / columns.length;
    found[`yaxis${k ? k + 1 : ""}`] = { domain: [top - 1 / columns.length + 0.035, top], title: { text: `${symbol} [-]` }, nticks: 3 };
  });
  return found;
}

// The line at the current frame, for pictures; the page draws it over the chart.
export function cursorShape(eps) {
  if (eps === null || eps === undefined) return [];
  return [{ type: "line", xref: "x", yref: "paper", x0: eps, x1: eps, y0: 0, y1: 1, line: { color: theme().mark, width: 1.5 } }];
}
