// The view in three dimensions, drawn by three.js through WebGL 2.

import { elements } from "./kepler.js";
import { DISCS, ORBITS, POINTS, TRAILS } from "./shaders.js";
import { MOST_TRAILS, TRAIL_POINTS, Trails } from "./trails.js";

const SEGMENTS = 256, ROWS = MOST_TRAILS + 1;

function material(shader, uniforms) {
  return new THREE.RawShaderMaterial({
    vertexShader: shader.vertex, fragmentShader: shader.fragment, glslVersion: THREE.GLSL3, uniforms,
    transparent: true, depthTest: false, depthWrite: false,
  });
}

function strip(length) {
  const corners = [], index = [];
  for (let k = 0; k <= length; k++) corners.push(k / length, -1, 0, k / length, 1, 0);
  for (let k = 0; k < length; k++) index.push(2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 2, 2 * k + 1, 2 * k + 3);
  const made = new THREE.InstancedBufferGeometry();
  made.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
  made.setIndex(index);
  return made;
}

function added(geometry, name, size, count, instanced) {
  const kind = instanced ? THREE.InstancedBufferAttribute : THREE.BufferAttribute;
  const made = new kind(new Float32Array(size * count), size);
  made.setUsage(THREE.DynamicDrawUsage);
  geometry.setAttribute(name, made);
  return made;
}

export class Sky {
  // Throws where there is no WebGL 2.
  constructor(canvas, run, look) {
    const context = canvas.getContext("webgl2", { alpha: true, antialias: true, powerPreference: "high-performance" });
    if (!context) throw new Error("no WebGL 2");
    this.run = run;
    this.look = look;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, context, alpha: true, antialias: true });
    this.renderer.setClearColor(0, 0);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 1e-3, 1e3);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !look.still;
    this.controls.dampingFactor = 0.12;
    this.controls.minDistance = 1e-6;
    this.controls.maxDistance = 400;
    this.controls.zoomSpeed = 1.4;
    this.trails = new Trails(run);
    this.extent = extentOf(run);
    this.shrink = 1 / this.extent;
    this.makePoints();
    this.makeDiscs();
    this.makeOrbits();
    this.makeTrails();
    this.projected = new THREE.Vector3();
    this.interval = -1;
    this.fit();
  }

  add(kind, geometry, shader, uniforms, order) {
    const made = new kind(geometry, material(shader, uniforms));
    made.frustumCulled = false;
    made.renderOrder = order;
    this.scene.add(made);
    return made;
  }

  makePoints() {
    const { light } = this.run, geometry = new THREE.BufferGeometry();
    if (!light) return;
    for (const name of ["position", "v0", "q1", "v1"]) added(geometry, name, 3, light);
    const a0 = added(geometry, "a0", 1, light);
    added(geometry, "error", 1, light);
    const gm = this.run.header.points.two_body_gm, state = new Float64Array(6), first = this.run.samples[0];
    for (let i = 0; gm > 0 && i < light; i++) {
      for (let j = 0; j < 3; j++) { state[j] = first.pq[3 * i + j]; state[3 + j] = first.pv[3 * i + j]; }
      a0.array[i] = 1 / (2 / Math.hypot(state[0], state[1], state[2]) - (state[3] ** 2 + state[4] ** 2 + state[5] ** 2) / gm);
    }
    this.points = this.add(THREE.Points, geometry, POINTS, {
      origin: { value: new THREE.Vector3() }, shrink: { value: this.shrink }, dt: { value: 1 }, gm: { value: gm },
      s: { value: 0 }, size: { value: 3 }, mode: { value: 0 }, range: { value: new THREE.Vector2(0, 1) },
      stops: { value: Array.from({ length: 9 }, () => new THREE.Vector3()) }, plain: { value: new THREE.Vector3(1, 1, 1) },
      strength: { value: 0.8 },
    }, 1);
  }

  makeDiscs() {
    const { count } = this.run, { gm } = this.run.header.bodies, geometry = new THREE.BufferGeometry();
    for (const [name, size] of [["position", 3], ["tint", 4], ["radius", 1], ["glow", 1]]) added(geometry, name, size, count);
    const largest = gm[0], { radius, glow } = geometry.attributes;
    for (let k = 0; k < count; k++) {
      const relative = gm[k] > 0 ? 1 + Math.max(-1, Math.log10(gm[k] / largest) / 9) : 0;
      radius.array[k] = k === 0 && this.run.count > 1 && gm.length > 1 && gm[1] < 0.1 * largest ? 7.5 : 2.4 + 3.4 * relative;
      glow.array[k] = radius.array[k] > 7 ? 0.5 : 0;
    }
    this.discs = this.add(THREE.Points, geometry, DISCS, { pixels: { value: 1 } }, 4);
  }

  makeOrbits() {
    const geometry = strip(SEGMENTS), { count } = this.run;
    for (const [name, size] of [["middle", 3], ["major", 3], ["minor", 3], ["place", 2], ["tint", 4]])
      added(geometry, name, size, count + 1, true);
    geometry.instanceCount = count + 1;
    this.orbits = this.add(THREE.Mesh, geometry, ORBITS, {
      screen: { value: new THREE.Vector2() }, width: { value: 0.6 }, fade: { value: new THREE.Vector2(0.14, 0.8) },
    }, 2);
    this.orbits.material.side = 2;
  }

  makeTrails() {
    const geometry = strip(1), row = TRAIL_POINTS + 1, data = new Float32Array(ROWS * row * 3);
    this.trailPoints = new THREE.InstancedInterleavedBuffer(data, 3, 1);
    this.trailPoints.setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute("from", new THREE.InterleavedBufferAttribute(this.trailPoints, 3, 0));
    geometry.setAttribute("to", new THREE.InterleavedBufferAttribute(this.trailPoints, 3, 3));
    geometry.instanceCount = 0;
    this.paths = this.add(THREE.Mesh, geometry, TRAILS, {
      screen: this.orbits.material.uniforms.screen, width: { value: 0.65 }, fade: { value: new THREE.Vector2(0.02, 0.9) },
      row: { value: row }, tints: { value: Array.from({ length: 64 }, () => new THREE.Vector3()) },
    }, 3);
    this.paths.material.side = 2;
  }

  // free : how much of each side is covered, { right, bottom, top }; the focus is in the middle of the rest
  resize(width, height, pixels, free) {
    this.free = free;
    this.width = width; this.height = height; this.pixels = pixels;
    this.renderer.setPixelRatio(pixels);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.setViewOffset(width, height, free.right / 2, (free.bottom - free.top) / 2, width, height);
    this.orbits.material.uniforms.screen.value.set(width * pixels / 2, height * pixels / 2);
    this.orbits.material.uniforms.width.value = 0.55 * pixels;
    this.paths.material.uniforms.width.value = 0.6 * pixels;
    this.discs.material.uniforms.pixels.value = pixels;
    const crowd = this.run.light > 3000 ? 0 : 1;
    if (this.points) this.points.material.uniforms.size.value = (Math.min(width, height) > 600 ? 2.3 + crowd : 1.9 + crowd) * pixels;
  }

  // Show the whole run, or, about another body than the root, what moves about that.
  fit(reach = this.extent) {
    const { width = 1, height = 1, free = { right: 0, bottom: 0, top: 0 } } = this;
    const across = 0.86 * (width - free.right), up = height - free.bottom - free.top;
    const seen = Math.min(across, 1.5 * up) / height; // the radius of an orbit is as high as half of this, or less
    const distance = reach * this.shrink / (Math.tan(this.camera.fov * Math.PI / 360) * seen) * 1.05;
    this.camera.position.set(0, -0.80 * distance, 0.60 * distance);
    this.controls.target.set(0, 0, 0);
    this.controls.update();
  }

  // state : { focus, paths, trail, mode, range, picked, time }
  update(state) {
    const { run, shrink, look } = this, { places } = run, shift = run.placeOf(state.focus);
    if (this.points) this.updatePoints(state, shift);
    const disc = this.discs.geometry.attributes, orbit = this.orbits.geometry.attributes, which = [];
    for (let k = 0; k < run.count; k++) {
      const colour = state.colourOf(k), there = places[3 * k] === places[3 * k];
      for (let j = 0; j < 3; j++) {
        disc.position.array[3 * k + j] = there ? (places[3 * k + j] - shift[j]) * shrink : 0;
        disc.tint.array[4 * k + j] = colour[j];
      }
      disc.tint.array[4 * k + 3] = there ? 1 : 0;
      const [centre, gm] = run.centreOf(k);
      const close = run.header.bodies.two_body_gm[k] > 0;
      const drawn = state.paths === "orbits" && there && close &&
        this.ellipse(orbit, k, run.states, 6 * k, gm, centre, shift, colour, k === state.picked);
      if (!drawn) orbit.tint.array[4 * k + 3] = 0;
      const moving = k > 0 || (disc.glow.array[0] === 0 && run.count > 1); // a Sun among planets has no trail
      if (!drawn && there && moving && k < MOST_TRAILS && state.paths !== "none") which.push(k);
    }
    orbit.tint.array[4 * run.count + 3] = 0;
    if (state.picked >= run.count) {
      const it = run.stateOf(state.picked), [centre, gm] = run.centreOf(state.picked);
      if (it[0] === it[0] && run.header.points.two_body_gm > 0)
        this.ellipse(orbit, run.count, it, 0, gm, centre, shift, look.pick, true);
    }
    for (const name of ["position", "tint"]) disc[name].needsUpdate = true;
    for (const name of ["middle", "major", "minor", "place", "tint"]) orbit[name].needsUpdate = true;
    this.updateTrails(state, which, shift);
  }

  updatePoints(state, shift) {
    const { run } = this, { attributes } = this.points.geometry, uniforms = this.points.material.uniforms;
    const [a, b] = run.ends(run.before), key = run.before + run.length * 1e-9;
    if (key !== this.interval) {
      for (const [name, array] of [["position", a.pq], ["v0", a.pv], ["q1", b.pq], ["v1", b.pv]]) {
        attributes[name].array = array;
        attributes[name].needsUpdate = true;
      }
      const errors = run.errors[run.before];
      if (errors) { attributes.error.array.set(errors.subarray(run.count)); attributes.error.needsUpdate = true; }
      this.interval = key;
    }
    uniforms.dt.value = run.duration(run.before);
    uniforms.s.value = run.fraction;
    uniforms.origin.value.set(run.places[0] - shift[0], run.places[1] - shift[1], run.places[2] - shift[2]);
    uniforms.mode.value = state.mode;
    uniforms.range.value.set(...state.range);
    state.stops.forEach((stop, k) => uniforms.stops.value[k].set(...stop));
    uniforms.plain.value.set(...this.look.points);
    uniforms.strength.value = this.look.dark ? 0.8 : 0.75;
  }

  ellipse(orbit, k, state, at, gm, centre, shift, colour, bright) {
    const el = elements(state, at, gm);
    if (!el || !(el.e < 1) || !(el.a > 0)) return false;
    const { run, shrink } = this, b = el.a * Math.sqrt(1 - el.e * el.e);
    const x = el.round ? el.towards : el.node, n = el.normal;
    const y = [n[1] * x[2] - n[2] * x[1], n[2] * x[0] - n[0] * x[2], n[0] * x[1] - n[1] * x[0]];
    for (let j = 0; j < 3; j++) {
      orbit.middle.array[3 * k + j] = ((centre < 0 ? 0 : run.places[3 * centre + j]) - shift[j]) * shrink;
      orbit.major.array[3 * k + j] = el.a * shrink * x[j];
      orbit.minor.array[3 * k + j] = b * shrink * y[j];
      orbit.tint.array[4 * k + j] = colour[j];
    }
    orbit.place.array[2 * k] = el.anomaly;
    orbit.place.array[2 * k + 1] = el.e;
    orbit.tint.array[4 * k + 3] = bright ? 1 : k < 20 ? 0.85 : 0.4;
    return true;
  }

  updateTrails(state, which, shift) {
    const { run, trails } = this, row = TRAIL_POINTS + 1, { array } = this.trailPoints;
    const light = state.picked >= run.count && state.paths === "trails" ? state.picked - run.count : -1;
    const key = which.join();
    if (key !== this.trailKey) { this.trailKey = key; this.which = which; }
    if (which.length || light >= 0) trails.update(state.time, state.trail * run.direction, this.which, light);
    const here = new Float64Array(3), about = new Float64Array(3), tints = this.paths.material.uniforms.tints.value;
    which.forEach((body, n) => {
      const centre = run.header.bodies.centre[body];
      for (let j = 0; j < 3; j++) { about[j] = centre < 0 ? 0 : run.places[3 * centre + j]; here[j] = run.places[3 * body + j]; }
      trails.write(array, 3 * n * row, trails.known, body, about, shift, here, this.shrink);
      tints[n].set(...state.colourOf(body));
    });
    let rows = which.length;
    if (light >= 0) {
      about.set(run.places.subarray(0, 3));
      trails.write(array, 3 * rows * row, trails.one, 0, about, shift, run.placeOf(state.picked), this.shrink);
      tints[rows].set(...this.look.pick);
      rows += 1;
    }
    this.paths.geometry.instanceCount = Math.max(0, rows * row - 1);
    this.paths.visible = rows > 0;
    this.trailPoints.needsUpdate = rows > 0;
  }

  // Draw, and return whether the camera is still moving.
  render() {
    const moved = this.controls.update();
    const distance = this.camera.position.length();
    this.camera.near = distance * 1e-3;
    this.camera.far = distance * 20 + 1000;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.scene, this.camera);
    return moved;
  }

  // The place on the screen of a place relative to the focus, in the unit of length; null behind the camera.
  onScreen(x, y, z) {
    const p = this.projected.set(x * this.shrink, y * this.shrink, z * this.shrink).project(this.camera);
    return p.z > 1 || p.z < -1 ? null : [(p.x + 1) / 2 * this.width, (1 - p.y) / 2 * this.height];
  }

  // How many pixels a unit of length is at the focus.
  pixelsPerLength() {
    return this.height / (2 * Math.tan(this.camera.fov * Math.PI / 360)) / this.camera.position.distanceTo(this.controls.target) * this.shrink;
  }

  zoom(factor) { this.camera.position.multiplyScalar(factor); }

  turn(across, up) {
    const p = this.camera.position, r = p.length(), flat = Math.hypot(p.x, p.y);
    const angle = Math.atan2(p.y, p.x) + across, height = Math.max(-1.55, Math.min(1.55, Math.atan2(p.z, flat) + up));
    p.set(r * Math.cos(height) * Math.cos(angle), r * Math.cos(height) * Math.sin(angle), r * Math.sin(height));
  }

  dispose() { this.controls.dispose(); this.renderer.dispose(); }
}

// A distance from the centre of the view within which nearly all of the run begins.
export function extentOf(run) {
  const first = run.samples[0], distances = [];
  run.seek(run.start);
  const from = run.placeOf(run.header.focus);
  for (let k = 0; k < run.count; k++) {
    const [centre, gm] = run.centreOf(k), el = centre <= 0 ? elements(run.states, 6 * k, gm) : null;
    const far = el && el.e < 0.6 ? el.a * (1 + el.e) : 0; // the apocentre, but not that of a comet
    distances.push(Math.max(far, Math.hypot(...[0, 1, 2].map((j) => run.places[3 * k + j] - from[j]))));
  }
  const far = distances.filter((x) => x > 0);
  const light = [];
  for (let i = 0; i < run.light; i++) light.push(Math.hypot(first.pq[3 * i], first.pq[3 * i + 1], first.pq[3 * i + 2]));
  light.sort((a, b) => a - b);
  if (light.length > 10 * run.count) return 1.15 * light[Math.floor(0.97 * (light.length - 1))]; // they are what it is about
  if (light.length) far.push(light[Math.floor(0.97 * (light.length - 1))]);
  return Math.max(...far, 0) || Math.hypot(run.places[0], run.places[1], run.places[2]) || 1;
}
