// The panel: colours and paths, the bodies, what is known of a body that is picked, and the keys.

import { elements } from "./kepler.js";
import { css, inScale } from "./palette.js";
import { elapsed, element, figure, when, withUnit } from "./words.js";

export const MODES = [
  { name: "none", label: "body" },
  { name: "a", label: "semi-major axis a" },
  { name: "e", label: "eccentricity e" },
  { name: "i", label: "inclination i" },
  { name: "change", label: "change of a since the start" },
  { name: "error", label: "error estimate" },
];

const KEYS = [
  ["space", "play, pause"], ["← →", "sample before, after"], ["Home End", "first, last sample"], ["↑ ↓", "faster, slower"],
  ["W A S D", "turn the view"], ["+ −", "nearer, farther"], ["F", "fit the whole run"], ["N P", "next, previous body"],
  ["Enter", "centre on the body"], ["Esc", "let go of the body"], ["C", "next colouring"], ["O", "orbits, trails, nothing"],
  ["L", "names"], ["T", "light, dark"], ["?", "these keys"],
];

function chooser(label, options, act) {
  const select = element("select", { "aria-label": label });
  for (const [value, text] of options) select.append(element("option", { value, text }));
  select.addEventListener("change", () => act(select.value));
  return [element("label", {}, element("span", { text: label }), select), select];
}

export class Panel {
  // to : { mode(name), paths(name), trail(part), labels(on), pick(body), focus(body), fit() }
  constructor(run, to) {
    this.run = run;
    this.to = to;
    const modes = MODES.filter((mode) => this.offered(mode.name)).map((mode) => [mode.name, mode.label]);
    const [modeRow, mode] = chooser("colour", modes, (value) => to.mode(value));
    const [pathRow, paths] = chooser("paths", [["orbits", "osculating orbits"], ["trails", "trails"], ["none", "none"]], (value) => to.paths(value));
    const [focusRow, focus] = chooser("centre", [...run.header.bodies.names.slice(0, 60).map((name, k) => [k, name]), [-1, "the origin"]], (value) => to.focus(Number(value)));
    this.mode = mode; this.paths = paths; this.focus = focus;
    focus.value = String(run.header.focus);
    const part = element("input", { type: "range", min: 0, max: 1, step: 0.01, value: run.header.focus < 0 ? 0.8 : 0.5, "aria-label": "length of the trails" });
    part.addEventListener("input", () => to.trail(Number(part.value)));
    this.trailSaid = element("output");
    this.trail = element("label", { class: "trail" }, element("span", { text: "trail" }), part, this.trailSaid);
    this.legend = element("div", { class: "legend" });
    this.find = element("input", { type: "search", list: "", placeholder: run.names.length > 1 ? `find one of ${run.names.length.toLocaleString("en")} bodies` : "find the body", "aria-label": "find a body" });
    this.found = element("div", { class: "found" });
    this.find.addEventListener("input", () => this.search());
    this.picked = element("section", { class: "picked", "aria-live": "polite" });
    this.root = element("div", { class: "panel-inside" }, this.picked,
      element("section", { class: "settings" }, modeRow, this.legend, pathRow, this.trail, focusRow),
      element("section", { class: "finder" }, this.find, this.found));
    this.showList();
  }

  offered(mode) {
    const { header } = this.run;
    if (mode === "none") return true;
    if (mode === "error") return header.has_error;
    return header.points.two_body_gm > 0 || header.bodies.two_body_gm.some((gm) => gm > 0);
  }

  search() {
    const text = this.find.value.trim().toLowerCase();
    if (!text) { this.showList(); return; }
    const hits = [];
    for (let k = 0; k < this.run.names.length && hits.length < 12; k++)
      if (this.run.names[k].toLowerCase().includes(text)) hits.push(k);
    this.list(hits, hits.length ? "" : "no body has this in its name");
  }

  showList() {
    const some = Math.min(this.run.count, 24), hidden = this.run.names.length - some;
    this.list(Array.from({ length: some }, (_, k) => k), hidden ? `and ${hidden.toLocaleString("en")} more, by name` : "");
  }

  list(bodies, note) {
    this.listed = bodies.map((body) => {
      const dot = element("i"), made = element("button", { type: "button", onclick: () => this.to.pick(body) }, dot, element("span", { text: this.run.names[body] }));
      return { body, made, dot };
    });
    this.found.replaceChildren(...this.listed.map((one) => one.made), ...(note ? [element("p", { class: "note", text: note })] : []));
    this.coloured = null;
  }

  colour(colourOf, picked) {
    for (const { body, made, dot } of this.listed) {
      dot.style.background = css(colourOf(body));
      made.classList.toggle("chosen", body === picked);
    }
  }

  showLegend(name, range, stops) {
    const mode = MODES.find((one) => one.name === name), { units } = this.run.header;
    this.mode.value = name;
    if (name === "none") { this.legend.replaceChildren(); return; }
    const unit = { a: units.length, i: "°", change: "%", error: units.length }[name] || "";
    const factor = name === "change" ? 100 : 1, said = (x) => withUnit(figure(x * factor, 3), unit);
    const bar = element("div", { class: "bar" });
    bar.style.background = `linear-gradient(90deg, ${Array.from({ length: 17 }, (_, k) => css(inScale(stops, k / 16))).join(", ")})`;
    this.legend.replaceChildren(bar, element("div", { class: "ends" },
      element("span", { text: said(range[0]) }), element("span", { text: mode.label }), element("span", { text: said(range[1]) })));
  }

  showTrail(time, visible) {
    this.trail.hidden = !visible;
    this.trailSaid.textContent = elapsed(this.run.header, time, 1);
  }

  // Show what is known of the picked body now.
  show(picked, focus) {
    if (picked < 0) {
      if (this.of !== -1) this.picked.replaceChildren();
      this.picked.hidden = true;
      this.of = -1;
      return;
    }
    this.picked.hidden = false;
    const { run } = this, { header } = run, [centre, gm] = run.centreOf(picked);
    if (this.of !== picked || this.focused !== focus || this.knew !== run.approaches) this.begin(picked, focus, centre);
    const state = run.stateOf(picked), el = elements(state, 0, gm), length = header.units.length;
    const days = header.units.days, period = el && el.period;
    const rows = state[0] !== state[0] ? [["", "gone: merged, or retired"]] : [];
    if (el) {
      rows.push(["a", withUnit(figure(el.a, 7), length)], ["e", figure(el.e, 5)], ["i", `${el.i.toFixed(4)}°`],
        ["Ω", `${el.Omega.toFixed(4)}°`], ["ω", `${el.omega.toFixed(4)}°`], ["M", `${figure(el.M, Math.abs(el.M) < 100 ? 6 : 7)}°`]);
      if (period === period)
        rows.push(["P", days === null ? figure(period, 6) : period * days > 1000 ? `${figure(period * days / 365.25, 6)} yr` : `${figure(period * days, 6)} d`]);
    }
    if (!rows.length || el) {
      const { speed } = header.units;
      rows.push(["r", withUnit(figure(Math.hypot(state[0], state[1], state[2]), 6), length)]);
      rows.push(["v", withUnit(figure(Math.hypot(state[3], state[4], state[5]) * speed.factor, 5), speed.name)]);
    }
    const bars = run.errors[run.before];
    if (bars) rows.push(["±", withUnit(figure(bars[picked], 2), length)]);
    const texts = rows.flat();
    if (this.cells.length !== texts.length) {
      this.cells = texts.map((_, k) => element(k % 2 ? "dd" : "dt"));
      this.values.replaceChildren(...this.cells);
    }
    texts.forEach((text, k) => { if (this.cells[k].textContent !== text) this.cells[k].textContent = text; });
  }

  begin(picked, focus, centre) {
    const { run } = this, name = run.names[picked];
    this.of = picked; this.focused = focus; this.knew = run.approaches;
    this.cells = [];
    this.values = element("dl", { class: "elements" });
    const [, gm] = run.centreOf(picked), to = centre < 0 ? "the centre of mass" : run.header.bodies.in_prose[centre];
    const about = gm > 0 ? `osculating, about ${to} · ${run.header.frame}` : run.header.frame;
    const head = element("header", {}, element("h2", { text: name }),
      element("button", { type: "button", text: focus === picked ? "centred" : "centre on it", disabled: focus === picked, onclick: () => this.to.focus(picked) }),
      element("button", { type: "button", class: "close", "aria-label": "let go of the body (Esc)", text: "×", onclick: () => this.to.pick(-1) }));
    this.picked.replaceChildren(head, element("p", { class: "note", text: about }), this.values, ...this.approaches(picked));
  }

  approaches(picked) {
    const { run } = this, { units } = run.header, head = element("h3", { text: "closest approaches" });
    if (!run.approaches) return [head, element("p", { class: "note",  text: run.complete || run.ended ? "being computed …" : "known when the run is complete" })];
    const mine = run.approaches.list.filter((row) => row[0] === picked || row[1] === picked).slice(0, 5);
    const none = run.approaches.why || "none within the reach of a body", { said } = run.approaches;
    if (!mine.length) return [head, element("p", { class: "note", text: none })];
    return [head, element("ul", { class: "approaches" }, ...mine.map(([a, b, time, distance, speed]) => element("li", {},
      element("button", { type: "button", onclick: () => this.to.seek(time), title: `${when(run.header, time, true)}, at ${withUnit(figure(speed * units.speed.factor, 4), units.speed.name)}` },
        element("span", { text: run.names[a === picked ? b : a] }),
        element("span", { text: withUnit(figure(distance, 5), units.length) }),
        element("time", { text: when(run.header, time) }))))), ...said ? [element("p", { class: "note", text: said })] : []];
  }
}

export function keysDialog(close) {
  const rows = KEYS.flatMap(([key, what]) => [element("dt", {}, ...key.split(" ").map((one) => element("kbd", { text: one }))), element("dd", { text: what })]);
  const button = element("button", { type: "button", text: "close", onclick: close });
  return element("div", { class: "keys", role: "dialog", "aria-modal": "true", "aria-label": "keys", hidden: true },
    element("h2", { text: "Keys" }), element("dl", {}, ...rows),
    element("p", { class: "note", text: "Drag to turn, scroll or pinch to zoom, click a body for its elements. Between samples, bodies follow two-body orbits that fit both samples, or cubics where the motion is not nearly of two bodies." }),
    button);
}
