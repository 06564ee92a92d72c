// The colours of panel.css, light or dark as the reader prefers.

let known = {};

export const colour = (name) => known[name] ??= getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

export function onOtherColours(draw) {
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { known = {}; draw(); });
}
