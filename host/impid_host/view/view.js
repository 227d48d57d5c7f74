"use strict";
// Four seconds of samples, drawn once per frame of the screen. Values are what the recording holds: codes, counts.
const WINDOW = 4000;
const COLOURS = ["#0b62a8", "#c25700"];
const NAMES = ["index", "t_us", "ax", "ay", "enc1", "enc2"];
const byId = (id) => document.getElementById(id);
const kept = Object.fromEntries(NAMES.map((name) => [name, []]));
// For tests, and for whoever opens the console.
const impid = { received: 0, missed: 0, lastIndex: -1, spectrum: null, progress: {}, frames: 0 };
window.impid = impid;
let run = null;
let rate = { at: performance.now(), stored: 0 };

function take(message) {
  if (JSON.stringify(message.run) !== JSON.stringify(run)) {
    run = message.run;
    NAMES.forEach((name) => { kept[name].length = 0; });
    impid.lastIndex = -1;
  }
  const fresh = message.samples;
  if (fresh.index.length) {
    if (impid.lastIndex >= 0) impid.missed += Math.max(0, fresh.index[0] - impid.lastIndex - 1);
    impid.lastIndex = fresh.index[fresh.index.length - 1];
    impid.received += fresh.index.length;
    NAMES.forEach((name) => {
      kept[name].push(...fresh[name]);
      if (kept[name].length > WINDOW) kept[name].splice(0, kept[name].length - WINDOW);
    });
  }
  if (message.spectrum) impid.spectrum = message.spectrum;
  if (message.progress.kind) tell(message.progress);
}

function tell(progress) {
  impid.progress = progress;
  const now = performance.now();
  if (now - rate.at > 1000) {
    byId("rate").textContent = `${Math.round((progress.stored - rate.stored) / (now - rate.at) * 1000)} /s`;
    rate = { at: now, stored: progress.stored };
  }
  byId("elapsed").textContent = `${progress.elapsed_s.toFixed(1)} s`;
  byId("stored").textContent = progress.stored;
  count("lost", progress.lost);
  count("damaged", progress.damaged);
  byId("clock").textContent = progress.clock;
  state(progress.connected ? "recording" : "the board is gone, waiting for it", !progress.connected);
}

function count(id, value) {
  byId(id).textContent = value;
  byId(id).classList.toggle("bad", value > 0);
}

function state(text, gone) {
  byId("state").textContent = text;
  byId("state").classList.toggle("gone", gone);
}

function plot(id, series, scale) {
  const canvas = byId(id);
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, width, height);
  const all = series.flat().map(scale);
  if (all.length < 4) return;
  let low = Infinity, high = -Infinity;
  for (const value of all) { if (value < low) low = value; if (value > high) high = value; }
  if (high === low) { low -= 1; high += 1; }
  const left = 70 * ratio;
  const y = (value) => height - 6 * ratio - (value - low) / (high - low) * (height - 12 * ratio);
  pen.font = `${12 * ratio}px system-ui, sans-serif`;
  pen.fillStyle = "#5b666e";
  pen.strokeStyle = "#e3e6e8";
  for (const value of [low, (low + high) / 2, high]) {
    pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width, y(value)); pen.stroke();
    pen.fillText(label(id, value), 2, Math.min(height - 2, Math.max(12 * ratio, y(value) + 4 * ratio)));
  }
  series.forEach((values, number) => {
    const step = (width - left) / Math.max(1, values.length - 1);
    pen.strokeStyle = COLOURS[number];
    pen.lineWidth = 1.2 * ratio;
    pen.beginPath();
    values.forEach((value, k) => { const at = y(scale(value)); if (k) pen.lineTo(left + k * step, at); else pen.moveTo(left, at); });
    pen.stroke();
  });
}

function label(id, value) {
  return id === "spectrum" ? (10 ** value).toPrecision(2) : String(Math.round(value));
}

function draw() {
  impid.frames += 1;
  plot("acceleration", [kept.ax, kept.ay], (v) => v);
  plot("encoders", [kept.enc1, kept.enc2], (v) => v);
  if (impid.spectrum) plot("spectrum", [impid.spectrum.ax.slice(1), impid.spectrum.ay.slice(1)], (v) => Math.log10(Math.max(v, 1e-2)));
  requestAnimationFrame(draw);
}

async function ask(what, body) {
  const answer = await fetch(`api/${what}`, { method: "POST", headers: { "X-Impid-Token": byId("token").value }, body });
  byId("answer").textContent = answer.ok ? `done: ${what}` : await answer.text();
}

function connect() {
  const socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => { state("the recording has ended", true); setTimeout(connect, 2000); };
}

byId("stop").onclick = () => ask("stop", "");
byId("mark").onclick = () => ask("mark", byId("text").value);
connect();
draw();
