"use strict";
// The last ten seconds in physical units, drawn when something new has come and the tab is seen.
const WINDOW_S = 10;
const NAMES = ["t", "acc_x", "acc_y", "angle_1", "angle_2"];
const LEVELS = { good: "good", look: "look", bad: "wrong" };
const byId = (id) => document.getElementById(id);
const kept = Object.fromEntries(NAMES.map((name) => [name, []]));
// For tests, and for whoever opens the console.
const impid = { received: 0, drawn: 0, spectrum: null, progress: {}, lamp: null, units: ["counts", "counts"], tabs: 0, problems: [] };
window.impid = impid;
window.addEventListener("error", (event) => impid.problems.push(event.message));
let run = "null";
let rate = null;
let fresh = true;

function take(message) {
  fresh = true;
  if (message.angle_units) {
    impid.units = message.angle_units;
    byId("source").textContent = `units by ${message.source}`;
    return;
  }
  const began = JSON.stringify(message.run);
  if (began !== run) { run = began; NAMES.forEach((name) => { kept[name].length = 0; }); forget(); }
  const points = message.points;
  impid.received += points.t.length;
  NAMES.forEach((name) => kept[name].push(...points[name]));
  const old = kept.t.findIndex((t) => t > kept.t.at(-1) - WINDOW_S);
  if (old > 0) NAMES.forEach((name) => kept[name].splice(0, old));
  if (message.spectrum) impid.spectrum = message.spectrum;
  impid.tabs = message.tabs;
  shine(message.lamp);
  if (message.force) feel(message.force);
  if (message.progress.kind) tell(message.progress);
}

function shine(lamp) {
  impid.lamp = lamp;
  byId("lamp").className = lamp.level;
  say("level", LEVELS[lamp.level]);
  say("words", lamp.words.join("; "));
}

function tell(progress) {
  impid.progress = progress;
  // By the board's clock, so that neither its pace nor this page's makes it flicker.
  const now = performance.now();
  if (rate === null) rate = { at: now, elapsed_s: progress.elapsed_s, stored: progress.stored };
  if (now - rate.at > 2000) {
    const spent = progress.elapsed_s - rate.elapsed_s;
    say("rate", spent > 0 ? `${Math.round((progress.stored - rate.stored) / spent)} Hz` : "0 Hz");
    rate = { at: now, elapsed_s: progress.elapsed_s, stored: progress.stored };
  }
  say("elapsed", clock(progress.elapsed_s));
  say("stored", progress.stored.toLocaleString("en"));
  count("lost", progress.lost);
  count("damaged", progress.damaged);
  say("clock", progress.clock ?? "not determined");
}

// Words that stay the same are not written again, so that a screen reader says them once.
function say(id, text) { if (byId(id).textContent !== String(text)) byId(id).textContent = text; }
function count(id, value) { say(id, value); byId(id).classList.toggle("bad", value > 0); }
function clock(s) { return s < 60 ? `${s.toFixed(1)} s` : `${Math.floor(s / 60)} min ${String(Math.floor(s % 60)).padStart(2, "0")} s`; }

function draw() {
  requestAnimationFrame(draw);
  if (!fresh) return;
  fresh = false;
  impid.drawn += 1;
  const now = kept.t.at(-1) ?? WINDOW_S;
  const begin = Math.max(0, now - WINDOW_S);
  const time = { x: [begin, begin + WINDOW_S], xLabel: "time since the run began (s)", gap: 0.1 };
  const lines = (...names) => names.map((name) => ({ x: kept.t, y: kept[name] }));
  plot(byId("acceleration"), { ...time, yLabel: "m/s²", least: 0.5 }, lines("acc_x", "acc_y"));
  const units = [...new Set(impid.units)].join(" and ");
  const least = impid.units.includes("counts") ? 10 : 0.01;
  plot(byId("angles"), { ...time, yLabel: units, least }, lines("angle_1", "angle_2"));
  for (const name of NAMES.slice(1)) {
    const value = kept[name].at(-1);
    if (value !== undefined) say(`now_${name}`, named(name, value));
  }
  drawForce(time, now);
  const found = impid.spectrum;
  const x = found ? found.acc_x.map((_, k) => k * found.step_hz) : [];
  const shown = found ? [found.acc_x, found.acc_y].map((y) => ({ x: x.slice(1), y: y.slice(1) })) : [];
  plot(byId("spectrum"), { x: [0, 20], xLabel: "frequency (Hz)", yLabel: "m/s²", log: true, floor: 1e-6, gap: 1 }, shown);
  say("peak", found ? peak(x, found) : "(after four seconds)");
}

function named(name, value) {
  if (name.startsWith("acc")) return value.toFixed(2);
  const unit = impid.units[Number(name.at(-1)) - 1];
  return unit === "counts" ? `${Math.round(value)} counts` : `${value.toFixed(4)} ${unit}`;
}

function peak(x, found) {
  let at = 1;
  for (let k = 1; k < x.length; k++) if (found.acc_x[k] + found.acc_y[k] > found.acc_x[at] + found.acc_y[at]) at = k;
  return `(largest at ${x[at].toFixed(2)} Hz)`;
}

async function ask(what, body) {
  const answer = await fetch(`api/${what}`, { method: "POST", headers: { "X-Impid-Token": byId("token").value }, body });
  byId("answer").textContent = answer.ok ? `done: ${what}` : await answer.text();
}

function connect() {
  const socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => {
    shine({ level: "look", words: ["this page has lost the recorder: the recording has ended, or too many pages look"] });
    setTimeout(connect, 2000 + 2000 * Math.random());
  };
}

byId("stop").onclick = () => ask("stop", "");
byId("mark").onclick = () => ask("mark", byId("text").value);
window.addEventListener("resize", () => { fresh = true; });
connect();
draw();
