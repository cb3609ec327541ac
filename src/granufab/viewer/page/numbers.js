// The numbers of the state, exact in data-value, and the words on frame and strain.

export function showNumbers(place, state) {
  const { values } = state;
  const signed = values.a_signed !== null && values.a_signed !== undefined;
  const named = [
    ["z", state.z_definition], signed ? ["a′", "a_signed"] : ["a", "a"], ["rattlers", "rattler_fraction"],
    ["q/p", "q_over_p"], ["φ", "phi"], ["contacts", "contact_count"],
  ];
  place.replaceChildren(...named.map(([text, name]) => {
    const span = document.createElement("span");
    const value = values[name] ?? null;
    span.dataset.name = name;
    span.dataset.value = value;
    const [unit, long] = (state.units && state.units[name]) || ["-", name];
    span.title = `${long} [${unit}]`;
    span.textContent = `${text} = ${written(value, name)}`;
    return span;
  }));
}

function written(value, name) {
  if (value === null) return "?";
  return Number.isInteger(value) && name.endsWith("count") ? String(value) : value.toFixed(4).replace("-", "−");
}

export function frameWords(overview, place) {
  const { frames, frame_count: count } = overview;
  const [eps, total] = [frames.eps_q[place], frames.eps_q_total[place]];
  const strain = eps === null ? "" : ` · ε_q = ${eps.toFixed(4)}${total !== null && Math.abs(total - eps) > 1e-9 ? ` (in all ${total.toFixed(4)})` : ""}`;
  return `frame ${frames.number[place]} (${place + 1} of ${count})${strain}`;
}
