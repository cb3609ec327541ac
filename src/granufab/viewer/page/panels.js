// The charts, drawn by plotly: rose, Mohr circle, path with the domain, series.

import { CYCLE, theme } from "./colours.js";

const { Plotly } = window;
const CONFIG = {
  displaylogo: false, responsive: true,
  modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"],
  toImageButtonOptions: { format: "svg" },
};

function layout(more) {
  const colours = theme();
  const axis = { gridcolor: colours.line, zerolinecolor: colours.line, linecolor: colours.soft, ticks: "inside", automargin: true };
  const base = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: colours.ink, size: 12 },
    margin: { l: 48, r: 14, t: 26, b: 36 }, showlegend: false, hovermode: "closest", uirevision: "kept",
  };
  const found = { ...base, ...more };
  for (const name of Object.keys(found)) if (/^[xy]axis/.test(name)) found[name] = { ...axis, ...found[name] };
  return found;
}

const title = (text) => ({ text, font: { size: 13 }, x: 0.02, xanchor: "left", y: 0.98, yanchor: "top" });
const watched = new WeakSet();

// Draws a chart, and fits it again whenever its place changes size.
function put(where, traces, more) {
  const drawn = Plotly.react(where, traces, layout(more), CONFIG);
  if (!watched.has(where)) {
    watched.add(where);
    new ResizeObserver(() => { if (where.clientHeight) Plotly.Plots.resize(where); }).observe(where);
  }
  return drawn;
}

// Points that some angles repeat over the whole turn, [degree] and values in order.
function around(rose, theta, values) {
  const turns = rose.axis ? [(t) => t, (t) => Math.PI - t, (t) => Math.PI + t, (t) => 2 * Math.PI - t] : [(t) => t, (t) => t + Math.PI];
  const points = turns.flatMap((turn) => theta.map((t, k) => [(180 / Math.PI) * turn(t), values[k]]));
  points.sort((one, two) => one[0] - two[0]);
  return [[...points.map(([t]) => t), points[0][0] + 360], [...points.map(([, v]) => v), points[0][1]]];
}

export function drawRose(where, state) {
  const colours = theme();
  const rose = state.rose;
  if (!rose) return put(where, [], { title: title("E(θ): no contacts") });
  const [dots, values] = around(rose, rose.theta, rose.E);
  const [, errors] = around(rose, rose.theta, rose.E_error);
  const curve = (name) => around(rose, rose.curve.theta, rose.curve[name]);
  const [angle, fit] = curve("E");
  const [, low] = curve("low");
  const [, high] = curve("high");
  const bars = dots.flatMap((t) => [t, t, null]);
  const ends = values.flatMap((v, k) => [Math.max(v - errors[k], 0), v + errors[k], null]);
  const line = (r, more) => ({ type: "scatterpolar", mode: "lines", theta: angle, r, hoverinfo: "skip", ...more });
  const colour = CYCLE[0];
  const traces = [
    line(low, { line: { width: 0 } }),
    line(high, { line: { width: 0 }, fill: "tonext", fillcolor: "rgba(0,114,178,0.28)" }),
    line(fit, { line: { color: colour, width: 2 } }),
    { type: "scatterpolar", mode: "lines", theta: bars, r: ends, line: { color: colours.soft, width: 1 }, hoverinfo: "skip" },
    { type: "scatterpolar", mode: "markers", theta: dots, r: values, marker: { size: 4, color: colours.back, line: { color: colour, width: 1.2 } }, hovertemplate: "θ = %{theta:.0f}°<br>E = %{r:.3f}<extra></extra>" },
  ];
  const unit = rose.unit.replace("1/", "") + "<sup>−1</sup>";
  return put(where, traces, {
    title: title(`E(θ) [${unit}] · a = ${rose.a.toFixed(3)} ± ${rose.a_error.toFixed(3)}`),
    margin: { l: 30, r: 30, t: 50, b: 24 },
    polar: {
      bgcolor: "rgba(0,0,0,0)",
      radialaxis: { gridcolor: colours.line, angle: 22, tickangle: 0, rangemode: "tozero", nticks: 4, tickfont: { size: 10 } },
      angularaxis: { gridcolor: colours.line, rotation: rose.axis ? 90 : 0, direction: rose.axis ? "clockwise" : "counterclockwise" },
    },
  });
}

export function drawMohr(where, state, domain) {
  const colours = theme();
  const traces = [];
  const circle = ([centre, radius], more) => {
    const turn = Array.from({ length: 121 }, (_, k) => (2 * Math.PI * k) / 120);
    traces.push({ mode: "lines", x: turn.map((t) => centre + radius * Math.cos(t)), y: turn.map((t) => radius * Math.sin(t)), ...more });
  };
  if (domain) {
    const { limits, critical } = domain.mohr;
    circle(critical, { line: { color: colours.soft, width: 1, dash: "dash" }, name: "critical", hoverinfo: "name" });
    traces.push({ mode: "markers+text", x: limits, y: [0, 0], text: ["L₁", "L₂"], textposition: "bottom center", marker: { color: colours.ink, size: 7 }, hovertemplate: "G = %{x:.4f}<extra></extra>" });
  }
  (state.mohr ? state.mohr.circles : []).forEach((one, k) =>
    circle(one, { line: { color: CYCLE[0], width: k ? 1 : 2.5 }, hovertemplate: `centre ${one[0].toFixed(4)}, radius ${one[1].toFixed(4)}<extra></extra>` }));
  return put(where, traces, {
    title: title("Mohr circle of G"), xaxis: { title: { text: "G<sub>n</sub> [-]" } },
    yaxis: { title: { text: "G<sub>t</sub> [-]" }, scaleanchor: "x" },
  });
}

export function drawPath(where, runs, points, domain, view) {
  const colours = theme();
  const scaled = view.plane === "az";
  const traces = [];
  const values = [...runs.flatMap((run) => run.columns.a_signed || []), ...points.map((point) => point && point.a)];
  const sideways = values.some((a) => a !== null && a < -0.02);
  for (const side of domain ? domain.sides : []) {
    if (side.sign < 0 && !sideways) continue;
    const factor = (values) => values.map((a, k) => (a === null ? null : scaled ? a * side.z[k] : a));
    traces.push({ mode: "lines", x: side.z, y: factor(side.a_max), fill: "tozeroy", fillcolor: "rgba(128,128,128,0.16)", line: { color: colours.soft, width: 1.2, dash: "dash" }, hoverinfo: "skip" });
    traces.push({ mode: "markers", x: [side.z_star], y: [scaled ? side.a_star * side.z_star : side.a_star], marker: { symbol: "star", size: 11, color: "#f7d84a", line: { color: colours.ink, width: 1 } }, name: "critical", hovertemplate: "z* = %{x:.3f}, %{y:.3f}<extra></extra>" });
  }
  runs.forEach((run, k) => {
    const z = run.columns[view.definition];
    const a = run.columns.a_signed;
    if (!z || !a) return;
    traces.push({ mode: "lines", x: z, y: scaled ? a.map((value, i) => (value === null ? null : value * z[i])) : a, line: { color: CYCLE[k % CYCLE.length], width: 1.4 }, name: run.name, hovertemplate: "z = %{x:.3f}, %{y:.3f}<extra>%{fullData.name}</extra>" });
  });
  const here = points.filter((point) => point && point.z !== null);
  traces.push({ mode: "markers", x: here.map((p) => p.z), y: here.map((p) => (scaled ? p.az : p.a)), marker: { size: 12, symbol: "circle-open", color: colours.mark, line: { width: 3 } }, name: "this state", hovertemplate: "z = %{x:.4f}, %{y:.4f}<extra>this state</extra>" });
  return put(where, traces, {
    title: title(scaled ? "Path and accessible domain in (z, a'z)" : "Path and accessible domain in (z, a')"),
    xaxis: { title: { text: "z [-]" } }, yaxis: { title: { text: scaled ? "a' z [-]" : "a' [-]" } },
  });
}

export function drawSeries(where, series, eps, definition) {
  const colours = theme();
  const columns = [[definition, "z [-]"], ["a_signed", "a' [-]"], ["q_over_p", "q/p [-]"], ["phi", "φ [-]"]];
  const strain = series.columns.eps_q;
  const x = strain && strain.some((e) => e !== null) ? strain : (strain || []).map((_, k) => k);
  const traces = columns.map(([name], k) => ({
    mode: "lines", x, y: series.columns[name] || [], yaxis: `y${k || ""}`.replace("y0", "y").replace(/^y([1-9])$/, (_, n) => `y${Number(n) + 1}`),
    line: { color: CYCLE[k], width: 1.4 }, hovertemplate: "%{x:.4f}: %{y:.4f}<extra></extra>",
  }));
  const more = { title: title(`Series against ${x === strain ? "ε<sub>q</sub>" : "the frame"}`), xaxis: { title: { text: x === strain ? "ε<sub>q</sub> [-]" : "frame" }, anchor: "y4" } };
  columns.forEach(([, text], k) => {
    const top = 1 - k / 4;
    more[`yaxis${k ? k + 1 : ""}`] = { domain: [top - 0.22, top], title: { text, font: { size: 11 } }, nticks: 3, tickfont: { size: 10 } };
  });
  more.shapes = eps === null ? [] : [{ type: "line", xref: "x", yref: "paper", x0: eps, x1: eps, y0: 0, y1: 1, line: { color: colours.mark, width: 1.5 } }];
  return put(where, traces, more);
}
