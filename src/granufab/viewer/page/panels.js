// The panels: which are seen and where, when they are drawn, their words, and pictures of them.

import { changesFigure, changesWords } from "./changes.js";
import { clicked, picture, plane, put } from "./charts.js";
import { where } from "./domain.js";
import { mohrFigure } from "./mohr.js";
import { cursor, Handles, rings } from "./overlay.js";
import { markTraces, marks, nearest, pathFigure } from "./path.js";
import { roseFigure, unit } from "./rose.js";
import { cursorShape, seriesFigure, strained } from "./series.js";
import { SurfaceView } from "./surface.js";

const $ = (id) => document.getElementById(id);
const HEADS = { rose: "Rose E(θ)", mohr: "Mohr circle of the fabric G", path: "Path and domain", series: "Series", changes: "Contacts gained, lost" };
const NAMES = Object.keys(HEADS);

export class Panels {
  // `known` is everything that is shown, `act` what a panel asks for: {tab, limits, jump, settled}.
  constructor(known, view, act) {
    Object.assign(this, { known, view, act, drawn: {}, figures: {} });
    this.surface = new SurfaceView($("surface-canvas"));
    this.handles = new Handles($("path-chart"), {
      limits: () => this.limits(), moved: (name, value) => act.limits(name, value), done: () => act.settled(),
    });
    clicked($("series-chart"), (x) => this.jumpSeries(x));
    clicked($("path-chart"), (x, y) => this.jumpPath(x, y));
  }

  seen(name) {
    if (name === "rose") return this.view.tab !== "changes";
    return name !== "changes" || this.view.tab === "changes";
  }

  // Draws what is seen and has changed.
  async draw() {
    const { rose } = this.known.state;
    for (const tab of document.querySelectorAll("[role=tab][data-tab=surface]")) tab.hidden = !(rose && rose.surface);
    const work = NAMES.filter((name) => this.seen(name)).map((name) => this[name]());
    await Promise.all(work);
  }

  // Draws a figure unless `key` says that it stands already; a reason where there is none.
  async chart(name, figure, key, reason, after = () => {}) {
    const place = $(`${name}-chart`);
    if (this.drawn[name] === key) { after(); return; }
    this.drawn[name] = key;
    const made = figure(this.known);
    this.figures[name] = made;
    const section = $(name);
    section.classList.toggle("empty", !made);
    section.querySelector(".reason").textContent = made ? "" : reason;
    for (const button of section.querySelectorAll("button.save")) button.disabled = !made;
    if (!made) { titled(section, HEADS[name]); return; }
    titled(section, made.head || made.title);
    keyed(section.querySelector(".keyrow"), made.keys);
    await put(place, made, after);
  }

  async rose() {
    const { state } = this.known;
    const solid = Boolean(state.rose && state.rose.surface);
    $("rose").classList.toggle("surface", this.view.tab === "surface" && solid);
    if (this.view.tab !== "surface" || !solid) {
      await this.chart("rose", roseFigure, String(this.known.count), lacking(state));
      return;
    }
    $("rose").classList.remove("empty");
    titled($("rose"), this.surfaceTitle());
    for (const button of $("rose").querySelectorAll("button.save")) button.disabled = false;
    this.surface.show(state.rose);
  }

  surfaceTitle() { return `Surface E(n) [${unit(this.known.state.rose)}], harmonics to order 6`; }

  async mohr() {
    const { state, count, domain } = this.known;
    await this.chart("mohr", mohrFigure, JSON.stringify([count, domain && [domain.z_min, domain.z_max]]), lacking(state));
  }

  async path() {
    const { domain, version, held, missing } = this.known;
    const key = JSON.stringify([version, this.view.plane, this.view.definition, this.view.theme, domain && [domain.z_min, domain.z_max], held, this.within()]);
    const figure = (known) => {
      const made = pathFigure(known);
      if (made && held) {
        Object.assign(made.layout.xaxis, { range: held.x, autorange: false });
        Object.assign(made.layout.yaxis, { range: held.y, autorange: false });
      }
      return made;
    };
    await this.chart("path", figure, key, missing || "no series, so no path", () => { rings($("path-chart"), marks(this.known)); this.handles.draw(); });
    this.pathWords();
  }

  // What the axes must reach beyond what they show, while the user has not chosen them.
  within() {
    const { xaxis, yaxis } = $("path-chart")._fullLayout || {};
    const found = marks(this.known);
    const inside = (axis, value) => !axis.autorange || (value - axis.range[0]) * (value - axis.range[1]) <= 0;
    if (!xaxis || found.every((one) => inside(xaxis, one.z) && inside(yaxis, one.y))) return "within";
    return found.map((one) => [one.z, one.y]);
  }

  pathWords() {
    const { domain, fitted, state } = this.known;
    const own = domain !== fitted;
    const limit = (name) => {
      const interval = !own && fitted.intervals && fitted.intervals[name];
      return `${name} = ${domain[name].toFixed(3)}${interval && interval[0] !== null ? ` [${interval.map((z) => z.toFixed(3)).join(", ")}]` : ""}`;
    };
    $("limits").textContent = domain ? `${limit("z_min")}, ${limit("z_max")}${own ? ` (fitted ${fitted.z_min.toFixed(3)}, ${fitted.z_max.toFixed(3)})` : ""}` : "";
    $("limits").title = domain ? "limits of the accessible domain [interval of 95 %]" : this.known.fitMissing || "";
    $("where").textContent = domain ? where(domain, state.point) : `no domain: ${this.known.fitMissing || "nothing is fitted"}`;
    $("where").parentElement.classList.toggle("none", !domain);
    $("where").title = $("where").textContent;
    $("fitted").hidden = !own;
  }

  // What the handles may reach: not beyond each other, and one fitted width around.
  limits() {
    const { domain, fitted } = this.known;
    if (!domain) return null;
    const wide = fitted.z_max - fitted.z_min;
    return {
      z_min: { value: domain.z_min, least: Math.max(fitted.z_min - wide, 0.05), most: domain.z_max - 0.01 },
      z_max: { value: domain.z_max, least: domain.z_min + 0.01, most: fitted.z_max + wide },
    };
  }

  // The range of the path's axes, to stand still while a limit is dragged.
  ranges() {
    const { xaxis, yaxis } = $("path-chart")._fullLayout || {};
    return xaxis ? { x: [...xaxis.range], y: [...yaxis.range] } : null;
  }

  async series() {
    const { version, eps, seriesMissing } = this.known;
    const key = JSON.stringify([version, this.view.definition, this.view.run, this.view.theme]);
    await this.chart("series", seriesFigure, key, seriesMissing || "no series", () => cursor($("series-chart"), this.known.eps ?? eps));
  }

  async changes() {
    const words = changesWords(this.known);
    await this.chart("changes", changesFigure, String(this.known.count), words || "asked for …");
    $("changes-words").textContent = $("changes").classList.contains("empty") ? "" : words;
    $("changes-words").title = words;
  }

  jumpSeries(x) {
    const drawn = plane($("series-chart"));
    const own = this.known.series[this.view.run];
    if (!drawn || !own || x < drawn.left || x > drawn.right) return;
    if (strained(own)) this.act.jump(nearest(this.known.overview.frames.eps_q, drawn.fromX(x)));
  }

  jumpPath(x, y) {
    const drawn = plane($("path-chart"));
    const own = this.known.series[this.view.run];
    const [z, a] = own ? [own.columns[this.view.definition], own.columns.a_signed] : [];
    if (!drawn || !z || !a || !strained(own)) return;
    let best = [30, -1]; // pixels: a click beside the path is none
    z.forEach((value, k) => {
      if (value === null || a[k] === null) return;
      const away = Math.hypot(drawn.x(value) - x, drawn.y(this.view.plane === "az" ? a[k] * value : a[k]) - y);
      if (away < best[0]) best = [away, k];
    });
    if (best[1] >= 0) this.act.jump(nearest(this.known.overview.frames.eps_q, own.columns.eps_q[best[1]]));
  }

  // A picture of a panel, its marks included.
  async picture(name, type) {
    const { state, eps } = this.known;
    if (name === "rose" && $("rose").classList.contains("surface")) return this.surface.picture(type, this.surfaceTitle());
    const figure = this.figures[name];
    if (name === "path") return picture({ ...figure, data: [...figure.data, ...markTraces(marks(this.known))] }, type);
    if (name === "series") return picture({ ...figure, layout: { ...figure.layout, shapes: cursorShape(eps) } }, type);
    const more = name === "rose" ? ` (z = ${state.rose.z.toFixed(3)})` : "";
    return picture({ ...figure, title: figure.title + more }, type);
  }

  // Everything is drawn anew: the theme or the size of the letters has changed.
  stale() { this.drawn = {}; }
}

// Why a state has neither rose nor Mohr circle.
function lacking(state) {
  const { rattler_fraction: rattlers, contact_count: count } = state.values;
  if (count === 0) return "there are no contacts under this criterion";
  return rattlers === 1 ? "every grain is a rattler under this criterion, so no contact counts" : state.missing || "there are no contacts";
}

function titled(section, text) {
  const title = section.querySelector("h2");
  title.replaceChildren();
  title.title = text.replace(/<[^>]*>/g, "");
  text.split(/<sub>(.*?)<\/sub>/).forEach((part, k) => title.append(k % 2 ? Object.assign(document.createElement("sub"), { textContent: part }) : part));
}

// What the colours and marks of a chart stand for.
function keyed(place, keys) {
  place.replaceChildren(...keys.map(({ name, colour, kind }) => {
    const [item, sign] = [document.createElement("span"), document.createElement("i")];
    sign.className = kind;
    sign.style.color = colour;
    if (kind === "star") sign.textContent = "★";
    item.append(sign, name.replace(/<[^>]*>/g, ""));
    return item;
  }));
}
