"use strict";
// Axes, grid and lines on a canvas: ticks at round numbers, colours from the style sheet.
const LEFT = 62, BOTTOM = 34, TOP = 8, RIGHT = 12;

function ticks(low, high, most) {
  const raw = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { step, found };
}

function written(value, step) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  if (digits > 4 || Math.abs(value) >= 1e6) return value === 0 ? "0" : value.toExponential(1);
  return value.toFixed(digits);
}

// axes: {x: [low, high], xLabel, yLabel, log}; series: [{x, y, low, high}], a gap in x above `gap` breaks a line;
// low and high, where they are given, bound a band about it.
function plot(canvas, axes, series) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(name).trim();
  const scale = axes.log ? (v) => Math.log10(Math.max(v, axes.floor)) : (v) => v;
  let low = Infinity, high = -Infinity;
  for (const { y, low: least, high: most } of series) for (const v of [...y, ...(least ?? []), ...(most ?? [])]) { const s = scale(v); if (s < low) low = s; if (s > high) high = s; }
  if (!(high >= low)) { low = 0; high = 1; }
  if (axes.log) { low = Math.floor(low); high = Math.max(low + 1, Math.ceil(high)); }
  else if (high - low < axes.least) { const middle = (low + high) / 2; low = middle - axes.least / 2; high = middle + axes.least / 2; }
  const [x0, x1] = axes.x;
  const atX = (v) => LEFT + (v - x0) / (x1 - x0) * (width - LEFT - RIGHT);
  const atY = (s) => height - BOTTOM - (s - low) / (high - low) * (height - BOTTOM - TOP);
  pen.font = "12px system-ui, sans-serif";
  pen.lineWidth = 1;
  pen.strokeStyle = colour("--grid");
  pen.fillStyle = colour("--soft");
  const down = axes.log ? { step: 1, found: Array.from({ length: high - low + 1 }, (_, k) => low + k) } : ticks(low, high, 4);
  pen.textAlign = "right";
  for (const v of down.found) {
    line(pen, LEFT, atY(v), width - RIGHT, atY(v));
    pen.fillText(axes.log ? decade(v) : written(v, down.step), LEFT - 6, atY(v) + 4);
  }
  const along = ticks(x0, x1, Math.max(2, Math.floor((width - LEFT) / 60)));
  pen.textAlign = "center";
  for (const v of along.found) {
    line(pen, atX(v), TOP, atX(v), height - BOTTOM);
    pen.fillText(written(v, along.step), atX(v), height - BOTTOM + 15);
  }
  pen.fillText(axes.xLabel, LEFT + (width - LEFT - RIGHT) / 2, height - 4);
  pen.save();
  pen.translate(12, TOP + (height - TOP - BOTTOM) / 2); pen.rotate(-Math.PI / 2);
  pen.fillText(axes.yLabel, 0, 0);
  pen.restore();
  series.forEach(({ x, y, low: least, high: most }, number) => {
    pen.strokeStyle = pen.fillStyle = colour(number ? "--b" : "--a");
    if (least) band(pen, x.map(atX), least.map((v) => atY(scale(v))), most.map((v) => atY(scale(v))), (k) => x[k] - x[k - 1] <= axes.gap);
    pen.lineWidth = 1.5;
    // Told apart without colour as well.
    pen.setLineDash(number ? [5, 3] : []);
    pen.beginPath();
    for (let k = 0; k < x.length; k++) {
      if (k && x[k] - x[k - 1] <= axes.gap) pen.lineTo(atX(x[k]), atY(scale(y[k])));
      else pen.moveTo(atX(x[k]), atY(scale(y[k])));
    }
    pen.stroke();
  });
  pen.setLineDash([]);
}

function band(pen, x, low, high, joined) {
  pen.globalAlpha = 0.2;
  for (let k = 1; k < x.length; k++) {
    if (!joined(k)) continue;
    pen.beginPath();
    pen.moveTo(x[k - 1], low[k - 1]); pen.lineTo(x[k], low[k]); pen.lineTo(x[k], high[k]); pen.lineTo(x[k - 1], high[k - 1]);
    pen.fill();
  }
  pen.globalAlpha = 1;
}

function line(pen, x0, y0, x1, y1) { pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke(); }
function decade(v) { return v >= -3 && v <= 3 ? String(Number((10 ** v).toPrecision(1))) : `1e${v}`; }
