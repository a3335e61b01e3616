// The settings of the page, in the fragment of its address.

export const DEFAULTS = {
  shape: "ellipse", aspect: 2, petals: 3, flow: "surface-diffusion", lambda: 0.5, steps: "adaptive",
  amplitude: 0.05, n: 100, curves: 100, seed: 1, points: "",
};

/** Points of a drawn outline as text that fits an address: two digits of base 36 each for x and y in the unit square. */
export function packed(points) {
  const digits = (value) => Math.round(Math.min(1, Math.max(0, value)) * 1295).toString(36).padStart(2, "0");
  return points.map(([x, y]) => digits(x) + digits(y)).join("");
}

export function unpacked(text) {
  const groups = text.match(/[0-9a-z]{4}/g) ?? [];
  return groups.map((group) => [group.slice(0, 2), group.slice(2)].map((pair) => parseInt(pair, 36) / 1295));
}

/** Reads the fragment; what is missing or no number has its default. */
export function read() {
  const given = new URLSearchParams(location.hash.slice(1));
  const value = (key) => {
    const text = given.get(key), own = DEFAULTS[key];
    if (text === null) return own;
    if (typeof own !== "number") return text;
    return Number.isFinite(Number(text)) && text.trim() ? Number(text) : own;
  };
  return Object.fromEntries(Object.keys(DEFAULTS).map((key) => [key, value(key)]));
}

/** Writes what is not the default. */
export function write(state) {
  const changed = Object.entries(state).filter(([key, value]) => value !== DEFAULTS[key]);
  history.replaceState(null, "", `#${new URLSearchParams(changed)}`);
}
