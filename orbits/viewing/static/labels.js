// The names of bodies beside them, as many as do not cover each other, and the ring about the body that is picked.

import { css } from "./palette.js";
import { element } from "./words.js";

const MOST = 60, TALL = 15, WIDE = 6.4;

export class Labels {
  constructor(run, stage, pick) {
    this.run = run;
    this.made = run.header.bodies.names.slice(0, MOST).map((name, body) => {
      const label = element("button", { type: "button", tabindex: "-1", class: "name", text: name, onclick: () => pick(body) });
      return { label, wide: name.length * WIDE + 6 };
    });
    this.ring = element("div", { class: "ring", hidden: true });
    this.tag = element("span", { class: "name tag" });
    this.ring.append(this.tag);
    stage.append(...this.made.map((one) => one.label), this.ring);
  }

  draw(sky, shift, picked, on, colourOf, plain) {
    const { run } = this, taken = [];
    const placed = (body) => {
      const place = body < run.count ? run.places.subarray(3 * body, 3 * body + 3) : run.placeOf(body);
      return place[0] === place[0] ? sky.onScreen(place[0] - shift[0], place[1] - shift[1], place[2] - shift[2]) : null;
    };
    const at = picked >= 0 ? placed(picked) : null;
    if (at) taken.push([at[0] - 11, at[1] - TALL / 2, 30 + run.names[picked].length * (WIDE + 0.8)]);
    this.made.forEach(({ label, wide }, body) => {
      const here = on && body !== picked ? placed(body) : null, x = here && here[0] + 9, y = here && here[1] - TALL / 2;
      const free = here && x > 0 && y > 0 && x < sky.width && y < sky.height &&
        !taken.some((t) => x < t[0] + t[2] && t[0] < x + wide && Math.abs(y - t[1]) < TALL);
      label.style.visibility = free ? "visible" : "hidden";
      if (!free) return;
      taken.push([x, y, wide]);
      label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      label.style.color = plain ? "" : css(colourOf(body));
    });
    this.ring.hidden = !at;
    if (!at) return;
    this.ring.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
    if (this.tag.textContent !== run.names[picked]) this.tag.textContent = run.names[picked];
  }
}
