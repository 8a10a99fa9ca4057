// What the graphics processor draws: points, discs of bodies, osculating orbits and trails.

import { BETWEEN_GLSL } from "./kepler.js";

const HEAD = `
precision highp float;
precision highp int;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
`;

// Points between two samples. `position` and v0 are the state at the first, q1 and v1 that at the second.
export const POINTS = {
  vertex: `${HEAD}
in vec3 position; in vec3 v0; in vec3 q1; in vec3 v1; in float a0; in float error;
uniform vec3 origin; uniform float shrink; uniform float dt; uniform float gm; uniform float s; uniform float size;
uniform int mode; uniform vec2 range; uniform vec3 stops[9]; uniform vec3 plain; uniform float strength;
out vec4 colour;
${BETWEEN_GLSL}
void main() {
  bool here = dot(position, position) > 0.0, there = dot(q1, q1) > 0.0;
  if (!here || (!there && s > 0.0)) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); gl_PointSize = 0.0; colour = vec4(0.0); return; }
  vec3 el;
  vec3 q = s <= 0.0 ? position : s >= 1.0 ? q1 : between(position, v0, q1, v1, dt, gm, s, el);
  if (s <= 0.0 || s >= 1.0) {
    Orbit o = orbitAt(q, s <= 0.0 ? v0 : v1, gm);
    el = vec3(1.0 / o.inverse, length(o.e), acos(clamp(o.n.z, -1.0, 1.0)));
  }
  gl_Position = projectionMatrix * modelViewMatrix * vec4((q + origin) * shrink, 1.0);
  gl_PointSize = size;
  float x = mode == 1 ? el.x : mode == 2 ? el.y : mode == 3 ? degrees(el.z)
          : mode == 4 ? (el.x - a0) / a0 : mode == 5 ? error : 0.0;
  if (mode == 1 && el.x < 0.0) x = range.y;
  x = clamp((x - range.x) / (range.y - range.x), 0.0, 1.0) * 8.0;
  int i = int(min(floor(x), 7.0));
  colour = vec4(mode == 0 ? plain : mix(stops[i], stops[i + 1], x - float(i)), strength);
}`,
  fragment: `
precision highp float;
in vec4 colour; out vec4 shown;
void main() {
  float r = length(gl_PointCoord - 0.5) * 2.0;
  shown = vec4(colour.rgb, colour.a * (1.0 - smoothstep(0.55, 1.0, r)));
}`,
};

// Discs of a size in pixels; the root has a glow.
export const DISCS = {
  vertex: `${HEAD}
in vec3 position; in vec4 tint; in float radius; in float glow;
uniform float pixels;
out vec4 colour; out float part;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  float whole = radius * (glow > 0.0 ? 4.5 : 1.35) + 1.5;
  gl_PointSize = tint.a > 0.0 ? 2.0 * whole * pixels : 0.0;
  part = radius / whole;
  colour = vec4(tint.rgb, glow > 0.0 ? glow : -1.0);
}`,
  fragment: `
precision highp float;
in vec4 colour; in float part; out vec4 shown;
void main() {
  float r = length(gl_PointCoord - 0.5) * 2.0, edge = fwidth(r);
  float disc = 1.0 - smoothstep(part - edge, part + edge, r);
  float halo = colour.a > 0.0 ? colour.a * pow(max(0.0, 1.0 - r), 2.4) : 0.0;
  shown = vec4(colour.rgb, max(disc, halo));
  if (shown.a < 0.003) discard;
}`,
};

const LINE = `
uniform vec2 screen; uniform float width;
vec4 widened(vec4 here, vec4 next, float side) {
  vec2 a = here.xy / here.w * screen, b = next.xy / next.w * screen;
  vec2 way = b - a;
  float size = length(way);
  vec2 across = size > 1e-6 ? vec2(-way.y, way.x) / size : vec2(0.0, 1.0);
  return vec4(here.xy + across * side * (width + 1.0) / screen * here.w, here.zw);
}
`;

const LINE_FRAGMENT = `
precision highp float;
uniform float width;
in vec4 colour; in float offset; out vec4 shown;
void main() {
  float away = abs(offset) * (width + 1.0);
  shown = vec4(colour.rgb, colour.a * clamp((width + 1.0 - away) / 1.0, 0.0, 1.0));
}`;

// Ellipses: `position` is (part of a turn behind the body, side, 0); an instance has centre, axes, and colour.
export const ORBITS = {
  vertex: `${HEAD}${LINE}
in vec3 position; in vec3 middle; in vec3 major; in vec3 minor; in vec2 place; in vec4 tint;
uniform vec2 fade;
out vec4 colour; out float offset;
vec3 at(float E) { return middle + (cos(E) - place.y) * major + sin(E) * minor; }
void main() {
  float E = place.x - 6.283185307179586 * position.x;
  vec4 here = projectionMatrix * modelViewMatrix * vec4(at(E), 1.0);
  vec4 next = projectionMatrix * modelViewMatrix * vec4(at(E - 0.01), 1.0);
  gl_Position = tint.a > 0.0 ? widened(here, next, position.y) : vec4(2.0, 2.0, 2.0, 1.0);
  offset = position.y;
  colour = vec4(tint.rgb, tint.a * mix(fade.x, fade.y, pow(1.0 - position.x, 1.8)));
}`,
  fragment: LINE_FRAGMENT,
};

// Trails: an instance is a piece from one point to the next; rows of row points follow each other.
export const TRAILS = {
  vertex: `${HEAD}${LINE}
in vec3 position; in vec3 from; in vec3 to;
uniform int row; uniform vec2 fade; uniform vec3 tints[64];
out vec4 colour; out float offset;
void main() {
  int k = gl_InstanceID % row;
  vec4 a = projectionMatrix * modelViewMatrix * vec4(from, 1.0), b = projectionMatrix * modelViewMatrix * vec4(to, 1.0);
  bool whole = k < row - 1 && from.x > -1e29 && to.x > -1e29;
  gl_Position = !whole ? vec4(2.0, 2.0, 2.0, 1.0) : position.x < 0.5 ? widened(a, b, position.y) : widened(b, 2.0 * b - a, position.y);
  offset = position.y;
  float x = (float(k) + position.x) / float(row - 1);
  colour = vec4(tints[gl_InstanceID / row], mix(fade.x, fade.y, x * x));
}`,
  fragment: LINE_FRAGMENT,
};
