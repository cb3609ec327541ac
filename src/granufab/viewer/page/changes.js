// Contacts gained, lost and turned by direction since the frame before.

import { theme } from "./colours.js";

const DEGREE = 180 / Math.PI;
const signed = (value) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(3)}`;

// Each bin as two points, so that a line through them is the steps.
function steps(edges, values) {
  return [edges.slice(0, -1).flatMap((low, k) => [DEGREE * low, DEGREE * edges[k + 1]]), values.flatMap((value) => [value, value])];
}

export function changesFigure({ interval }) {
  if (!interval || interval.missing) return null;
  const colours = theme();
  const edges = interval.theta_edge;
  const step = (values, name, colour) => {
    const [x, y] = steps(edges, values);
    return { mode: "lines", x, y, name, line: { color: colour, width: 2 }, hovertemplate: `θ = %{x:.0f}°, %{y}<extra>${name}</extra>` };
  };
  const data = [
    step(interval.gain, "gained", colours.gain), step(interval.loss, "lost", colours.loss),
    {
      mode: "lines+markers", x: edges.map((edge) => DEGREE * edge), y: interval.current, name: "current to larger θ",
      line: { color: colours.soft, width: 1.2, dash: "dot" },
      marker: { size: 5, color: colours.soft }, hovertemplate: "θ = %{x:.0f}°, %{y}<extra>current</extra>",
    },
  ];
  return {
    title: "Contacts gained, lost per bin [count] by θ [°]", data,
    keys: [
      { name: "gained", colour: colours.gain, kind: "line" }, { name: "lost", colour: colours.loss, kind: "line" },
      { name: "current to larger θ", colour: colours.soft, kind: "dot" },
    ],
    layout: {
      xaxis: { title: { text: "θ from the contraction axis [°]" }, range: [0, DEGREE * edges[edges.length - 1]], dtick: 30 },
      yaxis: { title: { text: "contacts per bin [count]" }, nticks: 6, zeroline: true, zerolinecolor: colours.soft },
    },
  };
}

export function changesWords({ interval }) {
  if (!interval) return "";
  if (interval.missing) return interval.missing;
  const { gained, lost, persistent, z_before, z_after, z_gain, z_loss } = interval;
  const since = interval.since_eps_q === null ? "" : ` since ε_q = ${interval.since_eps_q.toFixed(4)}`;
  const parts = `z of all grains ${z_before.toFixed(3)} → ${z_after.toFixed(3)}: gain ${signed(z_gain)}, loss ${signed(z_loss)}`;
  return `${gained} gained, ${lost} lost, ${persistent} persistent${since}; ${parts}`;
}
