// The contact criterion: its threshold in words, and z along the slider as a small curve.

const KINDS = { force: ["f_n/⟨f_n⟩ >", "force above this share of the mean normal force"], gap: ["gap/⟨d⟩ <", "gap below this share of the mean diameter"] };

export function criterionText(name) {
  const [kind, number] = name.split(":");
  if (!number) return { force: "f_n > 0", listed: "all that are listed", gap: "touching" }[kind] || name;
  return KINDS[kind] ? `${KINDS[kind][0]} ${short(Number(number))}` : name;
}

// A number of three digits, small ones with their power of ten.
function short(value) {
  if (value === 0 || value >= 0.001) return String(Number(value.toPrecision(3)));
  const [digits, power] = value.toExponential(1).split("e-");
  return `${digits}·10⁻${[...power].map((letter) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[letter]).join("")}`;
}

export const meaning = (kind) => (KINDS[kind] ? KINDS[kind][1] : "");

// The criterion and the definition that the view stands for; null curves while they are unknown.
export function choice(view, curves) {
  const curve = curves && curves[view.kind];
  let criterion = view.kind === "listed" ? "listed" : "";
  if (curve) criterion = `${view.kind}:${curve.threshold[Math.min(view.level, curve.threshold.length - 1)]}`;
  return { criterion, z_definition: view.definition };
}

export const slides = (view) => view.kind === "force" || view.kind === "gap";

// z against the threshold as a curve of the slider's width, with a dot at the one in use.
export function drawCurve(place, curve, level) {
  place.toggleAttribute("hidden", !curve);
  if (!curve) return;
  const known = curve.z.filter((z) => z !== null);
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const x = (k) => 6 + (108 * k) / (curve.z.length - 1);
  const y = (z) => 22 - (18 * (z - low)) / (high - low || 1);
  const points = curve.z.flatMap((z, k) => (z === null ? [] : [`${x(k).toFixed(1)},${y(z).toFixed(1)}`]));
  const at = Math.min(level, curve.z.length - 1);
  place.querySelector("polyline").setAttribute("points", points.join(" "));
  const dot = place.querySelector("circle");
  dot.toggleAttribute("hidden", curve.z[at] === null);
  dot.setAttribute("cx", x(at));
  dot.setAttribute("cy", curve.z[at] === null ? -9 : y(curve.z[at]));
  place.querySelector("title").textContent = `z against the threshold: ${low.toFixed(2)} … ${high.toFixed(2)}`;
}
