// The rose E(θ): bins with error bars, the fit and its band of one standard error.

import { letters, runColour, tint } from "./charts.js";
import { theme } from "./colours.js";

// Points that some angles repeat over the whole turn, [degree] and values in order.
function around(rose, theta, values) {
  const turns = rose.axis ? [(t) => t, (t) => Math.PI - t, (t) => Math.PI + t, (t) => 2 * Math.PI - t] : [(t) => t, (t) => t + Math.PI];
  const points = turns.flatMap((turn) => theta.map((t, k) => [(180 / Math.PI) * turn(t), values[k]]));
  points.sort((one, two) => one[0] - two[0]);
  return [[...points.map(([t]) => t), points[0][0] + 360], [...points.map(([, v]) => v), points[0][1]]];
}

export const unit = (rose) => rose.unit.replace("1/", "") + "⁻¹";

export function roseFigure({ state }) {
  const { rose } = state;
  if (!rose) return null;
  const angle = rose.axis ? "θ from the axis of the fabric" : "θ from x";
  return {
    title: `Rose E(θ) [${unit(rose)}], ${angle}`,
    keys: keys(rose),
    data: traces(rose), layout: layout(rose),
  };
}

const keys = (rose) => [
  { name: "bins ± 1 σ", colour: runColour(0), kind: "point" }, { name: `fit ± 1 σ, a = ${rose.a.toFixed(3)} ± ${rose.a_error.toFixed(3)} [-]`, colour: runColour(0), kind: "line" },
];

function traces(rose) {
  const colours = theme();
  const [dots, values] = around(rose, rose.theta, rose.E);
  const [, errors] = around(rose, rose.theta, rose.E_error);
  const curve = (name) => around(rose, rose.curve.theta, rose.curve[name]);
  const [angle, fit] = curve("E");
  const [, low] = curve("low");
  const [, high] = curve("high");
  const line = (r, more) => ({ type: "scatterpolar", mode: "lines", theta: angle, r, hoverinfo: "skip", ...more });
  return [
    line(low.map((value) => Math.max(value, 0)), { line: { width: 0 }, showlegend: false }),
    line(high, { line: { width: 0 }, fill: "tonext", name: "error of the fit", fillcolor: tint("band") }),
    line(fit, { name: `second-order fit, a = ${rose.a.toFixed(3)} ± ${rose.a_error.toFixed(3)}`, line: { color: runColour(0), width: 2 } }),
    {
      type: "scatterpolar", mode: "lines", showlegend: false, theta: dots.flatMap((t) => [t, t, null]), hoverinfo: "skip",
      r: values.flatMap((v, k) => [Math.max(v - errors[k], 0), v + errors[k], null]), line: { color: colours.soft, width: 1 },
    },
    {
      type: "scatterpolar", mode: "markers", name: "contacts, ± one standard error", theta: dots, r: values, marker: { size: 4, color: colours.panel, line: { color: runColour(0), width: 1.2 } },
      hovertemplate: `θ = %{theta:.0f}°<br>E = %{r:.3f} ${unit(rose)}<extra></extra>`,
    },
  ];
}

function layout(rose) {
  const [colours, size] = [theme(), letters()];
  return {
    margin: { l: 2.9 * size, r: 2.9 * size, t: 1.9 * size, b: 1.9 * size },
    polar: {
      bgcolor: "rgba(0,0,0,0)",
      radialaxis: {
        gridcolor: colours.line, linecolor: colours.soft, angle: 0, tickangle: 0, side: "clockwise", rangemode: "tozero", nticks: 4,
        tickfont: { size: size - 1 },
      },
      angularaxis: {
        gridcolor: colours.line, linecolor: colours.soft, rotation: rose.axis ? 90 : 0, direction: rose.axis ? "clockwise" : "counterclockwise",
        tickfont: { size: size - 1 }, dtick: 45,
      },
    },
  };
}
