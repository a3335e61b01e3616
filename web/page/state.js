// The settings of the page, in the fragment of its address.

export const DEFAULTS = {
  shape: "ellipse", aspect: 2, petals: 3, flow: "surface-diffusion", lambda: 0.5, waves: 4, eps: 0, steps: "adaptive",
  amplitude: 0.05, n: 100, curves: 100, seed: 1, points: "",
};

/** Numbers that are counts. */
const WHOLE = ["petals", "waves", "n", "curves", "seed"];

/** Points in the unit square as text: two digits of base 36 each for x and y. */
function packed(points) {
  const digits = (value) => Math.round(Math.min(1, Math.max(0, value)) * 1295).toString(36).padStart(2, "0");
  return points.map(([x, y]) => digits(x) + digits(y)).join("");
}

function unpacked(text) {
  const groups = text.match(/[0-9a-z]{4}/g) ?? [];
  return groups.map((group) => [group.slice(0, 2), group.slice(2)].map((pair) => parseInt(pair, 36) / 1295));
}

/** The text of a table without its header: a point a line. */
function lines(points) { return points.map((point) => point.map((value) => value.toFixed(4)).join(",")).join("\n"); }

/** The points of a table; lines that are none are left out. */
export function pointsOf(table) {
  const points = table.split("\n").map((line) => line.split(",").map(Number));
  return points.filter((point) => point.length === 2 && point.every(Number.isFinite));
}

/** A table that fits an address well. */
export function snapped(points) { return lines(unpacked(packed(points))); }

/** A table for an address, packed if nothing is lost; else as it is, after "=". */
export function coded(table) {
  const short = packed(pointsOf(table));
  return lines(unpacked(short)) === table.trim() ? short : `=${table.trim()}`;
}

export function decoded(text) { return text.startsWith("=") ? text.slice(1) : lines(unpacked(text)); }

/** Whether a key may have this number. */
export function holds(key, number) {
  return WHOLE.includes(key) ? Number.isSafeInteger(number) && number >= 0 : Number.isFinite(number);
}

/** Reads the fragment; what is missing or no number has its default. */
export function read() {
  const given = new URLSearchParams(location.hash.slice(1));
  const value = (key) => {
    const text = given.get(key), own = DEFAULTS[key];
    if (text === null || typeof own !== "number") return text ?? own;
    const number = text.trim() ? Number(text) : NaN;
    return holds(key, number) ? number : own;
  };
  return Object.fromEntries(Object.keys(DEFAULTS).map((key) => [key, value(key)]));
}

/** Writes what is not the default. */
export function write(state) {
  const changed = Object.entries(state).filter(([key, value]) => value !== DEFAULTS[key]);
  history.replaceState(null, "", `#${new URLSearchParams(changed)}`);
}
