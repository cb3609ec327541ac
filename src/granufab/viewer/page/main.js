// The page: one choice of run, frame and criterion, which every panel follows.

import { moved } from "./domain.js";
import { PackingView } from "./packing.js";
import { drawMohr, drawPath, drawRose, drawSeries } from "./panels.js";
import { Failure, openSource } from "./source.js";

const $ = (id) => document.getElementById(id);
const source = openSource();
const view = { run: 0, frame: -1, definition: "z_backbone", kind: "", level: 16, colour: "contact_number", lines: "force", images: "border", plane: "a", theme: "", low: "", high: "" };
const known = { listed: [], overview: null, series: [], fit: null, state: null, curves: null, ticket: 0 };
const packing = new PackingView($("canvas"), (words) => { $("picked").textContent = words; });
const told = (text) => { $("message").textContent = text || ""; };

function restore() {
  for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
    if (name in view) view[name] = typeof view[name] === "number" ? Number(text) || 0 : text;
  }
}

function remember() {
  const kept = Object.entries(view).filter(([, value]) => value !== "");
  history.replaceState(null, "", `#${new URLSearchParams(kept)}`);
}

function choice() {
  const curve = known.curves && known.curves[view.kind];
  let criterion = view.kind === "listed" ? "listed" : "";
  if (curve) criterion = `${view.kind}:${curve.threshold[Math.min(view.level, curve.threshold.length - 1)]}`;
  return { criterion, z_definition: view.definition };
}

const domain = () => {
  const fitted = known.fit && known.fit.domain;
  if (!fitted || !view.low || !view.high || Number(view.low) >= Number(view.high)) return fitted;
  return moved(fitted, Number(view.low), Number(view.high));
};

async function openRun() {
  const fresh = await Promise.all([source.overview(view.run), ...known.listed.map(({ run }) => source.series(run)), source.fit(view.definition)]);
  known.overview = fresh[0];
  known.series = fresh.slice(1, -1).map((one, k) => ({ ...one, name: known.listed[k].name }));
  known.fit = fresh[fresh.length - 1];
  const last = known.overview.frame_count - 1;
  if (view.frame < 0 || view.frame > last) view.frame = last;
  $("frame").max = Math.max(last, 0);
  handles();
  await showFrame();
}

async function showFrame() {
  const ticket = ++known.ticket;
  const frames = known.overview.frames;
  $("frame").value = view.frame;
  if (view.frame < 0) { told("no frame is recorded yet"); return; }
  try {
    if (view.kind === "force" || view.kind === "gap") known.curves = await source.criterion(view.run, view.frame, choice());
    else known.curves = null;
    const chosen = choice();
    const [data, state] = await Promise.all([source.packing(view.run, view.frame, chosen), source.state(view.run, view.frame, chosen)]);
    if (ticket !== known.ticket) return; // another frame was asked for meanwhile
    known.state = state;
    packing.show(data);
    $("legend").textContent = packing.legend;
    const eps = frames.eps_q[view.frame];
    $("place").textContent = `frame ${frames.number[view.frame]} of ${frames.number.length}${eps === null ? "" : ` · ε_q = ${eps.toFixed(4)}`}`;
    numbers(state);
    charts();
    const lacking = view.kind in (known.curves || { "": 1, listed: 1 }) ? "" : `no ${view.kind} in these data`;
    told(lacking || state.missing || data.header.missing || known.overview.problem || "");
    document.documentElement.dataset.drawn = packing.drawn.toFixed(1); // ms, for whoever measures
    document.documentElement.dataset.shown = `${view.run}/${view.frame}/${state.criterion}`;
  } catch (error) {
    if (!(error instanceof Failure)) throw error;
    told(error.message);
  }
  remember();
  ahead(ticket);
}

// Fetch what a step in the same direction will show, once this frame stands.
function ahead(ticket) {
  const next = view.frame + (view.frame >= (known.shown ?? 0) ? 1 : -1);
  known.shown = view.frame;
  if (next < 0 || next >= known.overview.frame_count || view.kind === "force" || view.kind === "gap") return;
  setTimeout(() => {
    if (ticket !== known.ticket) return;
    for (const fetched of [source.packing(view.run, next, choice()), source.state(view.run, next, choice())]) fetched.catch(() => {});
  }, 0);
}

function numbers(state) {
  const { values } = state;
  const named = [["z", state.z_definition], ["a'", values.a_signed === null ? "a" : "a_signed"], ["rattlers", "rattler_fraction"], ["q/p", "q_over_p"], ["φ", "phi"], ["contacts", "contact_count"]];
  $("numbers").replaceChildren(...named.map(([text, name]) => {
    const span = document.createElement("span");
    const value = values[name];
    span.dataset.name = name;
    span.dataset.value = value;
    span.textContent = `${text} = ${value === null ? "?" : Number.isInteger(value) && name.endsWith("count") ? value : value.toFixed(4)}   `;
    return span;
  }));
  $("criterion").textContent = state.criterion.replace(/:(.*)/, (_, number) => ` ${Number(number).toPrecision(3)}`);
}

function charts() {
  const own = known.series[view.run];
  drawRose($("rose"), known.state);
  drawMohr($("mohr"), known.state, domain());
  drawPath($("path-chart"), known.series, [known.state.point], domain(), view);
  drawSeries($("series"), own, known.overview.frames.eps_q[view.frame], view.definition);
  const found = domain();
  $("limits").textContent = found ? `${found.z_min.toFixed(3)} … ${found.z_max.toFixed(3)}` : "no domain";
  $("limits").title = known.fit && known.fit.missing ? known.fit.missing : "z_min … z_max";
}

function handles() {
  const fitted = known.fit && known.fit.domain;
  for (const [id, name] of [["low", "z_min"], ["high", "z_max"]]) {
    $(id).disabled = !fitted;
    if (!fitted) continue;
    const wide = fitted.z_max - fitted.z_min;
    $(id).min = Math.max(fitted[name] - wide, 0.05);
    $(id).max = fitted[name] + wide;
    $(id).value = view[id] || fitted[name];
  }
}

// Ask again and again whether the files have grown; stay at the end if that is where one looks.
async function follow() {
  try {
    const listed = (await source.runs()).runs;
    const changed = listed.some((one, k) => !known.listed[k] || one.revision !== known.listed[k].revision);
    if (listed.some((one, k) => known.listed[k] && one.generation !== known.listed[k].generation)) source.forget();
    const first = !known.overview;
    const atEnd = !first && view.frame === known.overview.frame_count - 1;
    known.listed = listed;
    if (changed) {
      if (atEnd) view.frame = -1;
      fillRuns();
      await openRun();
    }
  } catch (error) {
    told(error instanceof Failure ? error.message : "the server does not answer; is granufab view still running?");
  }
  setTimeout(follow, 1500);
}

function fillRuns() {
  $("run").replaceChildren(...known.listed.map(({ run, name }) => new Option(name.split("/").slice(-3).join("/"), run)));
  view.run = Math.min(view.run, known.listed.length - 1);
  $("run").value = view.run;
}

function step(by) {
  const count = known.overview ? known.overview.frame_count : 0;
  if (!count) return;
  view.frame = Math.min(Math.max(view.frame + by, 0), count - 1);
  showFrame();
}

let playing = false;
async function play() {
  playing = !playing;
  $("play").textContent = playing ? "❚❚" : "▶";
  while (playing && known.overview) {
    view.frame = (view.frame + 1) % known.overview.frame_count;
    const pause = new Promise((done) => setTimeout(done, 120));
    await showFrame();
    await pause;
  }
}

function dress() {
  const dark = view.theme ? view.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.classList.toggle("dark", dark);
  if (known.state) charts();
}

function changing(id, name, then, event = "change") {
  const field = $(id);
  if (field.tagName === "SELECT") field.value = view[name];
  field.addEventListener(event, () => { view[name] = typeof view[name] === "number" ? Number(field.value) : field.value; then(); });
}

restore();
changing("run", "run", () => { view.frame = -1; openRun(); });
changing("definition", "definition", () => openRun());
changing("kind", "kind", () => showFrame());
changing("threshold", "level", () => showFrame(), "input");
changing("colour", "colour", () => { packing.set({ colour: view.colour }); $("legend").textContent = packing.legend; remember(); });
changing("lines", "lines", () => { packing.set({ lines: view.lines }); remember(); });
changing("images", "images", () => { packing.set({ images: view.images }); remember(); });
changing("plane", "plane", () => { charts(); remember(); });
changing("low", "low", () => { charts(); remember(); }, "input");
changing("high", "high", () => { charts(); remember(); }, "input");
changing("frame", "frame", () => showFrame(), "input");
$("threshold").value = view.level;
packing.set({ colour: view.colour, lines: view.lines, images: view.images });
$("fitted").addEventListener("click", () => { view.low = view.high = ""; handles(); charts(); remember(); });
$("whole").addEventListener("click", () => packing.whole());
$("play").addEventListener("click", play);
$("theme").addEventListener("click", () => { view.theme = document.documentElement.classList.contains("dark") ? "light" : "dark"; dress(); remember(); });
for (const button of document.querySelectorAll("#packing button.save")) {
  button.addEventListener("click", async () => {
    const type = button.dataset.type;
    const link = document.createElement("a");
    link.download = `packing-${view.frame}.${type}`;
    link.href = URL.createObjectURL(await packing.picture(type === "svg" ? "image/svg+xml" : "image/png"));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}
addEventListener("keydown", (event) => {
  if (["SELECT", "INPUT"].includes(event.target.tagName) && event.target.id !== "frame") return;
  const steps = { ArrowRight: 1, ArrowLeft: -1, PageDown: 10, PageUp: -10, Home: -1e9, End: 1e9 };
  if (event.key in steps) { event.preventDefault(); step(steps[event.key]); }
  if (event.key === " " && event.target.tagName !== "BUTTON") { event.preventDefault(); play(); }
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", dress);
dress();
follow();
