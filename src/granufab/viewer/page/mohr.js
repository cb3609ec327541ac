// The Mohr circle of G between the two isotropic limit states of the domain.

import { runColour } from "./charts.js";
import { theme } from "./colours.js";

const turn = Array.from({ length: 121 }, (_, k) => (2 * Math.PI * k) / 120);
const circle = ([centre, radius], more) => ({
  mode: "lines", x: turn.map((t) => centre + radius * Math.cos(t)), y: turn.map((t) => radius * Math.sin(t)), ...more,
});

// From the least to the largest of all points, with some room.
function reach(data, axis) {
  const values = data.flatMap((trace) => [...trace[axis]]);
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const room = 0.07 * (high - low || 0.1);
  return [low - room, high + room];
}

export function mohrFigure({ state, domain }) {
  if (!state.mohr && !domain) return null;
  const colours = theme();
  const data = [];
  if (domain) {
    const { limits, critical } = domain.mohr;
    data.push(circle(critical, { line: { color: colours.soft, width: 1.2, dash: "dash" }, name: "critical state", hoverinfo: "name" }));
    data.push({
      mode: "markers+text", x: limits, y: [0, 0], text: ["z<sub>min</sub>", "z<sub>max</sub>"], textposition: ["top right", "top left"], cliponaxis: false,
      marker: { color: colours.ink, size: 7 }, name: "isotropic limits", hovertemplate: "G = %{x:.4f}<extra>isotropic limit</extra>",
    });
  }
  (state.mohr ? state.mohr.circles : []).forEach((one, k) => data.push(circle(one, {
    line: { color: runColour(0), width: k ? 1 : 2.5 }, name: "this state", showlegend: !k,
    hovertemplate: `centre ${one[0].toFixed(4)}, radius ${one[1].toFixed(4)}<extra></extra>`,
  })));
  return {
    title: "Mohr circle of the fabric G [-]", keys: keys(domain, state), data,
    layout: {
      xaxis: { title: { text: "normal part G<sub>n</sub> [-]" }, nticks: 6, range: reach(data, "x") },
      yaxis: { title: { text: "tangential part G<sub>t</sub> [-]" }, nticks: 6, range: reach(data, "y"), scaleanchor: "x" },
    },
  };
}

function keys(domain, state) {
  const colours = theme();
  return [
    ...(state.mohr ? [{ name: "this state", colour: runColour(0), kind: "line" }] : []),
    ...(domain ? [{ name: "critical state", colour: colours.soft, kind: "dash" }, { name: "isotropic limits", colour: colours.ink, kind: "point" }] : []),
  ];
}
