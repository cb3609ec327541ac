// The page: one choice of run, frame and criterion, which every panel follows.

import { arrange, fillBars } from "./bars.js";
import { choice, criterionText, drawCurve, meaning, slides } from "./criterion.js";
import { chosen } from "./domain.js";
import { $, bind, fillRuns, offer, savedWords } from "./fields.js";
import { follow } from "./following.js";
import { latest } from "./latest.js";
import { frameWords, showNumbers } from "./numbers.js";
import { PackingView } from "./packing.js";
import { Panels } from "./panels.js";
import { Player } from "./playing.js";
import { fileName, save } from "./saving.js";
import { Failure, openSource } from "./source.js";
import { isDark, remember, restore, view } from "./view.js";

const source = openSource();
const known = {
  listed: [], overview: null, series: [], fitted: null, domain: null, state: null, interval: null, curves: null, held: null,
  version: 0, count: 0, eps: null, view,
};
const data = document.documentElement.dataset;
const said = { lost: "", frame: "" };

function told(kind, text) {
  said[kind] = text || "";
  $("message").textContent = $("message").title = said.lost || said.frame;
}

restore();
document.documentElement.classList.toggle("dark", isDark());
const packing = new PackingView($("canvas"), (words) => { $("picked").textContent = words; });
const panels = new Panels(known, view, { limits: moveLimit, settled: settleLimits, jump: (frame) => goTo(frame) });

async function openRun() {
  const [overview, fit, ...series] = await Promise.all([source.overview(view.run), source.fit(view.definition), ...known.listed.map(({ run }) => source.series(run))]);
  known.version += 1;
  known.overview = overview;
  known.series = series.map((one, k) => ({ ...one, name: known.listed[k].name }));
  known.seriesMissing = series[view.run].missing;
  known.fitted = fit.domain;
  known.fitMissing = fit.missing;
  known.domain = chosen(known.fitted, view);
  const last = overview.frame_count - 1;
  if (view.frame < 0 || view.frame > last) view.frame = last;
  $("frame").max = Math.max(last, 0);
  const words = [savedWords(source.saved), ...(overview.source || [])].filter(Boolean);
  $("saved").textContent = $("saved").title = words.join(" · ");
  offer(source.choices);
  await showFrame();
}

// The frame that the view asks for; of several asked for while one is drawn, the last.
const showFrame = latest(async () => {
  if (!known.overview) return;
  $("frame").value = view.frame;
  remember();
  if (view.frame < 0) { told("frame", "no frame is recorded yet"); return; }
  const started = performance.now();
  try {
    await drawFrame(view.run, view.frame);
    data.change = (performance.now() - started).toFixed(1);
  } catch (error) {
    if (!(error instanceof Failure)) throw error;
    told("frame", error.message);
  }
  ahead();
});

async function drawFrame(run, frame) {
  const curves = slides(view) ? await source.criterion(run, frame, choice(view, null)) : null;
  fitLevel(curves);
  const asked = choice(view, curves);
  const interval = view.tab === "changes" ? intervalOf(run, frame, asked) : null;
  const [packed, state] = await Promise.all([source.packing(run, frame, asked), source.state(run, frame, asked)]);
  Object.assign(known, { count: known.count + 1, state, curves, eps: known.overview.frames.eps_q[frame], interval: await interval });
  packing.show(packed);
  $("legend").textContent = packing.legend;
  $("place").textContent = frameWords(known.overview, frame);
  showNumbers($("numbers"), state);
  showCriterion(state);
  await panels.draw();
  const lacking = slides(view) && !(curves && curves[view.kind]) ? `no ${view.kind} in these data, so the criterion stays ${criterionText(state.criterion)}` : "";
  const { problem } = known.listed[run];
  told("frame", problem || lacking || state.missing || packed.header.missing);
  data.drawn = packing.drawn.toFixed(1); // ms, for whoever measures
  data.shown = `${run}/${frame}/${state.criterion}`;
}

// Saved files hold fewer levels: one beyond them becomes the middle one.
function fitLevel(curves) {
  const curve = curves && curves[view.kind];
  if (!curve) return;
  if (view.level >= curve.threshold.length) view.level = Math.floor(curve.threshold.length / 2);
  $("threshold").max = curve.threshold.length - 1;
  $("threshold").value = view.level;
}

async function intervalOf(run, frame, asked) {
  try {
    return await source.interval(run, frame, asked);
  } catch (error) {
    if (!(error instanceof Failure)) throw error;
    return { missing: error.message };
  }
}

function showCriterion(state) {
  const curve = slides(view) && known.curves ? known.curves[view.kind] : null;
  $("threshold").hidden = !curve;
  $("threshold").setAttribute("aria-valuetext", criterionText(state.criterion));
  $("criterion").textContent = criterionText(state.criterion);
  $("criterion").title = meaning(view.kind);
  drawCurve($("curve"), curve, view.level);
}

// Fetch what a step in the same direction will show, once this frame stands.
function ahead() {
  const next = view.frame + (view.frame >= (known.before ?? 0) ? 1 : -1);
  known.before = view.frame;
  if (next < 0 || next >= known.overview.frame_count || slides(view)) return;
  const run = view.run;
  setTimeout(() => {
    if (run !== view.run || known.before !== view.frame) return;
    const asked = choice(view, null);
    const fetched = [source.packing(run, next, asked), source.state(run, next, asked)];
    if (view.tab === "changes") fetched.push(source.interval(run, next, asked));
    for (const one of fetched) one.catch(() => {});
  }, 0);
}

// ---- what the user asks for

function goTo(frame) {
  const count = known.overview ? known.overview.frame_count : 0;
  if (!count) return null;
  view.frame = Math.min(Math.max(frame, 0), count - 1);
  return showFrame();
}

const redraw = latest(async () => { if (known.state) await panels.draw(); });

function moveLimit(name, value) {
  view[name === "z_min" ? "low" : "high"] = value.toFixed(4);
  known.held ??= panels.ranges();
  known.domain = chosen(known.fitted, view);
  redraw();
}

function settleLimits() {
  known.held = null;
  redraw();
  remember();
}

function arranged() {
  arrange(view);
  remember();
  return view.tab === "changes" ? showFrame() : redraw();
}

function enlarge(name) {
  const cell = name === "changes" ? "rose" : name;
  view.large = view.large === cell ? "packing" : cell;
  arranged();
}

async function savePanel(name, type) {
  const blob = await (name === "packing" ? packing.picture(type === "svg" ? "image/svg+xml" : "image/png") : panels.picture(name, type));
  const panel = name === "rose" && $("rose").classList.contains("surface") ? "surface" : name;
  save(blob, fileName(known.listed[view.run].name, panel, known.overview.frames.number[view.frame], type));
}

function dress() {
  document.documentElement.classList.toggle("dark", isDark());
  panels.stale();
  packing.set({ colour: view.colour, lines: view.lines, images: view.images });
  $("legend").textContent = packing.legend;
  redraw();
}

function dressPacking() {
  packing.set({ colour: view.colour, lines: view.lines, images: view.images });
  $("legend").textContent = packing.legend;
  remember();
}

fillBars({ save: savePanel, large: enlarge, tab: (name) => { view.tab = name; arranged(); } });
arrange(view);
bind("run", "run", () => { view.frame = -1; openRun(); });
bind("definition", "definition", openRun);
bind("kind", "kind", () => { offer(source.choices); openRun(); });
bind("threshold", "level", showFrame, "input");
for (const name of ["colour", "lines", "images"]) bind(name, name, dressPacking);
bind("plane", "plane", () => { redraw(); remember(); });
bind("frame", "frame", showFrame, "input");
dressPacking();
$("fitted").addEventListener("click", () => { view.low = view.high = ""; known.domain = known.fitted; settleLimits(); });
$("whole").addEventListener("click", () => packing.whole());
$("theme").addEventListener("click", () => { view.theme = isDark() ? "light" : "dark"; dress(); remember(); });
$("help-key").addEventListener("click", () => $("help").showModal());
const player = new Player($("play"), {
  step: (by) => goTo(view.frame + by),
  next: () => goTo((view.frame + 1) % Math.max(known.overview ? known.overview.frame_count : 1, 1)),
});
addEventListener("keydown", (event) => {
  if (player.pressed(event) || $("help").open) return;
  if (event.key === "?" && event.target.tagName !== "INPUT") $("help").showModal();
  if (event.key === "Escape" && view.large !== "packing") enlarge(view.large);
});
// After a click with the pointer the keys belong to the page again.
addEventListener("click", (event) => {
  const button = event.detail ? event.target.closest("button") : null;
  if (button) button.blur();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", dress);
matchMedia("(min-width: 1600px)").addEventListener("change", dress);
follow(source, async (listed, replaced) => {
  if (replaced) source.forget();
  const atEnd = known.overview && view.frame === known.overview.frame_count - 1;
  if (atEnd) view.frame = -1; // stay at the end
  known.listed = listed;
  fillRuns(listed);
  await openRun();
}, (words) => told("lost", words));
