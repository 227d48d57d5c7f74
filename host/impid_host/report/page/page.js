"use strict";
// Zooms the figures: the lines are drawn once, in whole numbers; only the inner view box and the ticks change.
(() => {
  const UNITS = 10000;
  const NS = "http://www.w3.org/2000/svg";

  // The same rule as svg.ticks.
  function ticks(low, high, most) {
    const raw = (high - low) / most;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw * (1 - 1e-9));
    const values = [];
    for (let k = Math.ceil(low / step - 1e-9); k <= Math.floor(high / step + 1e-9); k++) values.push(k * step);
    return values;
  }

  function word(value) {
    if (Math.abs(value) < 1e-12) return "0";
    return String(Number(value.toPrecision(6))).replace("-", "−");
  }

  function make(name, attributes, text) {
    const element = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text !== undefined) element.textContent = text;
    return element;
  }

  class Zoom {
    constructor(figure) {
      this.figure = figure;
      this.svg = figure.querySelector("svg.plot");
      this.data = figure.querySelector("svg.data");
      this.axes = figure.querySelector("g.axes");
      this.all = JSON.parse(this.svg.dataset.limits);
      this.marks = JSON.parse(this.svg.dataset.marks);
      this.view = [...this.all];
      this.inner = ["x", "y", "width", "height"].map((key) => Number(this.data.getAttribute(key)));
      this.tools();
      this.listen();
    }

    tools() {
      const bar = document.createElement("div");
      bar.className = "tools";
      this.out = document.createElement("output");
      bar.append(this.out);
      for (const [text, name, act] of [["+", "zoom in", () => this.scale(0.5)], ["−", "zoom out", () => this.scale(2)], ["all", "show all", () => this.set(this.all)]]) {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = text;
        button.title = name;
        button.setAttribute("aria-label", `${name}: ${this.figure.querySelector("figcaption").textContent}`);
        button.addEventListener("click", act);
        bar.append(button);
      }
      this.figure.append(bar);
    }

    listen() {
      this.figure.addEventListener("keydown", (event) => {
        if (event.target !== this.figure || event.ctrlKey || event.metaKey || event.altKey) return;
        const act = { "+": () => this.scale(0.5), "=": () => this.scale(0.5), "-": () => this.scale(2), 0: () => this.set(this.all), Escape: () => this.set(this.all), ArrowLeft: () => this.move(-0.2, 0), ArrowRight: () => this.move(0.2, 0), ArrowUp: () => this.move(0, 0.2), ArrowDown: () => this.move(0, -0.2) }[event.key];
        if (!act) return;
        event.preventDefault();
        act();
      });
      this.svg.addEventListener("dblclick", () => this.set(this.all));
      this.svg.addEventListener("pointerdown", (event) => this.drag(event));
      this.svg.addEventListener("pointermove", (event) => {
        const [x, y] = this.at(event);
        this.out.textContent = `${word(Number(x.toPrecision(4)))}, ${word(Number(y.toPrecision(4)))}`;
      });
      this.svg.addEventListener("pointerleave", () => { this.out.textContent = ""; });
      this.svg.addEventListener("wheel", (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        this.scale(event.deltaY > 0 ? 1.25 : 0.8, this.at(event));
      }, { passive: false });
    }

    // Data coordinates under the pointer, kept within the axes.
    at(event) {
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
      const [left, top, width, height] = this.inner;
      const [x0, x1, y0, y1] = this.view;
      const across = Math.min(1, Math.max(0, (point.x - left) / width));
      const down = Math.min(1, Math.max(0, (point.y - top) / height));
      return [x0 + across * (x1 - x0), y1 - down * (y1 - y0)];
    }

    drag(event) {
      if (event.button !== 0 || event.pointerType === "touch") return;
      const from = this.at(event);
      const rubber = make("rect", { class: "rubber" });
      this.data.append(rubber);
      this.svg.setPointerCapture(event.pointerId);
      const move = (next) => {
        const to = this.at(next);
        const [u0, v0] = this.units(Math.min(from[0], to[0]), Math.max(from[1], to[1]));
        const [u1, v1] = this.units(Math.max(from[0], to[0]), Math.min(from[1], to[1]));
        for (const [key, value] of Object.entries({ x: u0, y: v0, width: u1 - u0, height: v1 - v0 })) rubber.setAttribute(key, value);
      };
      const end = (last) => {
        this.svg.removeEventListener("pointermove", move);
        rubber.remove();
        const to = this.at(last);
        const small = Math.abs(to[0] - from[0]) < 0.01 * (this.view[1] - this.view[0]) || Math.abs(to[1] - from[1]) < 0.02 * (this.view[3] - this.view[2]);
        if (last.type === "pointerup" && !small) this.set([Math.min(from[0], to[0]), Math.max(from[0], to[0]), Math.min(from[1], to[1]), Math.max(from[1], to[1])]);
      };
      this.svg.addEventListener("pointermove", move);
      this.svg.addEventListener("pointerup", end, { once: true });
      this.svg.addEventListener("pointercancel", end, { once: true });
    }

    scale(factor, about) {
      const [x0, x1, y0, y1] = this.view;
      const [x, y] = about ?? [(x0 + x1) / 2, (y0 + y1) / 2];
      this.set([x + (x0 - x) * factor, x + (x1 - x) * factor, y + (y0 - y) * factor, y + (y1 - y) * factor]);
    }

    move(across, up) {
      const [x0, x1, y0, y1] = this.view;
      const dx = across * (x1 - x0);
      const dy = up * (y1 - y0);
      this.set([x0 + dx, x1 + dx, y0 + dy, y1 + dy]);
    }

    units(x, y) {
      const [x0, x1, y0, y1] = this.all;
      return [UNITS * (x - x0) / (x1 - x0), UNITS * (y1 - y) / (y1 - y0)];
    }

    set(view) {
      const whole = [this.all[1] - this.all[0], this.all[3] - this.all[2]];
      const shown = [view[1] - view[0], view[3] - view[2]];
      if (shown[0] < 1e-4 * whole[0] || shown[1] < 1e-4 * whole[1] || shown[0] > 20 * whole[0]) return;
      this.view = [...view];
      const [u0, v0] = this.units(view[0], view[3]);
      const [u1, v1] = this.units(view[1], view[2]);
      this.data.setAttribute("viewBox", `${u0} ${v0} ${u1 - u0} ${v1 - v0}`);
      this.draw();
    }

    draw() {
      const [left, top, width, height] = this.inner;
      const [x0, x1, y0, y1] = this.view;
      const parts = [];
      for (const value of ticks(x0, x1, 9)) {
        const at = left + (value - x0) / (x1 - x0) * width;
        parts.push(make("path", { class: "grid", d: `M${at} ${top}v${height}` }));
        parts.push(make("text", { x: at, y: top + height + 16, "text-anchor": "middle" }, word(value)));
      }
      for (const value of ticks(y0, y1, 6)) {
        const at = top + (y1 - value) / (y1 - y0) * height;
        parts.push(make("path", { class: "grid", d: `M${left} ${at}h${width}` }));
        parts.push(make("text", { x: left - 6, y: at + 4, "text-anchor": "end" }, word(value)));
      }
      for (const [place, name] of this.marks) {
        if (place < x0 || place > x1) continue;
        parts.push(make("text", { class: "mark", x: left + (place - x0) / (x1 - x0) * width, y: top - 5, "text-anchor": "middle" }, name));
      }
      this.axes.replaceChildren(...parts);
    }
  }

  window.impidPlots = [...document.querySelectorAll("figure.plot")].map((figure) => new Zoom(figure));
  // What is folded on the screen belongs on paper.
  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((one) => { one.open = true; }));
})();
