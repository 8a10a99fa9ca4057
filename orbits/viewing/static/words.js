// Numbers, times and dates as texts.

const DAY = 86400000, J2000 = Date.UTC(2000, 0, 1, 12);

export function figure(x, digits = 6) {
  if (!Number.isFinite(x)) return "–";
  const size = Math.abs(x);
  if (size !== 0 && (size < 1e-3 || size >= 1e7)) {
    const [front, power] = x.toExponential(digits - 1).split("e");
    return `${minus(front)} × 10${raised(Number(power))}`;
  }
  const text = x.toPrecision(digits);
  return minus(size === 0 ? "0" : text.includes("e") ? String(Number(text)) : text);
}

export function raised(power) {
  return String(power).replace(/[-0-9]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
}

export function withUnit(text, unit) { return unit ? `${text} ${unit}` : text; }

function minus(text) { return text.replace("-", "−"); }

// A time since the epoch in the unit that suits the run.
export function elapsed(header, time, digits = 2) {
  return withUnit(minus((time * header.units.factor).toFixed(digits)), header.units.shown);
}

// A date (TDB), to the minute for short runs; "" without an epoch, and outside of what Date knows.
export function date(header, time, minutes = false) {
  if (header.epoch === null || header.units.days === null) return "";
  const moment = new Date(J2000 + (header.epoch + time * header.units.days) * DAY);
  if (Number.isNaN(moment.getTime())) return "";
  const [day, clock] = moment.toISOString().split("T");
  return minutes ? `${day} ${clock.slice(0, 5)}` : day;
}

export function when(header, time, minutes = false) {
  return date(header, time, minutes) || `t = ${elapsed(header, time)}`;
}

export function element(kind, options = {}, ...children) {
  const made = document.createElement(kind);
  for (const [name, value] of Object.entries(options)) {
    if (name === "text") made.textContent = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== null && value !== false) made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}
