// Without WebGL: a picture from above, on a two-dimensional canvas. It has the slider, and bodies can be picked.

import { css } from "./palette.js";
import { elements } from "./kepler.js";
import { extentOf } from "./sky.js";

export class Flat {
  constructor(canvas, run, look) {
    this.canvas = canvas;
    this.run = run;
    this.look = look;
    this.context = canvas.getContext("2d");
    this.extent = extentOf(run);
    this.scale = 1;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.scale *= Math.exp(-event.deltaY / 400);
      this.changed = true;
    }, { passive: false });
  }

  resize(width, height, pixels, free) {
    this.free = free;
    this.width = width; this.height = height; this.pixels = pixels;
    this.canvas.width = width * pixels;
    this.canvas.height = height * pixels;
  }

  fit(reach = this.extent) { this.scale = this.extent / reach; }
  zoom(factor) { this.scale /= factor; }
  turn() {}

  update(state) { this.state = state; this.shift = this.run.placeOf(state.focus); this.changed = true; }

  pixelsPerLength() {
    const { right, bottom, top } = this.free;
    return 0.46 * Math.min(this.width - right, this.height - bottom - top) / this.extent * this.scale;
  }

  onScreen(x, y) {
    const f = this.pixelsPerLength(), { right, bottom, top } = this.free;
    return [(this.width - right) / 2 + x * f, (this.height - bottom + top) / 2 - y * f];
  }

  render() {
    const { run, context, state, shift, look } = this;
    if (!state) return false;
    context.setTransform(this.pixels, 0, 0, this.pixels, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    const place = new Float64Array(6);
    context.fillStyle = css(look.points);
    for (let i = 0; i < run.light; i++) {
      run.point(place, 0, i, run.before, run.fraction);
      if (place[0] !== place[0]) continue;
      const [x, y] = this.onScreen(place[0] + run.places[0] - shift[0], place[1] + run.places[1] - shift[1]);
      context.fillRect(x - 0.7, y - 0.7, 1.4, 1.4);
    }
    for (let k = 0; k < run.count; k++) {
      if (run.places[3 * k] !== run.places[3 * k]) continue;
      const colour = css(state.colourOf(k)), [centre, gm] = run.centreOf(k);
      if (state.paths !== "none" && run.header.bodies.two_body_gm[k] > 0) this.orbit(k, centre, gm, colour);
      const [x, y] = this.onScreen(...[0, 1].map((j) => run.places[3 * k + j] - shift[j]));
      context.fillStyle = colour;
      context.beginPath();
      context.arc(x, y, k ? 3.5 : 6, 0, 7);
      context.fill();
    }
    return false;
  }

  orbit(k, centre, gm, colour) {
    const el = elements(this.run.states, 6 * k, gm), { context, run, shift } = this;
    if (!el || !(el.e < 1)) return;
    const x = el.round ? el.towards : el.node, n = el.normal, b = el.a * Math.sqrt(1 - el.e * el.e);
    const y = [n[1] * x[2] - n[2] * x[1], n[2] * x[0] - n[0] * x[2]];
    context.strokeStyle = colour;
    context.globalAlpha = 0.6;
    context.beginPath();
    for (let m = 0; m <= 180; m++) {
      const c = el.a * (Math.cos(m * Math.PI / 90) - el.e), s = b * Math.sin(m * Math.PI / 90);
      const at = this.onScreen(...[0, 1].map((j) => (centre < 0 ? 0 : run.places[3 * centre + j]) - shift[j] + c * x[j] + s * y[j]));
      if (m) context.lineTo(...at); else context.moveTo(...at);
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  dispose() {}
}
