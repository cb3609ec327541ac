// What is looked at: the choices that the address of the page keeps, so that a link restores them.

export const view = {
  run: 0, frame: -1, definition: "z_backbone", kind: "", level: 16, colour: "contact_number", lines: "force",
  images: "border", plane: "a", tab: "rose", large: "packing", theme: "", low: "", high: "", renderer: "",
};

export function restore() {
  for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
    if (!(name in view)) continue;
    if (typeof view[name] !== "number") view[name] = text;
    else if (/^-?\d+$/.test(text)) view[name] = Number(text);
  }
}

export function remember() {
  const kept = Object.entries(view).filter(([, value]) => value !== "");
  try {
    history.replaceState(null, "", `#${new URLSearchParams(kept)}`);
  } catch { /* inside a notebook the page has no address of its own */ }
}

export const isDark = () => (view.theme ? view.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches);
