// What moves over a chart without plotly: rings at the states, the line at the frame, the handles.

import { plane } from "./charts.js";

function overlayOf(place) {
  let found = place.parentElement.querySelector(".overlay");
  if (!found) {
    found = document.createElement("div");
    found.className = "overlay";
    place.parentElement.append(found);
  }
  return found;
}

function kept(over, key, make) {
  let found = over.querySelector(`[data-key="${key}"]`);
  if (!found) {
    found = make();
    found.dataset.key = key;
    over.append(found);
  }
  return found;
}

function span(name) {
  const found = document.createElement("span");
  found.className = name;
  return found;
}

// Rings at the states; those beyond the chart are not shown.
export function rings(place, marks) {
  const over = overlayOf(place);
  const drawn = plane(place);
  const old = new Set(over.querySelectorAll(".ring"));
  if (drawn) {
    marks.forEach((one, k) => {
      const ring = kept(over, `ring${k}`, () => span("ring"));
      old.delete(ring);
      const [x, y] = [drawn.x(one.z), drawn.y(one.y)];
      ring.classList.toggle("own", one.own);
      ring.style.borderColor = one.colour;
      ring.style.transform = `translate(${x}px, ${y}px) translate(-50%, -50%)`;
      ring.hidden = x < drawn.left - 1 || x > drawn.right + 1 || y < drawn.margin.t - 1 || y > drawn.height - drawn.margin.b + 1;
      ring.dataset.z = one.z;
      ring.dataset.y = one.y;
    });
  }
  for (const ring of old) ring.remove();
}

// The line at the current frame.
export function cursor(place, value) {
  const drawn = plane(place);
  const line = kept(overlayOf(place), "cursor", () => span("cursor"));
  const x = drawn && value !== null && value !== undefined ? drawn.x(value) : NaN;
  line.hidden = !(x >= drawn?.left - 1 && x <= drawn?.right + 1);
  if (line.hidden) return;
  line.style.transform = `translateX(${x}px)`;
  line.style.top = `${drawn.margin.t}px`;
  line.style.bottom = `${drawn.margin.b}px`;
  line.dataset.value = value;
}

// The handles of z_min and z_max: pointer and arrow keys. `limits()` gives {z_min: {value, least, most}, …} or null.
export class Handles {
  constructor(place, { limits, moved, done }) {
    Object.assign(this, { place, limits, moved, done, dragged: null });
    for (const name of ["z_min", "z_max"]) kept(overlayOf(place), name, () => this.made(name));
  }

  made(name) {
    const handle = span("handle");
    Object.assign(handle, { tabIndex: 0, title: `${name}: drag, or arrow keys` });
    handle.setAttribute("role", "slider");
    handle.setAttribute("aria-label", name);
    handle.dataset.limit = name;
    handle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      handle.focus();
      handle.setPointerCapture(event.pointerId);
      this.dragged = name;
    });
    handle.addEventListener("pointermove", (event) => { if (this.dragged === name) this.pulled(name, event); });
    for (const type of ["pointerup", "pointercancel"]) handle.addEventListener(type, () => { if (this.dragged) { this.dragged = null; this.done(); } });
    handle.addEventListener("keydown", (event) => this.pressed(name, event));
    return handle;
  }

  pulled(name, event) {
    const drawn = plane(this.place);
    if (!drawn) return;
    const x = event.clientX - this.place.getBoundingClientRect().left;
    this.set(name, drawn.fromX(Math.min(Math.max(x, drawn.left), drawn.right)));
  }

  pressed(name, event) {
    const found = this.limits();
    const sign = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!found || (!sign && event.key !== "Home" && event.key !== "End")) return;
    event.preventDefault();
    event.stopPropagation();
    const { value, least, most } = found[name];
    if (sign) this.set(name, value + sign * (event.shiftKey ? 0.05 : 0.005));
    else this.set(name, event.key === "Home" ? least : most);
    this.done();
  }

  set(name, value) {
    const { least, most } = this.limits()[name];
    this.moved(name, Math.min(Math.max(value, least), most));
  }

  draw() {
    const [drawn, found] = [plane(this.place), this.limits()];
    for (const name of ["z_min", "z_max"]) {
      const handle = overlayOf(this.place).querySelector(`[data-key=${name}]`);
      const x = drawn && found ? drawn.x(found[name].value) : NaN;
      handle.hidden = !(x >= drawn?.left - 8 && x <= drawn?.right + 8);
      if (handle.hidden) continue;
      const y = Math.min(Math.max(drawn.y(0), drawn.margin.t), drawn.height - drawn.margin.b);
      handle.style.transform = `translate(${x}px, ${y}px) translate(-50%, -50%)`;
      handle.setAttribute("aria-valuenow", found[name].value.toFixed(4));
      handle.setAttribute("aria-valuemin", found[name].least.toFixed(4));
      handle.setAttribute("aria-valuemax", found[name].most.toFixed(4));
    }
  }
}
