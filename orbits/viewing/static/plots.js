// Energy and angular momentum along the run: their relative changes on a logarithmic scale.

import { element, raised } from "./words.js";

const FLOOR = 2.5e-17, ROUNDING = 2 ** -53;

export class Plots {
  constructor(run, seek) {
    this.run = run;
    this.root = element("div", { class: "plots" });
    this.each = run.conserved.map((kept) => {
      const canvas = element("canvas", { role: "img" }), cursor = element("div", { class: "cursor" });
      const box = element("div", { class: "plot" }, canvas, cursor), value = element("output");
      const words = kept.name === "energy" ? "energy, |ΔE/E|" : "angular momentum, |ΔL|/|L|";
      box.addEventListener("pointerdown", (event) => {
        const bounds = canvas.getBoundingClientRect(), x = (event.clientX - bounds.left - this.left) / (bounds.width - this.left);
        seek(run.start + Math.max(0, Math.min(1, x)) * (run.end - run.start));
      });
      this.root.append(element("figure", {}, element("figcaption", {}, element("span", { text: words }), value), box));
      return { kept, canvas, cursor, value, words };
    });
    this.left = 34;
    if (!this.each.length)
      this.root.append(element("p", { class: "note", text: "No energy or angular momentum is conserved in this run." }));
  }

  draw(colours) {
    for (const { kept, canvas, words } of this.each) {
      const width = canvas.clientWidth, height = canvas.clientHeight, pixels = window.devicePixelRatio || 1;
      if (!width) continue;
      canvas.width = width * pixels;
      canvas.height = height * pixels;
      const context = canvas.getContext("2d"), { run, left } = this;
      context.setTransform(pixels, 0, 0, pixels, 0, 0);
      const values = kept.change.map((x) => Math.max(x, FLOOR)).filter((x) => Number.isFinite(x));
      let low = 1, high = FLOOR;
      for (const x of values) { if (x < low) low = x; if (x > high) high = x; }
      canvas.setAttribute("aria-label", `${words}: at most ${high.toExponential(1)}`);
      const from = Math.floor(Math.log10(Math.min(low, 1e-16))), to = Math.ceil(Math.log10(Math.max(high, 1e-15)));
      const y = (x) => 5 + (height - 10) * (1 - (Math.log10(x) - from) / (to - from));
      const along = (t) => left + (width - left - 2) * (t - run.start) / ((run.end - run.start) || 1);
      context.font = "10px system-ui, sans-serif";
      context.textAlign = "right";
      context.textBaseline = "middle";
      const every = Math.max(1, Math.ceil((to - from) / 3));
      for (let power = from; power <= to; power += every) {
        context.strokeStyle = colours.faint;
        context.beginPath(); context.moveTo(left, y(10 ** power)); context.lineTo(width, y(10 ** power)); context.stroke();
        context.fillStyle = colours.soft;
        context.fillText(`10${raised(power)}`, left - 5, y(10 ** power));
      }
      context.strokeStyle = colours.soft;
      context.setLineDash([4, 4]);
      context.beginPath(); context.moveTo(left, y(ROUNDING)); context.lineTo(width, y(ROUNDING)); context.stroke();
      context.setLineDash([]);
      context.strokeStyle = colours.accent;
      context.lineJoin = "round";
      context.fillStyle = colours.accent;
      context.globalAlpha = 0.4;
      const dots = new Path2D(), dot = kept.change.length < width ? 1.1 : 0.8;
      context.beginPath();
      const stride = Math.max(1, Math.floor(kept.change.length / (4 * width)));
      for (let k = 0; k < kept.change.length; k += stride) {
        let most = FLOOR; // the largest of a few, so that peaks stay
        for (let n = k; n < Math.min(k + stride, kept.change.length); n++) most = Math.max(most, kept.change[n] || 0);
        const across = along(run.times[k]), up = y(most);
        if (k) context.lineTo(across, up); else context.moveTo(across, up);
        dots.rect(across - dot, up - dot, 2 * dot, 2 * dot);
      }
      context.lineWidth = 0.7;
      context.stroke();
      context.globalAlpha = 1;
      context.fill(dots);
    }
  }

  at(time) {
    const { run } = this, part = (time - run.start) / ((run.end - run.start) || 1), [k, s] = run.locate(time);
    for (const { kept, canvas, cursor, value } of this.each) {
      cursor.style.transform = `translateX(${this.left + (canvas.clientWidth - this.left - 2) * part}px)`;
      const now = kept.change[Math.min(k + (s === 1 ? 1 : 0), run.length - 1)];
      const text = now === 0 ? "0" : now.toExponential(1).replace(/e(.*)/, (_, p) => ` × 10${raised(Number(p))}`);
      if (value.textContent !== text) value.textContent = text;
    }
  }
}
