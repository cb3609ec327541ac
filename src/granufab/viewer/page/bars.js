// The bar of every panel: tabs, title, saving, enlarging; and what of it the address keeps.

const TABS = [
  ["rose", "E(θ)", "rose of the contact directions"], ["surface", "E(n)", "surface of the contact directions"],
  ["changes", "gain, loss", "contacts gained and lost by direction"],
];
const BUTTONS = [["svg", "save as SVG"], ["png", "save as PNG"]];

function button(words, label, more) {
  const found = document.createElement("button");
  found.textContent = words;
  found.title = label;
  found.setAttribute("aria-label", label);
  return Object.assign(found, more);
}

// Fills the bars that index.html leaves empty. `act`: {save(name, type), large(name), tab(name)}.
export function fillBars(act) {
  for (const section of document.querySelectorAll("main > section")) {
    const bar = section.querySelector(".bar, nav");
    if (section.id === "rose" || section.id === "changes") bar.prepend(tabs(act));
    const keys = document.createElement("span");
    keys.className = "keys";
    for (const [type, label] of BUTTONS) {
      if (section.querySelector(`button.save[data-type=${type}]`)) continue;
      const save = button(type.toUpperCase(), `${label}: ${section.id}`, { className: "save" });
      save.dataset.type = type;
      keys.append(save);
    }
    keys.append(button("⤢", `enlarge, Esc to return: ${section.id}`, { className: "large", onclick: () => act.large(section.id) }));
    bar.append(keys);
    for (const save of section.querySelectorAll("button.save")) save.addEventListener("click", () => act.save(section.id, save.dataset.type));
  }
}

function tabs(act) {
  const list = document.createElement("span");
  list.setAttribute("role", "tablist");
  list.className = "tabs";
  for (const [name, words, label] of TABS) {
    const tab = button(words, label, { onclick: () => act.tab(name) });
    tab.setAttribute("role", "tab");
    tab.dataset.tab = name;
    list.append(tab);
  }
  return list;
}

// Puts every panel into its place: the large one in the main place, the packing in that one's.
export function arrange(view) {
  const main = document.querySelector("main");
  const directions = ["rose", "changes"];
  const large = directions.includes(view.large) ? "rose" : view.large;
  main.dataset.large = large;
  for (const section of main.querySelectorAll(":scope > section")) {
    const cell = directions.includes(section.id) ? "rose" : section.id;
    section.style.gridArea = cell === large ? "large" : cell === "packing" ? large : cell;
    const hidden = cell === "rose" && (section.id === "changes") !== (view.tab === "changes");
    section.hidden = hidden;
    const key = section.querySelector("button.large");
    if (key) key.textContent = cell === large && large !== "packing" ? "⤡" : "⤢";
    if (key) key.hidden = cell === "packing" && large === "packing";
  }
  for (const tab of main.querySelectorAll("[role=tab]")) tab.setAttribute("aria-selected", String(tab.dataset.tab === view.tab));
}
