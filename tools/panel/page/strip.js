// What a plot that goes on with time shows: of every channel and column of pixels the lowest and the highest value.
// Column c is the time from c to c + 1 columns; it stays where it is, so only what is new is worked out and painted.
import { fainter, isDrawn } from "./pens.js";

const ROUNDING = 1e-6;   // of a column: a time that should be its beginning may be a hair before it

// The numbers: `columns` newest columns of each of `channels`, in rings. NaN: nothing came.
export function makeColumns(channels, columns, column_s) {
  const low = [], high = [];
  for (let k = 0; k < channels; k++) {
    low.push(new Float32Array(columns).fill(NaN));
    high.push(new Float32Array(columns).fill(NaN));
  }
  let head = null;   // the newest column
  const of = (time) => Math.floor(time / column_s + ROUNDING);

  function clear(k, first, last) {
    for (let c = Math.max(first, last - columns + 1); c <= last; c++) low[k][c % columns] = high[k][c % columns] = NaN;
  }

  function widen(k, c, least, most) {
    if (c <= head - columns || c > head || c < 0) return;
    const at = c % columns;
    if (!(low[k][at] <= least)) low[k][at] = least;
    if (!(high[k][at] >= most)) high[k][at] = most;
  }

  // Samples, with straight lines between them.
  function lines(k, x, y) {
    for (let j = 0; j < x.length; j++) {
      if (y[j] !== y[j]) continue;
      const c = of(x[j]);
      widen(k, c, y[j], y[j]);
      if (j === 0 || y[j - 1] !== y[j - 1]) continue;
      const before = Math.max(of(x[j - 1]), head - columns);
      for (let edge = before + 1; edge <= c; edge++) {
        const share = Math.min(1, Math.max(0, (edge * column_s - x[j - 1]) / (x[j] - x[j - 1]))), there = y[j - 1] + (y[j] - y[j - 1]) * share;
        widen(k, edge - 1, there, there);
        widen(k, edge, there, there);
      }
    }
  }

  // Extremes; each lasts until the next begins.
  function spans(k, x, least, most) {
    for (let j = 0; j < x.length; j++) {
      if (least[j] !== least[j]) continue;
      const first = of(x[j]), end = j + 1 < x.length ? of(x[j + 1]) : first;
      widen(k, first, least[j], most[j]);
      for (let c = Math.max(first + 1, head - columns + 1); c < end; c++) widen(k, c, least[j], most[j]);
    }
  }

  // A trace of each channel, until `end` (s). Each holds from its first point on; the column in which that stands has
  // the points before it as well. Returns the first column that may be another than it was.
  function take(found, end) {
    const before = head ?? of(end);
    head = Math.max(0, of(end));
    let changed = Math.max(0, Math.min(before, head));
    found.forEach(({ x, low: least, high: most }, k) => {
      clear(k, before + 1, head);
      if (!x.length) return;
      const first = Math.max(0, of(x[0]));
      changed = Math.min(changed, first);
      clear(k, first + 1, head);
      if (most) spans(k, x, least, most);
      else lines(k, x, least);
    });
    return Math.max(changed, first_shown());
  }

  const first_shown = () => Math.max(0, head - columns + 1);

  function extremes(k) {
    let least = Infinity, most = -Infinity;
    for (const value of low[k]) if (value < least) least = value;
    for (const value of high[k]) if (value > most) most = value;
    return [least, most];
  }

  return { take, extremes, columns, column_s, head: () => head, first: first_shown, low: (k, c) => low[k][c % columns], high: (k, c) => high[k][c % columns] };
}

// Their picture, a ring as well, kept off the screen: `wide` pixels for a column, `tall` pixels high.
export function makeStrip(channels, columns, column_s, wide, tall) {
  const numbers = makeColumns(channels, columns + 1, column_s);   // one more than is seen, which the first one reaches
  const canvas = document.createElement("canvas"), seen = () => Math.max(0, numbers.head() - columns + 1);
  canvas.width = Math.max(1, columns * wide);
  canvas.height = Math.max(1, tall);
  const context = canvas.getContext("2d");
  let stale = 0;   // the first column that is not painted as it is now

  // Each column reaches the one before it, so that a line has no holes. `pens`: of each channel {colour, dash, least, most},
  // what it is drawn with (pens.js) and the values at the bottom and the top.
  function paint(pens) {
    const head = numbers.head();
    for (let c = Math.max(stale, seen()); c <= head;) {   // in pieces that do not cross the ring's end
      const end = Math.min(head + 1, c - c % columns + columns);
      piece(pens, c, end);
      c = end;
    }
    stale = head + 1;
  }

  function piece(pens, begin, end) {
    const left = begin % columns * wide;
    context.clearRect(left, 0, (end - begin) * wide, canvas.height);
    pens.forEach((pen, k) => {
      const scale = canvas.height / (pen.most - pen.least), there = begin > numbers.first();
      let least_before = there ? numbers.low(k, begin - 1) : NaN, most_before = there ? numbers.high(k, begin - 1) : NaN;
      const faint = fainter(pen.colour);
      let from = begin, top = NaN, bottom = NaN, colour = pen.colour;   // columns that look alike are one rectangle
      const fill = (until) => {
        if (top === top) {
          context.fillStyle = colour;
          context.fillRect(left + (from - begin) * wide, top - wide / 2, (until - from) * wide, bottom - top + wide);
        }
        from = until;
      };
      for (let c = begin; c < end; c++) {
        const least = numbers.low(k, c), most = numbers.high(k, c);
        const y = (pen.most - (least_before > most ? least_before : most)) * scale, y2 = (pen.most - (most_before < least ? most_before : least)) * scale;
        const shade = isDrawn(pen.dash, c) ? pen.colour : faint;
        if (y !== top || y2 !== bottom || shade !== colour) { fill(c); top = y; bottom = y2; colour = shade; }
        least_before = least;
        most_before = most;
      }
      fill(end);
    });
  }

  // On another canvas, its newest column ending `columns` columns right of `left`.
  function show(onto, left, top) {
    const seam = (numbers.head() + 1) % columns * wide, rest = canvas.width - seam;
    if (rest) onto.drawImage(canvas, seam, 0, rest, canvas.height, left, top, rest, canvas.height);
    if (seam) onto.drawImage(canvas, 0, 0, seam, canvas.height, left + rest, top, seam, canvas.height);
  }

  return {
    paint, show, columns, column_s, wide, canvas,
    extremes: numbers.extremes,
    end: () => (numbers.head() + 1) * column_s,
    take: (found, end) => { stale = Math.min(stale, numbers.take(found, end)); },
    spoil: () => { stale = 0; },
    stretch: (to) => { if (canvas.height !== to) { canvas.height = to; stale = 0; } },   // a canvas of another size is empty
  };
}
