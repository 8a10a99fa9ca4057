// The view of a run in an element of a page: everything that is shown, and what keys and clicks do.

import { Run } from "./run.js";
import { Sky } from "./sky.js";
import { Flat } from "./flat.js";
import { elements } from "./kepler.js";
import { Labels } from "./labels.js";
import { Panel, MODES, keysDialog } from "./panel.js";
import { Plots } from "./plots.js";
import { Timeline } from "./timeline.js";
import { inScale, legible, scale } from "./palette.js";
import { element, figure, withUnit } from "./words.js";

const PICK_PIXELS = 14, PATHS = ["orbits", "trails", "none"];

export class View {
  constructor(root, data) {
    this.root = root;
    const header = data.header, run = new Run(header, data.chunk);
    this.run = run;
    header.span = header.span || run.end - run.start;
    this.still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const darkness = matchMedia("(prefers-color-scheme: light)");
    this.dark = !darkness.matches;
    darkness.addEventListener("change", () => this.setTheme(!darkness.matches));
    this.look = { still: this.still };
    this.time = run.start;
    this.playing = false;
    this.picked = -1;
    this.focus = header.focus;
    this.modeName = "none";
    this.range = [0, 1];
    this.pathsName = "orbits";
    this.trailPart = 0.5;
    this.labelsOn = true;
    this.dirty = true;
    this.stats = { frames: 0, total: 0, worst: 0 };
    this.build();
    this.speed = this.timeline.usualSpeed();
    this.setTheme(this.dark);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.stage);
    this.resize();
    this.sky.fit();
    this.seek(run.start);
    this.setTrail(header.focus < 0 ? 0.8 : 0.5);
    this.frame = this.frame.bind(this);
    this.request = requestAnimationFrame(this.frame);
  }

  build() {
    const { run } = this, { header } = run, root = this.root;
    root.replaceChildren();
    root.tabIndex = -1;
    this.canvas = element("canvas", { class: "sky", tabindex: "0", role: "application", "aria-label": `${header.title}, in three dimensions. Space plays, question mark lists the keys.` });
    this.stage = element("div", { class: "stage" }, this.canvas);
    this.notice = element("p", { class: "notice", role: "status", hidden: true });
    const to = {
      seek: (time) => { this.pause(); this.seek(time); }, play: () => this.toggle(), sample: (n) => this.stepSample(n),
      speed: (f) => this.setSpeed(this.speed * f), pick: (body) => this.pick(body), focus: (body) => this.setFocus(body),
      mode: (name) => this.setMode(name), paths: (name) => this.setPaths(name), trail: (part) => this.setTrail(part),
    };
    this.labels = new Labels(run, this.stage, to.pick);
    this.timeline = new Timeline(run, to);
    this.panel = new Panel(run, to);
    this.plots = new Plots(run, to.seek);
    this.badge = element("span", { class: "badge", hidden: true });
    this.title = element("div", { class: "title" }, element("h1", { text: header.title }),
      element("p", {}, element("span", { text: header.made_by }), this.badge));
    this.ruler = element("div", { class: "ruler", "aria-hidden": "true" }, element("i"), element("span"));
    this.keys = keysDialog(() => this.showKeys(false));
    const tool = (label, text, act) => element("button", { type: "button", title: label, "aria-label": label, text, onclick: act });
    this.more = tool("panel", "☰", () => { root.classList.toggle("open"); this.resize(); });
    this.more.classList.add("more");
    this.tools = element("div", { class: "tools" }, tool("fit the whole run (F)", "⤢", () => this.fit()),
      tool("light or dark (T)", "◐", () => this.setTheme(!this.dark)), tool("keys (?)", "?", () => this.showKeys(true)), this.more);
    this.side = element("aside", { class: "panel", "aria-label": "settings and bodies" }, this.panel.root, this.plots.root);
    root.append(this.stage, this.title, this.tools, this.side, this.ruler, this.timeline.root, this.keys, this.notice);
    try {
      this.sky = new Sky(this.canvas, run, this.look);
      this.canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.say("The graphics processor gave up this page; reload it."); });
      this.canvas.addEventListener("webglcontextrestored", () => this.say(this.standing));
    } catch (error) {
      const flat = element("canvas", { class: "sky flat", tabindex: "0", role: "img", "aria-label": `${header.title}, from above` });
      this.canvas.replaceWith(flat);
      this.canvas = flat;
      this.sky = new Flat(flat, run, this.look);
      this.standing = "This browser has no WebGL: here is the picture from above, with the slider and the elements, but without the third dimension.";
    }
    this.standing = [this.standing, header.said].filter(Boolean).join(" "); // what is said as long as nothing else is
    this.say(this.standing);
    this.listen();
  }

  say(text) {
    this.notice.textContent = text;
    this.notice.hidden = !text;
  }

  listen() {
    let down = null;
    this.canvas.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; this.dirty = true; });
    this.canvas.addEventListener("pointermove", () => { this.dirty = true; });
    this.canvas.addEventListener("wheel", () => { this.dirty = true; }, { passive: true });
    this.canvas.addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5) {
        const box = this.canvas.getBoundingClientRect();
        this.pick(this.nearest(event.clientX - box.left, event.clientY - box.top));
      }
      down = null;
    });
    this.onKey = (event) => this.key(event);
    this.root.addEventListener("keydown", this.onKey);
    if (this.root.classList.contains("orbits-page"))
      document.addEventListener("keydown", (event) => { if (event.target === document.body) this.key(event); });
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const typing = event.target.matches && event.target.matches("input[type=search], select");
    if (typing && event.key !== "Escape") return;
    const onButton = event.target.matches && event.target.matches("button");
    if (onButton && (event.key === " " || event.key === "Enter")) return;
    const turn = 0.12, many = event.shiftKey ? 10 : 1;
    const does = {
      " ": () => this.toggle(), ArrowLeft: () => this.stepSample(-many), ArrowRight: () => this.stepSample(many),
      Home: () => this.jump(0), End: () => this.jump(this.run.length - 1),
      ArrowUp: () => this.setSpeed(this.speed * 2), ArrowDown: () => this.setSpeed(this.speed / 2),
      a: () => this.sky.turn(-turn, 0), d: () => this.sky.turn(turn, 0), w: () => this.sky.turn(0, turn), s: () => this.sky.turn(0, -turn),
      "+": () => this.sky.zoom(0.85), "=": () => this.sky.zoom(0.85), "-": () => this.sky.zoom(1 / 0.85),
      f: () => this.fit(), n: () => this.pickNext(1), p: () => this.pickNext(-1),
      Enter: () => { if (this.picked >= 0) this.setFocus(this.picked); },
      Escape: () => { if (!this.keys.hidden) this.showKeys(false); else this.pick(-1); },
      c: () => this.nextMode(), o: () => this.setPaths(PATHS[(PATHS.indexOf(this.pathsName) + 1) % 3]),
      l: () => { this.labelsOn = !this.labelsOn; this.dirty = true; }, t: () => this.setTheme(!this.dark),
      "?": () => this.showKeys(this.keys.hidden),
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!does) return;
    event.preventDefault();
    event.stopPropagation(); // a notebook has keys of its own
    does();
    this.dirty = true;
  }

  showKeys(on) {
    this.keys.hidden = !on;
    if (on) this.keys.querySelector("button").focus(); else this.canvas.focus({ preventScroll: true });
  }

  setTheme(dark) {
    this.dark = dark;
    this.root.dataset.theme = dark ? "dark" : "light";
    this.stops = scale(dark);
    Object.assign(this.look, { dark, points: dark ? [0.72, 0.78, 0.88] : [0.25, 0.30, 0.40], pick: dark ? [1, 1, 1] : [0.05, 0.07, 0.12] });
    this.colours = this.run.header.bodies.colours.map((hex) => legible(hex, dark));
    this.setMode(this.modeName);
    const style = getComputedStyle(this.root), read = (name) => style.getPropertyValue(name).trim();
    this.plotColours = { faint: read("--faint"), soft: read("--soft"), accent: read("--accent") };
    this.plots.draw(this.plotColours);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (!width || !height) return;
    const small = width <= 760, open = small && this.root.classList.contains("open");
    const free = small ? { right: 0, top: 56, bottom: open ? 126 + 0.42 * height : 126 } : { right: 322, top: 20, bottom: 100 };
    this.sky.resize(width, height, Math.min(window.devicePixelRatio || 1, 2), free);
    this.plots.draw(this.plotColours);
    this.dirty = true;
  }

  toggle() {
    if (this.playing) { this.pause(); return; }
    if (this.time === this.run.end) this.seek(this.run.start);
    this.playing = true;
    this.last = undefined;
  }

  pause() { this.playing = false; this.dirty = true; }

  seek(time) {
    const [low, high] = [Math.min(this.run.start, this.run.end), Math.max(this.run.start, this.run.end)];
    this.time = Math.max(low, Math.min(high, time));
    this.run.seek(this.time);
    this.dirty = true;
  }

  jump(k) { this.pause(); this.seek(this.run.times[Math.max(0, Math.min(this.run.length - 1, k))]); }

  stepSample(n) {
    const [k, s] = this.run.locate(this.time), here = s === 1 ? k + 1 : k;
    this.jump(n > 0 ? here + n : (s > 0 && s < 1 ? here + 1 : here) + n);
  }

  setSpeed(speed) {
    const span = Math.abs(this.run.header.span) || 1;
    this.speed = Math.max(span / 1e6, Math.min(span * 2, speed));
    this.dirty = true;
  }

  setFocus(body) {
    this.focus = body;
    if (body < this.run.count) this.panel.focus.value = String(body);
    const near = this.reachAbout(body);
    if (near) this.sky.fit(near);
    this.shown = 0;
    this.dirty = true;
  }

  // The farthest orbit about a body, if any moves about it; null for others.
  reachAbout(body) {
    if (body <= 0) return this.sky.extent;
    const { run } = this, found = [];
    run.header.bodies.centre.forEach((centre, k) => {
      if (centre === body) found.push(Math.hypot(...run.states.subarray(6 * k, 6 * k + 3)));
    });
    return found.length ? 1.3 * Math.max(...found) : null;
  }

  fit() { this.setFocus(this.run.header.focus); this.sky.fit(); }

  pick(body) {
    this.picked = body;
    if (body >= 0 && !this.root.classList.contains("open")) { this.root.classList.add("open"); this.resize(); }
    this.shown = 0;
    this.dirty = true;
  }

  pickNext(step) {
    const n = this.run.names.length;
    this.pick(this.picked < 0 ? (step > 0 ? 0 : n - 1) : (this.picked + step + n) % n);
  }

  setPaths(name) {
    this.pathsName = name;
    this.panel.paths.value = name;
    this.setTrail(this.trailPart);
  }

  // The slider of the trails goes from a thousandth to the whole of the run.
  setTrail(part) {
    this.trailPart = part;
    this.trail = Math.abs(this.run.header.span) * 10 ** (3 * part - 3);
    this.panel.showTrail(this.trail, this.pathsName === "trails");
    this.dirty = true;
  }

  nextMode() {
    const names = MODES.map((mode) => mode.name).filter((name) => this.panel.offered(name));
    this.setMode(names[(names.indexOf(this.modeName) + 1) % names.length]);
  }

  setMode(name) {
    if (name !== this.modeName || !this.rangeKnown) this.range = this.rangeOf(name);
    this.rangeKnown = true;
    this.modeName = name;
    this.panel.showLegend(name, this.range, this.stops);
    this.dirty = true;
  }

  // What a body or point is coloured by, at the time that is shown; NaN without an orbit.
  valueOf(name, body) {
    const { run } = this;
    if (name === "error") { const bars = run.errors[run.before]; return bars ? bars[body] : NaN; }
    const [, gm] = run.centreOf(body);
    const el = elements(run.stateOf(body), 0, gm);
    if (!el) return NaN;
    if (name === "change") return el.e < 1 ? el.a / this.firstSize(body) - 1 : NaN;
    return name === "a" && !(el.e < 1) ? NaN : el[name];
  }

  firstSize(body) {
    this.sizes = this.sizes || new Map();
    if (!this.sizes.has(body)) {
      const { run } = this, state = new Float64Array(6), [, gm] = run.centreOf(body);
      if (body < run.count) run.relative(state, 0, body, 0, 0); else run.point(state, 0, body - run.count, 0, 0);
      const el = elements(state, 0, gm);
      this.sizes.set(body, el ? el.a : NaN);
    }
    return this.sizes.get(body);
  }

  // The range of the colours: nearly all values, of the points where there are many.
  rangeOf(name) {
    const { run } = this;
    if (name === "none") return [0, 1];
    if (name === "change") return [-0.01, 0.01];
    if (name === "e") return [0, this.quantile(name, 0.97, 0.05)];
    if (name === "i") return [0, this.quantile(name, 0.97, 1)];
    const low = this.quantile(name, 0.02, 0), high = this.quantile(name, 0.98, 0);
    return high > low ? [low, high] : [low - 0.5 * Math.abs(low || 1), low + 0.5 * Math.abs(low || 1)];
  }

  quantile(name, part, least) {
    const { run } = this, values = [], first = run.light > 50 ? run.count : 0, stride = Math.max(1, Math.floor(run.light / 3000));
    for (let k = first; k < run.names.length; k += stride) {
      const x = this.valueOf(name, k);
      if (x === x) values.push(x);
    }
    values.sort((a, b) => a - b);
    return Math.max(least, values[Math.round(part * (values.length - 1))] || 0);
  }

  colourOf(body) {
    if (this.modeName === "none") return body < this.run.count ? this.colours[body] : this.look.points;
    if (body === 0 && this.run.header.focus === 0 && this.modeName !== "error") return this.colours[0];
    const x = this.valueOf(this.modeName, body);
    return x === x ? inScale(this.stops, (x - this.range[0]) / (this.range[1] - this.range[0])) : this.look.points;
  }

  // The body or point that is nearest to a place on the screen; bodies go before points.
  nearest(x, y) {
    const { run, sky } = this, shift = run.placeOf(this.focus);
    let best = -1, least = PICK_PIXELS;
    for (let k = 0; k < run.count; k++) {
      const at = sky.onScreen(...[0, 1, 2].map((j) => run.places[3 * k + j] - shift[j]));
      const away = at ? Math.hypot(at[0] - x, at[1] - y) - 3 : Infinity;
      if (away < least) { least = away; best = k; }
    }
    if (best >= 0) return best;
    const state = new Float64Array(6);
    for (let i = 0; i < run.light; i++) {
      run.point(state, 0, i, run.before, run.fraction);
      if (state[0] !== state[0]) continue;
      const at = sky.onScreen(...[0, 1, 2].map((j) => state[j] + run.places[j] - shift[j]));
      const away = at ? Math.hypot(at[0] - x, at[1] - y) : Infinity;
      if (away < least) { least = away; best = run.count + i; }
    }
    return best;
  }

  // Take further samples of a run that grows; a view at its end stays there.
  grow(chunk) {
    const atEnd = this.time === this.run.end && this.run.length > 1, grown = this.run.add(chunk);
    if (grown) {
      this.timeline.grown();
      this.plots.draw(this.plotColours);
      this.seek(atEnd && !this.playing ? this.run.end : this.time);
    }
    this.shown = 0;
    this.dirty = true;
  }

  // Take the closest approaches, which take the server a while.
  learn(approaches) {
    this.run.approaches = approaches;
    this.shown = 0;
    this.dirty = true;
  }

  showBadge(text) {
    this.badge.textContent = text;
    this.badge.hidden = !text;
  }

  frame(now) {
    this.request = requestAnimationFrame(this.frame);
    const begun = performance.now();
    if (this.playing) {
      const passed = this.last === undefined ? 0 : Math.min(0.1, (now - this.last) / 1000);
      this.last = now;
      const { run } = this, next = this.time + run.direction * this.speed * passed;
      const over = run.direction * (next - run.end) >= 0;
      this.seek(over ? run.end : next);
      if (over && run.complete) this.pause();
    }
    if (!this.dirty) return;
    const worked = this.playing;
    this.draw(now);
    const took = performance.now() - begun;
    if (worked) { this.stats.frames += 1; this.stats.total += took; this.stats.worst = Math.max(this.stats.worst, took); }
  }

  draw(now) {
    const { run } = this;
    this.dirty = false;
    this.sky.update({
      focus: this.focus, paths: this.pathsName, trail: this.trail, picked: this.picked, time: this.time, range: this.range,
      stops: this.stops, mode: MODES.findIndex((mode) => mode.name === this.modeName), colourOf: (body) => this.colourOf(body),
    });
    if (this.sky.render()) this.dirty = true;
    const shift = run.placeOf(this.focus);
    this.labels.draw(this.sky, shift, this.picked, this.labelsOn, (body) => this.colourOf(body), this.modeName !== "none");
    this.timeline.at(this.time, this.playing, this.speed);
    this.plots.at(this.time);
    if (!this.shown || now - this.shown > 120 || !this.playing) {
      this.shown = now || 1;
      this.panel.show(this.picked, this.focus);
      this.panel.colour((body) => this.colourOf(body), this.picked);
      this.showRuler();
    }
  }

  showRuler() {
    const scaleOf = this.sky.pixelsPerLength(), wanted = 110 / scaleOf, power = 10 ** Math.floor(Math.log10(wanted));
    const length = (wanted / power >= 5 ? 5 : wanted / power >= 2 ? 2 : 1) * power;
    this.ruler.firstChild.style.width = `${length * scaleOf}px`;
    const text = withUnit(figure(length, 1), this.run.header.units.length);
    if (this.ruler.lastChild.textContent !== text) this.ruler.lastChild.textContent = text;
  }

  dispose() {
    cancelAnimationFrame(this.request);
    this.observer.disconnect();
    this.sky.dispose();
    this.root.replaceChildren();
  }
}
