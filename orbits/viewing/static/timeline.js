// The time line: play, speed, a slider with the events of the run, the date.

import { elapsed, element, when } from "./words.js";

const WHOLE_RUN_SECONDS = 60, CROWD = 150; // so many marks would be one bar
const ICONS = {
  play: "M7 4.5v15l12-7.5z", pause: "M6 4.5h4v15H6zM14 4.5h4v15h-4z", back: "M17 5v14L7 12zM5 5h2v14H5z",
  on: "M7 5v14l10-7zM17 5h2v14h-2z",
};

export function icon(path) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
  line.setAttribute("d", path);
  svg.append(line);
  return svg;
}

export class Timeline {
  // to : { seek(time), play(), sample(steps), speed(factor), pick(body) }
  constructor(run, to) {
    this.run = run;
    this.to = to;
    const button = (label, path, act) => element("button", { type: "button", "aria-label": label, title: label, onclick: act }, icon(path));
    this.playing = button("Play (space)", ICONS.play, () => to.play());
    this.slider = element("input", { type: "range", step: "any", "aria-label": "time", class: "time" });
    this.slider.addEventListener("input", () => to.seek(Number(this.slider.value)));
    this.events = element("div", { class: "events", "aria-hidden": "true" });
    this.track = element("div", { class: "track" }, this.events, this.slider);
    this.date = element("output", { class: "date", "aria-live": "off" });
    this.where = element("span", { class: "where" });
    this.some = element("span", { class: "where some" });
    this.rate = element("output", { class: "rate" });
    this.tip = element("div", { class: "tip", hidden: true });
    this.root = element("div", { class: "timeline", role: "group", "aria-label": "time line" },
      this.tip,
      element("div", { class: "when" }, this.date, this.where, this.some),
      element("div", { class: "row" },
        element("div", { class: "buttons" },
          button("Sample before (left arrow)", ICONS.back, () => to.sample(-1)), this.playing,
          button("Sample after (right arrow)", ICONS.on, () => to.sample(1))),
        this.track,
        element("div", { class: "speed" },
          element("button", { type: "button", "aria-label": "slower (down arrow)", title: "Slower (down arrow)", text: "−", onclick: () => to.speed(0.5) }),
          this.rate,
          element("button", { type: "button", "aria-label": "faster (up arrow)", title: "Faster (up arrow)", text: "+", onclick: () => to.speed(2) }))));
    this.grown();
  }

  // The speed with which the whole run takes a minute, rounded to 1, 2 or 5, in the unit of time.
  usualSpeed() {
    const { factor } = this.run.header.units;
    const each = Math.abs(this.run.header.span) * factor / WHOLE_RUN_SECONDS || 1, power = 10 ** Math.floor(Math.log10(each));
    return (each / power < 1.5 ? 1 : each / power < 3.5 ? 2 : each / power < 7.5 ? 5 : 10) * power / factor;
  }

  // Take in further samples and events.
  grown() {
    const { run } = this, [low, high] = [Math.min(run.start, run.end), Math.max(run.start, run.end)];
    this.slider.min = String(low);
    this.slider.max = String(high);
    this.slider.style.direction = run.direction < 0 ? "rtl" : "ltr";
    const { list, count } = run.events;
    this.set(this.some, count > list.length ? `events: the first ${list.length.toLocaleString("en")} of ${count.toLocaleString("en")}` : "");
    this.events.classList.toggle("crowd", list.length > CROWD);
    this.events.replaceChildren(...list.map((event) => {
      const part = (event.time - run.start) / ((run.end - run.start) || 1);
      if (part < 0 || part > 1) return "";
      const mark = element("button", { type: "button", tabindex: "-1", class: `mark ${event.kind}`, title: this.said(event) });
      mark.style.left = `${100 * part}%`;
      mark.addEventListener("click", () => { this.to.seek(event.time); if (event.bodies.length) this.to.pick(event.bodies[0]); this.say(event); });
      return mark;
    }));
  }

  said(event) { return `${when(this.run.header, event.time, true)}: ${event.text}`; }

  say(event) {
    this.tip.textContent = this.said(event);
    this.tip.hidden = false;
    clearTimeout(this.tipEnds);
    this.tipEnds = setTimeout(() => { this.tip.hidden = true; }, 6000);
  }

  at(time, playing, speed) {
    const { run } = this, { header } = run, { units } = header;
    if (Number(this.slider.value) !== time) this.slider.value = String(time);
    this.slider.style.setProperty("--done", `${100 * (time - run.start) / ((run.end - run.start) || 1)}%`);
    const short = units.days !== null && Math.abs(run.end - run.start) * units.days < 2000;
    this.set(this.date, when(header, time, short));
    this.slider.setAttribute("aria-valuetext", this.date.textContent);
    const k = run.sampleAt(time), [before] = run.locate(time), dated = header.epoch !== null && header.units.days !== null;
    const place = k >= 0 ? `sample ${run.numbers[k] + 1}` : `between samples ${run.numbers[before] + 1} and ${run.numbers[Math.min(before + 1, run.length - 1)] + 1}`;
    this.set(this.where, `${dated ? `TDB · t = ${elapsed(header, time)} · ` : ""}${place} of ${header.total}`);
    const rate = Number((speed * units.factor).toPrecision(2));
    this.set(this.rate, `${rate}${units.shown ? ` ${units.shown}` : ""}/s`);
    const label = playing ? "Pause (space)" : "Play (space)";
    if (this.playing.title !== label) {
      this.playing.title = label;
      this.playing.setAttribute("aria-label", label);
      this.playing.replaceChildren(icon(playing ? ICONS.pause : ICONS.play));
    }
  }

  set(place, text) { if (place.textContent !== text) place.textContent = text; }
}
