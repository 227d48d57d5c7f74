"use strict";
// The force of the load over the last ten seconds, and the running stiffness over the last two minutes.
const STIFFNESS_S = 120;
const AXES = 2; // are drawn; a third is told in the recording alone
const felt = { t: [], force: [[], []], looks: [] };

function forget() { felt.t.length = 0; felt.force.forEach((axis) => { axis.length = 0; }); felt.looks.length = 0; }

function feel(message) {
  document.querySelectorAll(".force").forEach((figure) => { figure.hidden = false; });
  say("force_words", `(${message.words})`);
  felt.t.push(...message.t);
  message.force.slice(0, AXES).forEach((axis, k) => felt.force[k].push(...axis));
  const old = felt.t.findIndex((t) => t > felt.t.at(-1) - WINDOW_S);
  if (old > 0) { felt.t.splice(0, old); felt.force.forEach((axis) => axis.splice(0, old)); }
  message.looks.forEach(look);
}

function look(found) {
  say("stiffness_words", found.reason ? `(not known just now: ${found.reason})` : "");
  say("window_s", found.window_s);
  if (!found.K || found.t === null) {
    [1, 2].forEach((k) => say(`now_stiffness_${k}`, k === 1 ? "-" : ""));
    return;
  }
  felt.looks.push(found);
  while (felt.looks[0].t < found.t - STIFFNESS_S) felt.looks.shift();
  say("stiffness_unit", found.unit);
  say("force_unit", found.unit.startsWith("N*m") ? "N m" : "N");
  found.axes.slice(0, AXES).forEach((axis, k) => {
    say(`force_axis_${k + 1}`, k ? `${axis} (dashed)` : axis);
    const [low, high] = found.ci95[k][k];
    say(`now_stiffness_${k + 1}`, `${found.axes.length > 1 ? axis : ""}${found.axes.length > 1 ? axis : ""} ${near(found.K[k][k], high - low)} ± ${near((high - low) / 2, high - low)}${k ? " (dashed)" : ""}`);
  });
}

// As many digits as the interval leaves worth reading.
function near(value, width) { return value.toFixed(Math.max(0, Math.min(4, 1 - Math.floor(Math.log10(width / 2 || 1))))); }

function drawForce(time, now) {
  if (document.querySelector(".force").hidden) return;
  const shown = felt.force.filter((axis) => axis.length);
  plot(byId("force"), { ...time, yLabel: byId("force_unit").textContent, least: 0.5 }, shown.map((y) => ({ x: felt.t, y })));
  shown.forEach((axis, k) => say(`now_force_${k + 1}`, axis.at(-1).toFixed(2)));
  const begin = Math.max(0, now - STIFFNESS_S);
  const x = felt.looks.map((found) => found.t);
  const series = (felt.looks.at(-1)?.axes ?? []).slice(0, AXES).map((_, k) => ({
    x,
    y: felt.looks.map((found) => found.K[k][k]),
    low: felt.looks.map((found) => found.ci95[k][k][0]),
    high: felt.looks.map((found) => found.ci95[k][k][1]),
  }));
  plot(byId("stiffness"), { x: [begin, begin + Math.max(30, now - begin)], xLabel: byId("stiffness").clientWidth > 500 ? "time since the run began (s); each point is the window before it" : "end of each window (s)", yLabel: byId("stiffness_unit").textContent, least: 1, gap: 3 }, series);
}
