// The paths of bodies over the last part of the run, relative to what they move about, at even times.

export const TRAIL_POINTS = 240;
export const MOST_TRAILS = 60;

export class Trails {
  constructor(run) {
    this.run = run;
    this.bodies = Math.min(run.count, MOST_TRAILS);
    this.known = new Float64Array(this.bodies * TRAIL_POINTS * 3); // a ring for each body
    this.last = NaN; // the number of the newest point
    this.state = new Float64Array(6);
    this.picked = -1;
    this.one = new Float64Array(TRAIL_POINTS * 3);
    this.length = 0;
  }

  // Compute the points up to a time that are not known yet; which : the bodies, by place
  update(time, length, which, picked) {
    const step = length / TRAIL_POINTS, { run } = this, newest = Math.floor((time - run.start) / step);
    let first = newest - TRAIL_POINTS + 1;
    const same = length === this.length && which === this.which && picked === this.picked;
    if (same && newest === this.last) return;
    if (same && newest > this.last && this.last >= first) first = this.last + 1;
    this.length = length; this.which = which; this.last = newest;
    for (let n = first; n <= newest; n++) {
      const slot = ((n % TRAIL_POINTS) + TRAIL_POINTS) % TRAIL_POINTS, [k, s] = run.locate(run.start + n * step);
      const before = n < 0;
      for (const body of which) {
        if (!before) run.relative(this.state, 0, body, k, s);
        const at = 3 * (body * TRAIL_POINTS + slot);
        for (let j = 0; j < 3; j++) this.known[at + j] = before ? NaN : this.state[j];
      }
      if (picked >= 0) {
        if (!before) run.point(this.state, 0, picked, k, s);
        for (let j = 0; j < 3; j++) this.one[3 * slot + j] = before ? NaN : this.state[j];
      }
    }
    this.picked = picked;
  }

  // Write the points of a ring, oldest first, and then where the body is, into out from `at` on.
  write(out, at, ring, row, about, shift, here, shrink) {
    for (let n = 1; n <= TRAIL_POINTS; n++) {
      const from = 3 * (row * TRAIL_POINTS + (((this.last + n) % TRAIL_POINTS) + TRAIL_POINTS) % TRAIL_POINTS);
      for (let j = 0; j < 3; j++) {
        const x = (ring[from + j] + about[j] - shift[j]) * shrink;
        out[at++] = x === x ? x : -1e30;
      }
    }
    for (let j = 0; j < 3; j++) {
      const x = (here[j] - shift[j]) * shrink;
      out[at++] = x === x ? x : -1e30;
    }
  }
}
