// The page: its controls, the two workers, and what they tell.

import { Film } from "./film.js";
import { Instance } from "./instance.js";
import { pad, show } from "./pad.js";
import * as address from "./state.js";
import { Tiles } from "./tiles.js";

/** Milliseconds between two drawings of the charts, and after the last change of a control until a run starts. */
const CHARTS = 400, PAUSE = 400;
/** Milliseconds in which a run is shown again. */
const REPLAY = 5000;
/** Charts are as wide as there is room, and readable. */
const SIZE = "svg { display: block; width: 100%; min-width: 21rem; height: auto }";
/** Outlines that come with the page. */
const ISLANDS = ["iceland", "jamaica", "madagascar", "sri-lanka"];

const $ = (id) => document.getElementById(id);
const state = address.read();
/** Somebody wants nothing to move unasked. */
const still = matchMedia("(prefers-reduced-motion: reduce)");
/** The number of the last run: one that still waits for its file gives way to a later one. */
let compiled, library, dropped = null, later = 0, last = 0;
const sides = {
  cpu: { label: "CPU, f64", tiles: new Tiles($("cpu"), "--cpu"), film: new Film(), says: $("cpu-says") },
  gpu: { label: "GPU, f32", tiles: new Tiles($("gpu"), "--gpu"), film: new Film(), says: $("gpu-says") },
};

/** Says something in the line that screen readers announce. */
function say(words, wrong = false) {
  $("status").textContent = words;
  $("status").classList.toggle("wrong", wrong);
}

// ---- settings

/** Lets ε go as far as the library allows with so many waves. */
function bound() {
  const { eps } = library.ask({ ask: "strongest", waves: state.waves });
  $("eps").max = eps;
  $("strongest").textContent = `1/(M² - 1) = ${(1 / (state.waves ** 2 - 1)).toFixed(4)}`;
}

function controls() {
  if (![...$("waves").options].some((option) => option.value === `${state.waves}`)) state.waves = address.DEFAULTS.waves;
  bound();
  for (const key of Object.keys(address.DEFAULTS).filter((key) => key !== "points")) $(key).value = state[key];
  $("points").value = address.decoded(state.points);
  // What the controls show is what runs.
  for (const control of document.querySelectorAll("#settings select, #settings input[type=range]")) {
    if (control.value === "") control.value = address.DEFAULTS[control.id];
    state[control.id] = typeof address.DEFAULTS[control.id] === "number" ? Number(control.value) : control.value;
  }
  shown();
}

/** Brings outputs and hidden controls up to date. */
function shown() {
  document.querySelectorAll("output").forEach((output) => { output.value = $(output.htmlFor.value).value; });
  document.querySelectorAll("[data-shape]").forEach((part) => { part.hidden = part.dataset.shape !== state.shape; });
  document.querySelectorAll("[data-flow]").forEach((part) => { part.hidden = part.dataset.flow !== state.flow; });
  $("crystal").hidden = state.flow !== "surface-diffusion" || !(state.eps > 0);
  show($("pad"), address.pointsOf($("points").value));
}

/** The text of drawn.csv. */
function table() { return `x,y\n${$("points").value.trim()}\n`; }

/** The file that this shape names, if it does. */
async function file(shape) {
  if (shape === "drawn") {
    if (!$("points").value.trim()) throw new Error("Draw an outline on the pad, or type its points.");
    return { name: "drawn.csv", bytes: new TextEncoder().encode(table()) };
  }
  if (shape === "file") {
    if (!dropped) throw new Error("Choose a file with an outline, or drop one on the page.");
    return dropped;
  }
  if (!ISLANDS.includes(shape)) return null;
  const answer = await fetch(`${shape}.csv`);
  if (!answer.ok) throw new Error(`${shape}.csv: the server answers ${answer.status}`);
  return { name: `${shape}.csv`, bytes: new Uint8Array(await answer.arrayBuffer()) };
}

/** Offers the outline that the command reads, unless the user has its file. */
function offer(outline) {
  const link = $("save");
  link.hidden = !outline || outline === dropped;
  if (link.hidden) return;
  link.href = `data:text/csv;charset=utf-8,${encodeURIComponent(new TextDecoder().decode(outline.bytes))}`;
  link.download = outline.name;
  link.textContent = `Save ${outline.name}, which it reads`;
}

/** The chosen settings as the library takes them. */
function settings(chosen, outline) {
  const { shape, aspect, petals, flow, lambda, waves, eps, steps, amplitude, n, curves, seed } = chosen;
  const shapes = { ellipse: `ellipse:${aspect},1`, circle: "circle:1", flower: `flower:${petals}:0.3` };
  return {
    shape: outline ? `file:${outline.name}` : shapes[shape] ?? shape,
    flow: flow === "elastic" ? `elastic:${lambda}` : flow,
    energy: flow === "surface-diffusion" && eps > 0 ? `cos:${waves},${eps}` : null,
    amplitude, n, curves, seed, adaptive: steps !== "fixed",
  };
}

// ---- a run, and once more

/** The share of the run that is shown: the latest frame, unless a replay has begun at a time or one has chosen another. */
const shownAt = { share: 1, since: null };

/** Shows a share of the run. */
function showAt(share) {
  shownAt.share = share;
  $("moment").value = share;
  for (const side of Object.values(sides)) side.drawn = false;
}

function replay() {
  Object.assign(shownAt, { share: 0, since: performance.now() });
}

/** Offers to see what has moved once more. */
function offerReplay() {
  $("again").hidden = !Object.values(sides).some((side) => side.film.moves);
}

function stop() {
  clearTimeout(later);
  last += 1;
  for (const side of Object.values(sides)) side.worker?.terminate();
  $("stop").disabled = true;
  offerReplay();
}

async function run() {
  stop();
  delete document.body.dataset.done;
  const own = last, chosen = { ...state };
  $("stop").disabled = false;
  let outline, wanted;
  try {
    outline = await file(chosen.shape);
    if (own !== last) return;
    wanted = settings(chosen, outline);
    library.file = outline;
    const { members, command, warnings } = library.ask({ ask: "check", settings: wanted });
    $("command").textContent = command;
    offer(outline);
    $("warnings").textContent = warnings.join(" ");
    say(`${members} members relax.`);
  } catch (error) {
    if (own !== last) return;
    $("stop").disabled = $("save").hidden = true;
    $("command").textContent = $("warnings").textContent = "";
    say(error.message, true);
    return;
  }
  $("difference").textContent = "";
  $("again").hidden = true;
  Object.assign(shownAt, { share: 1, since: null });
  $("moment").value = 1;
  $("members").tBodies[0].replaceChildren();
  for (const [place, side] of Object.entries(sides)) {
    Object.assign(side, { begins: null, frame: null, film: new Film(), rows: new Map(), over: false, drawn: true });
    side.tiles.clear();
    side.tiles.canvas.hidden = false;
    side.says.textContent = "starts …";
    const worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
    const received = (words) => own === last && receive(side, words);
    worker.addEventListener("message", ({ data }) => received(data));
    worker.addEventListener("error", (event) => received({ error: event.message || "the worker failed" }));
    side.worker = worker;
    const precision = place === "gpu" ? "f32" : "f64";
    worker.postMessage({ compiled, settings: { ...wanted, precision }, file: outline, place });
  }
  Object.assign(draw, { settings: wanted, charted: -Infinity });
}

/** Takes a message of a worker. */
function receive(side, { error, none, compiling, begins, frame }) {
  if (none) {
    side.over = side.tiles.canvas.hidden = true;
    side.says.textContent = `– ${none}; the run is on the CPU alone.`;
  } else if (error) {
    side.over = true;
    side.says.textContent = `– ${error}`;
    say(`${side.label}: ${error}`, true);
  } else if (compiling) {
    side.says.textContent = "– the kernel is being compiled …";
  } else if (begins) {
    side.begins = begins;
  } else if (frame) {
    frame.ended.forEach((row) => side.rows.set(row.member, row));
    side.film.add({ nodes: frame.nodes, done: frame.done });
    Object.assign(side, { frame, drawn: false, over: !frame.continues });
    const adapter = side.begins.adapter ? `, ${side.begins.adapter}` : "";
    side.says.textContent = `– ${frame.done} of ${side.begins.members} have ended${adapter}`;
    side.tiles.canvas.ariaLabel = `${side.label}: ${frame.done} of ${side.begins.members} members have ended`;
  }
  if (Object.values(sides).every((own) => own.over)) finish();
}

function finish() {
  $("stop").disabled = true;
  offerReplay();
  draw.charted = -Infinity;
  compare();
  const { cpu } = sides;
  const times = [...cpu.rows.values()].map((row) => row.t_relax).filter((t) => t !== null);
  const wrong = $("status").classList.contains("wrong");
  const relaxed = `${times.length} of ${cpu.rows.size} members have relaxed.`;
  say(wrong ? `${$("status").textContent} On the CPU, ${relaxed}` : relaxed, wrong);
  document.body.dataset.done = "yes";
}

// ---- what is shown

function draw(now) {
  requestAnimationFrame(draw);
  const running = Object.values(sides).filter((side) => side.frame);
  if (shownAt.since !== null) {
    showAt(Math.min(1, (now - shownAt.since) / REPLAY));
    if (shownAt.share === 1) shownAt.since = null;
  }
  for (const side of running.filter((side) => !side.drawn)) {
    const { nodes, done } = side.film.at(shownAt.share);
    side.tiles.draw(nodes, side.film.start.nodes, side.frame.rests, side.begins.n, new Set([...side.rows.keys()].slice(0, done)));
    [side.drawn, draw.isStale] = [true, true];
  }
  // At the start there is no line to draw.
  const hasLines = running.some((side) => side.frame.mean.length > 1);
  if (!draw.isStale || !hasLines || now - draw.charted < CHARTS) return;
  Object.assign(draw, { charted: now, isStale: false });
  const runs = running.map(({ label, begins: { times }, frame: { mean, times: relaxed, area } }) => (
    { label, t: times.slice(0, mean.length), mean, times: relaxed, area }));
  try {
    const charts = library.ask({ ask: "charts", settings: draw.settings, runs });
    for (const name of ["survival", "decay"]) {
      const shadow = $(name).shadowRoot ?? $(name).attachShadow({ mode: "open" });
      shadow.innerHTML = `<style>${SIZE}</style>${charts[name]}`;
    }
  } catch (error) {
    say(error.message, true);
  }
  compare();
}

/** Tells how far both sides are apart: in times, and in the excess at all times that both have noted. */
function compare() {
  const { cpu, gpu } = sides;
  rows();
  if (!cpu.frame || !gpu.frame) return;
  let most = 0, noted = 0;
  gpu.frame.excess.forEach((excess, i) => {
    const apart = Math.abs(excess - cpu.frame.excess[i]);
    // Both have the start from the same library.
    if (apart >= 0 && i % gpu.begins.times.length) [most, noted] = [Math.max(most, apart), noted + 1];
  });
  const relaxed = (row) => row?.t_relax != null;
  const both = [...gpu.rows.values()].filter((row) => relaxed(row) && relaxed(cpu.rows.get(row.member)));
  const apart = both.map((row) => Math.abs(row.t_relax / cpu.rows.get(row.member).t_relax - 1));
  const times = both.length
    ? ` Their relaxation times by at most ${brief(Math.max(...apart))} of the time, over ${both.length} members.`
    : "";
  $("difference").textContent = most === 0 ? "" :
    `CPU and GPU differ in the excess by at most ${brief(most)}, over ${noted} values so far.${times}`;
}

function brief(value) { return value === 0 ? "0" : value.toExponential(1); }

/** The table of times; numbers in full. */
function rows() {
  const body = $("members").tBodies[0];
  const all = new Set([...sides.cpu.rows.keys(), ...sides.gpu.rows.keys()]);
  const text = [...all].sort((a, b) => a - b).map((member) => {
    const [cpu, gpu] = [sides.cpu.rows.get(member), sides.gpu.rows.get(member)];
    const apart = cpu?.t_relax != null && gpu?.t_relax != null ? brief(Math.abs(cpu.t_relax - gpu.t_relax)) : "";
    const told = (row) => row?.t_relax ?? row?.status ?? "";
    return [member, told(cpu), told(gpu), apart, gpu?.bound ?? ""];
  });
  if (text.length === body.rows.length && text.every((row, i) => row.join() === body.rows[i].dataset.text)) return;
  body.replaceChildren(...text.map((cells) => {
    const row = document.createElement("tr");
    row.dataset.text = cells.join();
    cells.forEach((cell) => { row.insertCell().textContent = cell; });
    return row;
  }));
}

// ---- the beginning

/** Takes over what a control says. */
function changed({ target }) {
  if (!(target.id in address.DEFAULTS)) return;
  const isNumber = typeof address.DEFAULTS[target.id] === "number";
  const value = isNumber ? Number(target.value || NaN) : target.value;
  if (isNumber && !address.holds(target.id, value)) {
    return say(`${target.labels[0].textContent}: give a whole number from 0 to ${Number.MAX_SAFE_INTEGER}.`, true);
  }
  state[target.id] = target.id === "points" ? address.coded(value) : value;
  if (target.id === "waves") {
    bound();
    state.eps = $("eps").valueAsNumber;
  }
  address.write(state);
  shown();
  again();
}

function again() {
  clearTimeout(later);
  if (still.matches) say("Press Run to start.");
  else later = setTimeout(run, PAUSE);
}

async function take(taken) {
  if (!taken) return;
  try {
    // The name stands in a command, in quotes.
    const name = taken.name.replace(/[^\p{L}\p{N} ._()-]/gu, "_").replace(/^\.+/, "_");
    dropped = { name, bytes: new Uint8Array(await taken.arrayBuffer()) };
  } catch (error) {
    return say(`${taken.name}: it cannot be read (${error.message}).`, true);
  }
  state.shape = $("shape").value = "file";
  address.write(state);
  shown();
  run();
}

async function begin() {
  const fetched = await fetch("curvelax.wasm");
  if (!fetched.ok) throw new Error(`curvelax.wasm: the server answers ${fetched.status}`);
  // Not streamed: some static hosts do not know the type of the file.
  compiled = await WebAssembly.compile(await fetched.arrayBuffer());
  library = await Instance.of(compiled);
  controls();
  document.querySelectorAll("#settings fieldset, #run").forEach((part) => { part.disabled = false; });
  $("settings").addEventListener("input", changed);
  $("settings").addEventListener("submit", (event) => { event.preventDefault(); run(); });
  $("stop").addEventListener("click", () => { stop(); say("Stopped."); $("run").focus(); });
  $("replay").addEventListener("click", replay);
  $("moment").addEventListener("input", ({ target }) => {
    shownAt.since = null;
    showAt(target.valueAsNumber);
  });
  $("copy").addEventListener("click", () =>
    navigator.clipboard.writeText($("command").textContent).then(() => say("Copied."), () => say("Not copied.", true)));
  $("file").addEventListener("change", ({ target }) => take(target.files[0]));
  pad($("pad"), (points) => {
    $("points").value = address.snapped(points);
    $("points").dispatchEvent(new Event("input", { bubbles: true }));
  });
  const over = (on) => (event) => { event.preventDefault(); document.body.classList.toggle("dropping", on); };
  addEventListener("dragover", over(true));
  addEventListener("dragleave", over(false));
  addEventListener("drop", (event) => { over(false)(event); take(event.dataTransfer.files[0]); });
  addEventListener("hashchange", () => { Object.assign(state, address.read()); controls(); run(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const side of Object.values(sides)) side.drawn = false;
  });
  requestAnimationFrame(draw);
  document.body.dataset.loaded = Math.round(performance.now());
  if (still.matches) say("Nothing moves until you press Run, as your system asks for.");
  else run();
}

if (typeof WebAssembly === "object") begin().catch((error) => say(error.message, true));
