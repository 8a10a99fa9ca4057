// Colours: a scale of even lightness that colour-blind readers can read (viridis), and bodies on dark and light ground.

const VIRIDIS = ["440154", "482475", "414487", "355f8d", "2a788e", "21918c", "22a884", "44bf70", "7ad151", "bddf26", "fde725"];
const STOPS = 9;

function parsed(hex) {
  const number = parseInt(hex.replace("#", ""), 16);
  return [(number >> 16) & 255, (number >> 8) & 255, number & 255].map((x) => x / 255);
}

export function css(colour) {
  return `rgb(${colour.map((x) => Math.round(255 * x)).join(" ")})`;
}

function lightness([r, g, b]) { return 0.2126 * r ** 2.2 + 0.7152 * g ** 2.2 + 0.0722 * b ** 2.2; }

// The colours of the scale, from low to high; the end that would vanish in the ground is left out.
export function scale(dark) {
  const all = VIRIDIS.map(parsed), [from, to] = dark ? [0.33, 1] : [0, 0.84];
  return Array.from({ length: STOPS }, (_, k) => {
    const x = (from + (to - from) * k / (STOPS - 1)) * (all.length - 1), i = Math.min(Math.floor(x), all.length - 2);
    return all[i].map((c, j) => c + (x - i) * (all[i + 1][j] - c));
  });
}

export function inScale(stops, x) {
  const y = Math.max(0, Math.min(1, x)) * (stops.length - 1), i = Math.min(Math.floor(y), stops.length - 2);
  return stops[i].map((c, j) => c + (y - i) * (stops[i + 1][j] - c));
}

// A body's colour, lightened or darkened until it stands out.
export function legible(hex, dark) {
  let colour = parsed(hex);
  for (let k = 0; k < 20; k++) {
    const y = lightness(colour);
    if (dark ? y >= 0.24 : y <= 0.26) break;
    colour = colour.map((x) => (dark ? x + 0.08 * (1 - x) : 0.94 * x));
  }
  return colour;
}
