// What lines are drawn with: as many colours as a reader can distinguish, also one who lacks a kind of cone (panel.css has them;
// tests/colours.py found them), and a dash for each time they are used up. A dash goes along time, not along its line.
export const COLOURS = 8;
const DASHES = [
  "------------------------",
  "--------    --------    ",
  "---   ---   ---   ---   ",
  "------------    ----    ",
  "------------------      ",
  "---         ---         ",
];   // of each column, whether it is drawn; else it is faint: no spike is lost
const FAINT = 0.25;

export const PERIOD = DASHES[0].length;
export const colourOf = (pen) => `plot-${pen % COLOURS + 1}`;
export const dashOf = (pen) => DASHES[Math.floor(pen / COLOURS) % DASHES.length];
export const isDrawn = (dash, column) => dash[column % dash.length] === "-";
export const fainter = (colour) => colour + Math.round(FAINT * 255).toString(16);   // of "#rrggbb"

// What uPlot strokes a line with: stripes, `wide` pixels each, as columns. Column 0 begins at `left`.
export function inkOf(colour, dash, wide, left) {
  if (!dash.includes(" ")) return colour;
  const tile = Object.assign(document.createElement("canvas"), { width: PERIOD * wide, height: 1 }), context = tile.getContext("2d");
  for (let c = 0; c < PERIOD; c++) {
    context.fillStyle = isDrawn(dash, c) ? colour : fainter(colour);
    context.fillRect(c * wide, 0, wide, 1);
  }
  const ink = context.createPattern(tile, "repeat");
  ink.setTransform(new DOMMatrix().translate(left % tile.width, 0));
  return ink;
}

// Next to a name, one period of its line: a background as CSS has it.
export function swatch(pen) {
  const colour = `var(--${colourOf(pen)})`, faint = `color-mix(in srgb, ${colour} ${100 * FAINT}%, transparent)`, dash = dashOf(pen);
  const pieces = [...dash].map((_, c) => `${isDrawn(dash, c) ? colour : faint} ${c}px ${c + 1}px`);
  return `linear-gradient(to right, ${pieces.join()})`;
}
