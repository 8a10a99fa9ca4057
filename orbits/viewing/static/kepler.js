// Motion between two samples: two-body motion that fits both of them, or a cubic; and osculating elements.
//
// The orbits at both ends are described by a, by the eccentricity vector (k, l) and by the mean longitude, in the plane
// of the orbit and from the direction of the body at the first end. Plane, a, k and l go evenly from one end to the
// other; so does the mean longitude, with the whole turns that the mean motion asks for. Both ends are met exactly.

const TURN = 2 * Math.PI;
const MOST_ITERATIONS = 12;
const end0 = new Float64Array(12), end1 = new Float64Array(12); // plane's normal n, e-vector, r, 1/a, unit q, free
const u = new Float64Array(3), w = new Float64Array(3), axis = new Float64Array(3);

function orbitAt(out, q, v, i, gm) {
  const x = q[i], y = q[i + 1], z = q[i + 2], a = v[i], b = v[i + 1], c = v[i + 2];
  const r = Math.sqrt(x * x + y * y + z * z);
  let hx = y * c - z * b, hy = z * a - x * c, hz = x * b - y * a;
  const h = Math.sqrt(hx * hx + hy * hy + hz * hz);
  const inverse = 2 / r - (a * a + b * b + c * c) / gm;
  if (!(inverse > 0) || !(h > 1e-9 * Math.sqrt(gm * r))) return false;
  out[3] = (b * hz - c * hy) / gm - x / r;
  out[4] = (c * hx - a * hz) / gm - y / r;
  out[5] = (a * hy - b * hx) / gm - z / r;
  out[0] = hx / h; out[1] = hy / h; out[2] = hz / h;
  out[6] = r; out[7] = inverse;
  out[8] = x / r; out[9] = y / r; out[10] = z / r;
  return true;
}

// Rotate x in place by the shortest way that takes the unit vector a to the unit vector b.
function turned(x, a, b) {
  const cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const px = a[1] * b[2] - a[2] * b[1], py = a[2] * b[0] - a[0] * b[2], pz = a[0] * b[1] - a[1] * b[0];
  const cx = py * x[2] - pz * x[1], cy = pz * x[0] - px * x[2], cz = px * x[1] - py * x[0];
  const f = 1 / (1 + cosine);
  x[0] += cx + f * (py * cz - pz * cy);
  x[1] += cy + f * (pz * cx - px * cz);
  x[2] += cz + f * (px * cy - py * cx);
}

function frameOf(target) {
  u[0] = end0[8]; u[1] = end0[9]; u[2] = end0[10];
  turned(u, end0, target);
  w[0] = target[1] * u[2] - target[2] * u[1];
  w[1] = target[2] * u[0] - target[0] * u[2];
  w[2] = target[0] * u[1] - target[1] * u[0];
}

// The mean longitude of a body at the angle `place` from u, at r, on the orbit (1/a, k, l).
function meanLongitude(place, r, inverse, k, l) {
  const root = Math.sqrt(Math.max(1 - k * k - l * l, 1e-14)), beta = 1 / (1 + root);
  const X = r * Math.cos(place) * inverse, Y = r * Math.sin(place) * inverse;
  const c = k + ((1 - k * k * beta) * X - k * l * beta * Y) / root;
  const s = l + ((1 - l * l * beta) * Y - k * l * beta * X) / root;
  return Math.atan2(s, c) - k * s + l * c;
}

// The eccentric longitude F of a mean longitude: F - k sin F + l cos F.
function eccentricLongitude(mean, k, l) {
  const e = Math.sqrt(k * k + l * l);
  let F = mean + (e > 0.8 ? Math.sin(mean - Math.atan2(l, k)) * e : k * Math.sin(mean) - l * Math.cos(mean));
  for (let n = 0; n < MOST_ITERATIONS; n++) {
    const c = Math.cos(F), s = Math.sin(F);
    const f = F - k * s + l * c - mean, d = Math.max(1 - k * c - l * s, 0.02);
    const change = Math.max(-0.8, Math.min(0.8, f / d));
    F -= change;
    if (Math.abs(change) < 1e-13) break;
  }
  return F;
}

// Write position and velocity, out[at...at + 5], at the fraction s of an interval of length dt.
// q0, v0, q1, v1 : arrays with the ends at index i; gm : of the two-body motion, 0 for a cubic
export function between(out, at, q0, v0, q1, v1, i, dt, gm, s) {
  if (s <= 0 || s >= 1) {
    const q = s <= 0 ? q0 : q1, v = s <= 0 ? v0 : v1;
    for (let j = 0; j < 3; j++) { out[at + j] = q[i + j]; out[at + 3 + j] = v[i + j]; }
    return;
  }
  if (!(gm > 0 && orbitAt(end0, q0, v0, i, gm) && orbitAt(end1, q1, v1, i, gm) &&
        end0[0] * end1[0] + end0[1] * end1[1] + end0[2] * end1[2] > -0.9)) {
    cubic(out, at, q0, v0, q1, v1, i, dt, s);
    return;
  }
  frameOf(end0);
  const k0 = end0[3] * u[0] + end0[4] * u[1] + end0[5] * u[2], l0 = end0[3] * w[0] + end0[4] * w[1] + end0[5] * w[2];
  frameOf(end1);
  const k1 = end1[3] * u[0] + end1[4] * u[1] + end1[5] * u[2], l1 = end1[3] * w[0] + end1[4] * w[1] + end1[5] * w[2];
  const place = Math.atan2(end1[8] * w[0] + end1[9] * w[1] + end1[10] * w[2],
                           end1[8] * u[0] + end1[9] * u[1] + end1[10] * u[2]);
  const first = meanLongitude(0, end0[6], end0[7], k0, l0), last = meanLongitude(place, end1[6], end1[7], k1, l1);
  const motion = Math.sqrt(gm) * (end0[7] ** 1.5 + end1[7] ** 1.5) / 2;
  const sweep = last - first + TURN * Math.round((motion * dt - (last - first)) / TURN);
  const k = k0 + s * (k1 - k0), l = l0 + s * (l1 - l0), a = 1 / end0[7] + s * (1 / end1[7] - 1 / end0[7]);
  for (let j = 0; j < 3; j++) axis[j] = end0[j] + s * (end1[j] - end0[j]);
  const size = Math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2);
  for (let j = 0; j < 3; j++) axis[j] /= size;
  frameOf(axis);
  const F = eccentricLongitude(first + s * sweep, k, l), c = Math.cos(F), e = Math.sin(F);
  const root = Math.sqrt(Math.max(1 - k * k - l * l, 0)), beta = 1 / (1 + root), cross = k * l * beta;
  const X = a * ((1 - l * l * beta) * c + cross * e - k), Y = a * ((1 - k * k * beta) * e + cross * c - l);
  const rate = Math.sqrt(gm / a) / (1 - k * c - l * e);
  const VX = rate * (cross * c - (1 - l * l * beta) * e), VY = rate * ((1 - k * k * beta) * c - cross * e);
  for (let j = 0; j < 3; j++) {
    out[at + j] = X * u[j] + Y * w[j];
    out[at + 3 + j] = VX * u[j] + VY * w[j];
  }
}

function cubic(out, at, q0, v0, q1, v1, i, dt, s) {
  const rest = s * s * (3 - 2 * s), a = s * (1 - s) * (1 - s) * dt, b = -s * s * (1 - s) * dt;
  const slope = 6 * s * (1 - s) / dt, c = (1 - s) * (1 - 3 * s), d = s * (3 * s - 2);
  for (let j = 0; j < 3; j++) {
    const x = q0[i + j], way = q1[i + j] - x;
    out[at + j] = x + rest * way + a * v0[i + j] + b * v1[i + j];
    out[at + 3 + j] = slope * way + c * v0[i + j] + d * v1[i + j];
  }
}

// The osculating elements of a state at index i about a body, angles in degrees; null without an orbit.
export function elements(state, i, gm) {
  if (!(gm > 0)) return null;
  const [x, y, z, a, b, c] = state.subarray(i, i + 6);
  const r = Math.hypot(x, y, z), speed = Math.hypot(a, b, c), rv = x * a + y * b + z * c;
  const hx = y * c - z * b, hy = z * a - x * c, hz = x * b - y * a, h = Math.hypot(hx, hy, hz);
  if (!(r > 0) || !(h > 0)) return null;
  const ex = (b * hz - c * hy) / gm - x / r, ey = (c * hx - a * hz) / gm - y / r, ez = (a * hy - b * hx) / gm - z / r;
  const e = Math.hypot(ex, ey, ez), size = 1 / (2 / r - speed * speed / gm);
  const inclination = Math.acos(Math.max(-1, Math.min(1, hz / h)));
  const flat = Math.hypot(hx, hy) < 1e-11 * h;
  const nx = flat ? 1 : -hy / Math.hypot(hx, hy), ny = flat ? 0 : hx / Math.hypot(hx, hy);
  const angle = (px, py, pz) => { // in the plane, from the node
    const mx = (hy * 0 - hz * ny) / h, my = (hz * nx - hx * 0) / h, mz = (hx * ny - hy * nx) / h;
    return Math.atan2(px * mx + py * my + pz * mz, px * nx + py * ny);
  };
  const pericentre = e > 1e-12 ? angle(ex, ey, ez) : 0, place = angle(x, y, z), f = place - pericentre;
  let mean, anomaly = 0;
  if (e < 1) {
    anomaly = 2 * Math.atan2(Math.sqrt(1 - e) * Math.sin(f / 2), Math.sqrt(1 + e) * Math.cos(f / 2));
    mean = anomaly - e * Math.sin(anomaly);
  } else {
    const F = 2 * Math.atanh(Math.sqrt((e - 1) / (e + 1)) * Math.tan(f / 2));
    mean = e * Math.sinh(F) - F;
  }
  const degrees = (x) => ((x * 180 / Math.PI) % 360 + 360) % 360;
  return {
    a: size, e, i: inclination * 180 / Math.PI, Omega: flat ? 0 : degrees(Math.atan2(hx, -hy)), omega: degrees(pericentre),
    M: e < 1 ? degrees(mean) : mean * 180 / Math.PI, period: e < 1 ? TURN * Math.sqrt(size ** 3 / gm) : NaN,
    r, speed, anomaly, towards: [ex / (e || 1), ey / (e || 1), ez / (e || 1)], normal: [hx / h, hy / h, hz / h],
    round: e > 1e-12, node: [nx, ny, 0],
  };
}

// The same motion for the vertex shader, in single precision.
export const BETWEEN_GLSL = `
struct Orbit { vec3 n; vec3 e; vec3 x; float r; float inverse; bool bound; };
Orbit orbitAt(vec3 q, vec3 v, float gm) {
  Orbit o;
  o.r = length(q);
  o.x = q / o.r;
  vec3 h = cross(q, v);
  float size = length(h);
  o.inverse = 2.0 / o.r - dot(v, v) / gm;
  o.bound = gm > 0.0 && o.inverse > 0.0 && size > 1e-5 * sqrt(gm * o.r);
  o.n = h / size;
  o.e = cross(v, h) / gm - o.x;
  return o;
}
vec3 turned(vec3 x, vec3 a, vec3 b) {
  vec3 p = cross(a, b);
  vec3 c = cross(p, x);
  return x + c + cross(p, c) / (1.0 + dot(a, b));
}
float meanLongitude(vec2 place, float r, float inverse, vec2 e) {
  float root = sqrt(max(1.0 - dot(e, e), 1e-7));
  float beta = 1.0 / (1.0 + root);
  vec2 X = r * inverse * place;
  float c = e.x + ((1.0 - e.x * e.x * beta) * X.x - e.x * e.y * beta * X.y) / root;
  float s = e.y + ((1.0 - e.y * e.y * beta) * X.y - e.x * e.y * beta * X.x) / root;
  return atan(s, c) - e.x * s + e.y * c;
}
const float TURN = 6.283185307179586;
// elements : a, e, i in radians
vec3 between(vec3 q0, vec3 v0, vec3 q1, vec3 v1, float dt, float gm, float s, out vec3 elements) {
  Orbit one = orbitAt(q0, v0, gm), two = orbitAt(q1, v1, gm);
  elements = vec3(1.0 / one.inverse, length(one.e), acos(clamp(one.n.z, -1.0, 1.0)));
  if (!one.bound || !two.bound || dot(one.n, two.n) < -0.9) {
    float rest = s * s * (3.0 - 2.0 * s);
    return q0 + rest * (q1 - q0) + s * (1.0 - s) * dt * ((1.0 - s) * v0 - s * v1);
  }
  vec3 w = cross(one.n, one.x);
  vec2 e0 = vec2(dot(one.e, one.x), dot(one.e, w));
  vec3 u = turned(one.x, one.n, two.n);
  w = cross(two.n, u);
  vec2 e1 = vec2(dot(two.e, u), dot(two.e, w));
  float first = meanLongitude(vec2(1.0, 0.0), one.r, one.inverse, e0);
  float way = meanLongitude(vec2(dot(two.x, u), dot(two.x, w)), two.r, two.inverse, e1) - first;
  float motion = sqrt(gm) * (pow(one.inverse, 1.5) + pow(two.inverse, 1.5)) / 2.0;
  float turns = floor((motion * dt - way) / TURN + 0.5);
  vec2 e = mix(e0, e1, s);
  float a = mix(1.0 / one.inverse, 1.0 / two.inverse, s);
  vec3 n = normalize(mix(one.n, two.n, s));
  u = turned(one.x, one.n, n);
  w = cross(n, u);
  float mean = first + s * way + TURN * fract(s * turns);
  float size = length(e);
  float F = mean + e.x * sin(mean) - e.y * cos(mean);
  if (size > 0.8) F = mean + size * sin(mean - atan(e.y, e.x));
  for (int k = 0; k < 5; k++) {
    float c = cos(F), d = sin(F);
    F -= clamp((F - e.x * d + e.y * c - mean) / max(1.0 - e.x * c - e.y * d, 0.02), -0.8, 0.8);
  }
  float c = cos(F), d = sin(F), beta = 1.0 / (1.0 + sqrt(max(1.0 - dot(e, e), 0.0))), across = e.x * e.y * beta;
  elements = vec3(a, size, acos(clamp(n.z, -1.0, 1.0)));
  return a * (((1.0 - e.y * e.y * beta) * c + across * d - e.x) * u
            + ((1.0 - e.x * e.x * beta) * d + across * c - e.y) * w);
}
`;
