// Figures and plots in words: next to names, and for users who have the page read aloud.

export const figure = (value) => {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (value === Math.round(value) && size < 1e7) return String(value);
  return size >= 1e5 || size < 1e-3 ? value.toExponential(3) : value.toPrecision(5);
};

// before: what stood at the mark; null: no difference is wanted
export function valueWords({ states }, value, before = null) {
  if (value === null || value === undefined) return "";
  const state = states[Math.round(value)];
  return state ?? figure(value) + (before === null ? "" : ` (Δ ${figure(value - before)})`);
}

export const title = ({ name, unit }) => name + (unit ? `, ${unit}` : "");

export function extremes({ low, high }) {
  let least = Infinity, most = -Infinity;
  for (const value of low) if (value < least) least = value;
  for (const value of high ?? low) if (value > most) most = value;
  return [least, most];
}

// A plot in words: its time, and of each line {channel, text, least, most} its value and between what it lies.
export function plotWords(name, window, at, lines) {
  const when = window[0] === null || window[0] === undefined ? "" : `, ${window[0].toFixed(1)} to ${window[1].toFixed(1)} s`;
  const told = lines.map(({ channel, text, least, most }) =>
    `${title(channel)}: ${text || "no value"}` + (least <= most ? `, between ${figure(least)} and ${figure(most)}` : ""));
  return `${name}${when}${at === null ? "" : `, at ${at.toFixed(3)} s`}. ${told.join("; ") || "empty"}`;
}
