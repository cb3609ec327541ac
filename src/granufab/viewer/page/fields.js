// The fields of the page, each bound to its choice in the view.

import { view } from "./view.js";

export const $ = (id) => document.getElementById(id);

// A field changes its choice, then `then` is called.
export function bind(id, name, then, event = "change") {
  const field = $(id);
  if (!field) return;
  fill(field, name);
  field.addEventListener(event, () => {
    view[name] = typeof view[name] === "number" ? Number(field.value) : field.value;
    then();
  });
}

// A select takes only what it offers; what the address asks for otherwise falls back to it.
function fill(field, name) {
  const offered = field.tagName !== "SELECT" || [...field.options].some((one) => one.value === String(view[name]));
  if (offered) field.value = view[name];
  else if (field.options.length) view[name] = typeof view[name] === "number" ? Number(field.value) : field.value;
}

export function fillRuns(listed) {
  $("run").replaceChildren(...listed.map(({ run, name }) => new Option(name.split("/").slice(-3).join("/"), run)));
  view.run = Math.min(Math.max(view.run, 0), listed.length - 1);
  $("run").value = view.run;
  $("run").title = listed.map(({ name }) => name).join("\n");
}

// In a saved file only some criteria and definitions are held: the others cannot be chosen.
export function offer(choices) {
  if (!choices) return;
  for (const option of $("kind").options) option.disabled = !(option.value in choices);
  const definitions = choices[view.kind] || [];
  for (const option of $("definition").options) option.disabled = !definitions.includes(option.value);
  if (definitions.length && !definitions.includes(view.definition)) {
    [view.definition] = definitions;
    $("definition").value = view.definition;
  }
}

// What a saved file says about itself.
export const savedWords = (saved) => (saved ? (typeof saved === "string" ? [saved] : Object.values(saved).flat()).filter(Boolean).join(" · ") : "");
