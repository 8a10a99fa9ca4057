// The samples of a run, as the page got them, and the states of its bodies at any time.

import { between } from "./kepler.js";

function decoded(packed) {
  const text = atob(packed.data), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return packed.type === "f4" ? new Float32Array(bytes.buffer) : new Float64Array(bytes.buffer);
}

export class Run {
  constructor(header, chunk) {
    this.header = header;
    this.count = header.bodies.names.length;
    this.light = header.points.names.length;
    this.names = [...header.bodies.names, ...header.points.names];
    this.samples = []; // { q, v, pq, pv }: of bodies, relative to their centres, and of points, relative to the root
    this.times = [];
    this.numbers = []; // of the samples in the archive
    this.conserved = [];
    this.errors = [];
    this.approaches = header.approaches || null;
    this.states = new Float64Array(6 * this.count); // relative to the centres
    this.places = new Float64Array(3 * this.count); // relative to the origin of the system
    this.before = 0;
    this.gmNow = header.bodies.gm;
    this.fraction = 0;
    this.add(chunk);
  }

  // Take further samples, and return whether there were any.
  add(chunk) {
    this.complete = chunk.complete;
    this.ended = chunk.ended;
    this.events = chunk.events;
    this.masses = chunk.masses;
    if (chunk.first !== this.times.length) return false; // asked for twice
    const times = decoded(chunk.times), bodies = decoded(chunk.bodies), points = decoded(chunk.points);
    for (let i = 0; i < points.length; i++) if (points[i] !== points[i]) points[i] = 0; // gone: shaders know no NaN
    const errors = chunk.errors ? decoded(chunk.errors) : null, all = this.count + this.light;
    const b = 3 * this.count, p = 3 * this.light;
    times.forEach((time, k) => {
      this.times.push(time);
      this.samples.push({
        q: bodies.subarray(2 * k * b, (2 * k + 1) * b), v: bodies.subarray((2 * k + 1) * b, (2 * k + 2) * b),
        pq: points.subarray(2 * k * p, (2 * k + 1) * p), pv: points.subarray((2 * k + 1) * p, (2 * k + 2) * p),
      });
      if (errors) this.errors.push(errors.subarray(k * all, (k + 1) * all));
    });
    this.numbers.push(...decoded(chunk.numbers));
    chunk.conserved.forEach((kept, k) => {
      if (!this.conserved[k]) this.conserved[k] = { name: kept.name, change: [] };
      for (const x of decoded(kept.change)) this.conserved[k].change.push(x);
    });
    return times.length > 0;
  }

  get length() { return this.times.length; }
  get start() { return this.times[0]; }
  get end() { return this.times[this.times.length - 1]; }
  get direction() { return this.end < this.start ? -1 : 1; }

  // The number of the last sample at or before a time, in the direction of the run, and the fraction after it.
  locate(time) {
    const t = this.times, d = this.direction, last = t.length - 1;
    if (last === 0 || d * (time - t[0]) <= 0) return [0, 0];
    if (d * (time - t[last]) >= 0) return [last - 1, 1];
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (d * (t[middle] - time) <= 0) low = middle; else high = middle;
    }
    const length = t[high] - t[low], s = (time - t[low]) / length, near = 1e-9 * Math.abs(this.end - this.start);
    if (Math.abs(time - t[low]) <= near) return [low, 0];
    if (Math.abs(time - t[high]) <= near) return [low, 1];
    return [low, s];
  }

  // The sample that is exactly at a time, or -1.
  sampleAt(time) {
    const [k, s] = this.locate(time);
    return s === 0 ? k : s === 1 ? Math.min(k + 1, this.length - 1) : -1;
  }

  ends(k) { return [this.samples[k], this.samples[Math.min(k + 1, this.length - 1)]]; }

  duration(k) { return this.times[Math.min(k + 1, this.length - 1)] - this.times[k]; }

  // Write the state of a body relative to its centre.
  relative(out, at, body, k, s) {
    const [a, b] = this.ends(k);
    between(out, at, a.q, a.v, b.q, b.v, 3 * body, this.duration(k), this.header.bodies.two_body_gm[body], s);
  }

  // Write the state of a point relative to the root.
  point(out, at, point, k, s) {
    const [a, b] = this.ends(k), i = 3 * point;
    if (gone(a.pq, i) || gone(b.pq, i)) {
      const end = s < 1 || gone(b.pq, i) ? a : b;
      for (let j = 0; j < 3; j++) { out[at + j] = gone(end.pq, i) ? NaN : end.pq[i + j]; out[at + 3 + j] = end.pv[i + j]; }
      return;
    }
    between(out, at, a.pq, a.pv, b.pq, b.pv, i, this.duration(k), this.header.points.two_body_gm, s);
  }

  // Compute the states of all bodies at a time, in `states` and `places`.
  seek(time) {
    [this.before, this.fraction] = this.locate(time);
    this.gmNow = this.header.bodies.gm;
    for (const [from, gm] of this.masses) if (this.direction * (time - from) >= 0) this.gmNow = gm;
    const { centre } = this.header.bodies;
    for (let body = 0; body < this.count; body++) {
      this.relative(this.states, 6 * body, body, this.before, this.fraction);
      const about = 3 * centre[body];
      for (let j = 0; j < 3; j++)
        this.places[3 * body + j] = this.states[6 * body + j] + (about < 0 ? 0 : this.places[about + j]);
    }
  }

  // The state of a body or a point relative to what it moves about, at the time of the last `seek`.
  stateOf(body) {
    const out = new Float64Array(6);
    if (body < this.count) out.set(this.states.subarray(6 * body, 6 * body + 6));
    else this.point(out, 0, body - this.count, this.before, this.fraction);
    return out;
  }

  // The place of a body or a point relative to the origin of the system, at the time of the last `seek`.
  placeOf(body) {
    if (body < 0) return new Float64Array(3);
    if (body < this.count) return this.places.slice(3 * body, 3 * body + 3);
    const state = this.stateOf(body);
    return Float64Array.from([0, 1, 2], (j) => state[j] + this.places[j]);
  }

  // The body about which another moves, -1 for the origin, and the GM of that motion, 0 where there is no orbit.
  centreOf(body) {
    const { centre } = this.header.bodies, gm = this.gmNow;
    if (body >= this.count) return [0, this.header.points.two_body_gm > 0 ? gm[0] : 0];
    return centre[body] < 0 ? [-1, this.header.bodies.two_body_gm[body]] : [centre[body], gm[body] + gm[centre[body]]];
  }
}

export function gone(q, i) { return q[i] === 0 && q[i + 1] === 0 && q[i + 2] === 0; }
