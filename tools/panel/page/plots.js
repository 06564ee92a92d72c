// The plots: an axis for each unit, one cursor for all. uPlot shows a held window; while a plot goes on with time, uPlot
// has its axes and cursor, and strip.js its lines.
import { bind } from "./keys.js";
import { colourOf, dashOf, inkOf, swatch } from "./pens.js";
import { put } from "./renew.js";
import { drawn } from "./state.js";
import { makeStrip } from "./strip.js";
import { colour, onOtherColours } from "./theme.js";
import { extremes, plotWords, title, valueWords } from "./words.js";

const HEIGHT = 230, MOST_AXES = 4, AXIS_PX = 62, MOST_POINTS = 4000;
const TIGHTER = 0.5;    // an axis stays as it is until what is seen leaves it, or needs less than this share of it
const READABLE_MS = 150;    // between two figures at one place
const DESCRIBED_MS = 1000;  // between two of a plot's descriptions in words

export function makePlots({ state, update, subscribe }, box) {
  // Of each plot of the state, in its order: its id, its channels (numbers), and what draws it.
  let plots = [];
  let dragged = null;    // the plot that a channel is dragged out of
  let pointed;           // where uPlot itself has placed the cursors, by the mouse; undefined: it has not
  let figures_ms = 0, described_ms = 0;   // when the figures, and the descriptions, were last written

  const channels = () => state().hello.channels;

  subscribe(["plots", "chosen"], (now, before) => {
    if (now.plots !== before.plots) arrange(now.plots);
    for (const { id, element } of plots) {
      element.classList.toggle("chosen", id === now.chosen);
      element.querySelector(".which").setAttribute("aria-pressed", String(id === now.chosen));
    }
  });
  subscribe(["view"], ({ view }) => { if (view === "plots") resize(); });
  subscribe(["cursor_s"], ({ cursor_s }) => {
    if (cursor_s === pointed) return;
    pointed = undefined;
    for (const { chart } of plots) if (chart) placeCursor(chart);
  });
  subscribe(["mark_s", "notes"], redraw);
  subscribe(["plots", "cursor_s", "mark_s", "at_cursor", "at_mark"], () => values());
  subscribe(["pictures"], () => values(performance.now()));
  onOtherColours(restyle);

  // A plot for each of the state. What is above a plot is only replaced when its channels or its place changed: a click on it may be under way.
  function arrange(wanted) {
    const before = plots;
    for (const plot of before) if (!wanted.some(({ id }) => id === plot.id)) remove(plot);
    plots = wanted.map(({ id, channels: numbers }) => before.find((plot) => plot.id === id) ?? made(id, numbers));
    plots.forEach((plot, place) => {
      const is_same = plot === before[place] && plot.numbers === wanted[place].channels;
      plot.numbers = wanted[place].channels;
      if (!is_same) head(plot);
    });
  }

  function made(id, numbers) {
    const element = document.createElement("div");
    element.className = "plot";
    element.setAttribute("role", "group");
    element.innerHTML = '<div class="head"></div><div class="chart" role="img"></div>';
    const plot = { id, element, numbers, pens: new Map(), chart: null, signature: "", found: null, strip: null, ranges: {}, drawn: 0 };
    element.addEventListener("dragover", (event) => { event.preventDefault(); element.classList.add("over"); });
    element.addEventListener("dragleave", () => element.classList.remove("over"));
    element.addEventListener("drop", (event) => {
      event.preventDefault();
      element.classList.remove("over");
      const number = parseInt(event.dataTransfer.getData("text/plain"), 10), from = dragged;
      dragged = null;
      if (from) update.moveChannel(number, from.id, id);
      else if (Number.isInteger(number)) update.putChannel(id, number);
    });
    element.addEventListener("pointerdown", () => update.choosePlot(id));
    bindHead(plot);
    box.append(element);
    sizes.observe(element);
    return plot;
  }

  function remove(plot) {
    sizes.unobserve(plot.element);
    plot.chart?.destroy();
    plot.element.remove();
  }

  function close(plot) {
    update.closePlot(plot.id);
    chosen().element.querySelector(".which").focus();
  }

  const chosen = () => plots.find((plot) => plot.id === state().chosen);

  // Up and down lead a channel from plot to plot.
  function bindHead(plot) {
    const row = plot.element.querySelector(".head");
    const onChip = (act) => (event) => { const chip = event.target.closest(".chip"); return chip ? act(+chip.dataset.channel) : false; };
    const shift = (by) => onChip((number) => {
      const place = plots.indexOf(plot) + by;
      if (place < 0) return;
      update.moveChannel(number, plot.id, plots[place]?.id ?? null, true);
      chosen().element.querySelector(`[data-channel="${number}"]`)?.focus();
    });
    const out = onChip((number) => update.takeChannel(plot.id, number));
    bind("chip", row, { ArrowUp: shift(-1), ArrowDown: shift(1), Delete: out, Backspace: out });
  }

  const nameOf = (plot) => `plot ${plots.indexOf(plot) + 1}`;

  // The first that no other channel of the plot has; a channel keeps its own while it is there.
  function pen(plot, number) {
    const { pens, numbers } = plot;
    if (pens.has(number)) return pens.get(number);
    for (const each of pens.keys()) if (!numbers.includes(each)) pens.delete(each);
    const taken = new Set(pens.values());
    let free = 0;
    while (taken.has(free)) free++;
    pens.set(number, free);
    return free;
  }

  const shade = (plot, number) => colour(colourOf(pen(plot, number)));

  // What is above a plot. The focus stays at its place in the row.
  function head(plot) {
    const row = plot.element.querySelector(".head"), name = nameOf(plot);
    const focus = row.contains(document.activeElement) ? [...row.children].indexOf(document.activeElement) : -1;
    plot.element.setAttribute("aria-label", name);
    const which = button("which", String(plots.indexOf(plot) + 1), () => update.choosePlot(plot.id));
    which.title = "channels go into this plot";
    which.setAttribute("aria-label", `${name}: channels go here`);
    which.setAttribute("aria-pressed", String(plot.id === state().chosen));
    row.replaceChildren(which, ...plot.numbers.map((number) => chipOf(plot, number, name)));
    if (!plot.numbers.length) row.append(Object.assign(document.createElement("span"), { className: "note", textContent: "click a channel, or drag it here" }));
    const closer = button("close", "×", () => close(plot));
    closer.setAttribute("aria-label", `close ${name}`);
    row.append(closer);
    if (focus >= 0) row.querySelectorAll("button")[Math.min(focus, plot.numbers.length)].focus();
    if (!plot.numbers.length && plot.chart) { plot.chart.destroy(); plot.chart = null; plot.signature = ""; }
    if (plot.numbers.length) chartOf(plot);
  }

  function button(kind, text, act) {
    const made = Object.assign(document.createElement("button"), { type: "button", className: kind, textContent: text });
    made.onclick = act;
    return made;
  }

  function chipOf(plot, number, name) {
    const chip = button("chip", "", () => update.takeChannel(plot.id, number)), channel = channels()[number];
    chip.style.setProperty("--swatch", swatch(pen(plot, number)));
    chip.title = `${channel.description}; click to take it out`;
    chip.setAttribute("aria-label", `${title(channel)}: take it out of ${name}`);
    chip.innerHTML = "<i></i><span></span><b></b>";
    chip.children[1].textContent = title(channel);
    chip.dataset.channel = number;
    chip.draggable = true;
    chip.ondragstart = (event) => { dragged = plot; event.dataTransfer.setData("text/plain", String(number)); };
    chip.ondragend = () => { dragged = null; };
    return chip;
  }

  // The chart for these channels, built where it is missing or another.
  function chartOf(plot) {
    const signature = `${plot.numbers.join()} ${axesOf(plot)}`;
    if (!plot.chart || plot.signature !== signature) { plot.found = plot.strip = null; build(plot); plot.signature = signature; }
    return plot.chart;
  }

  // Two points of each bucket, low and high; NaN becomes null, where uPlot leaves a gap.
  function drawable({ x, low, high }) {
    const nulls = (values) => {
      for (let k = 0; k < values.length; k++) if (values[k] !== values[k]) return Array.from(values, (v) => v === v ? v : null);
      return values;
    };
    if (!high) return [x, nulls(low)];
    const count = x.length, xs = new Float64Array(2 * count), ys = new Float32Array(2 * count);
    const half = count > 1 ? (x[count - 1] - x[0]) / (count - 1) / 2 : 0;
    for (let k = 0; k < count; k++) {
      xs[2 * k] = x[k];
      xs[2 * k + 1] = x[k] + half;
      const rising = k > 0 && low[k] + high[k] >= low[k - 1] + high[k - 1];
      ys[2 * k] = rising ? low[k] : high[k];
      ys[2 * k + 1] = rising ? high[k] : low[k];
    }
    return [xs, nulls(ys)];
  }

  function joined(tables) {
    const [first] = tables;
    const same = tables.every(([x]) => x.length === first[0].length && x[0] === first[0][0] && x[x.length - 1] === first[0][x.length - 1]);
    return same ? [first[0], ...tables.map(([, y]) => y)] : uPlot.join(tables.map((table) => [table[0], table[1]]));
  }

  function units(plot) {
    return [...new Set(plot.numbers.map(unitOf))];
  }

  // So many axes that half of the width is left for the lines.
  const axesOf = (plot) => Math.max(1, Math.min(MOST_AXES, units(plot).length, Math.floor(width(plot) / 2 / AXIS_PX)));

  const unitOf = (number) => channels()[number].unit || "1";

  function build(plot) {
    plot.chart?.destroy();
    const scales = { x: { time: false } };
    const ink = colour("soft"), line = colour("line");
    const axes = [{ stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line }, values: (_, ticks) => ticks.map((each) => `${+each.toFixed(6)} s`) }];
    units(plot).forEach((unit, k) => {
      scales[unit] = { auto: true, range: (_, least, most) => plot.strip ? rangeOf(plot, unit) : uPlot.rangeNum(least ?? 0, most ?? 1, 0.1, true) };
      if (k < axesOf(plot)) axes.push({ scale: unit, side: k % 2 ? 1 : 3, stroke: ink, size: AXIS_PX, label: unit === "1" ? "" : unit, labelSize: 16, labelGap: 0,
        grid: { show: k === 0, stroke: line, width: 1 }, ticks: { stroke: line } });
    });
    const series = [{}, ...plot.numbers.map((number) => ({
      label: channels()[number].name, scale: unitOf(number), stroke: (chart) => striped(plot, number, chart), width: 1, points: { show: false }, spanGaps: false }))];
    const dot = (_, k) => shade(plot, plot.numbers[k - 1]);
    plot.chart = new uPlot({
      width: width(plot), height: HEIGHT, scales, axes, series, legend: { show: false },
      cursor: { drag: { x: true, y: false, setScale: false }, sync: { key: "time" }, y: false, points: { size: 6, stroke: dot, fill: dot } },
      hooks: {
        setCursor: [(chart) => {
          if (chart.cursor.event && chart.cursor.left >= 0) point(chart.posToVal(chart.cursor.left, "x"));
        }],
        setSelect: [(chart) => {
          if (chart.select.width > 3) {
            const begin = chart.posToVal(chart.select.left, "x"), end = chart.posToVal(chart.select.left + chart.select.width, "x");
            chart.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
            update.zoomTo(begin, end);
          }
        }],
        drawAxes: [(chart) => { if (plot.strip) lines(plot, chart); }],
        draw: [(chart) => marks(chart)],
      },
    }, nothing(plot), plot.element.querySelector(".chart"));
    plot.chart.batch(() => {});   // at once, so that its size is known
    plot.chart.over.addEventListener("dblclick", () => update.widen());
    plot.chart.over.addEventListener("click", (event) => { if (event.detail === 1 && state().cursor_s !== null) update.setMark(state().cursor_s); });
    plot.chart.over.addEventListener("mouseleave", () => point(null));
  }

  function point(time) {
    pointed = time;
    update.point(time);
  }

  // Of a held window, with its dashes where they are while it goes on.
  function striped(plot, number, chart) {
    const { min, max } = chart.scales.x, { left, width } = chart.bbox, middle = wide() % 2 / 2;   // uPlot moves such a line by half a pixel
    return inkOf(shade(plot, number), dashOf(pen(plot, number)), wide(), left - middle - min / (max - min) * width);
  }

  function marks(chart) {
    const { mark_s, notes } = state();
    if (mark_s !== null) upright(chart, mark_s, "bad", [6, 4], "");
    for (const { time, text } of notes) upright(chart, time, "warn", [2, 3], text);
  }

  function upright(chart, time, name, dash, text) {
    const x = chart.valToPos(time, "x", true), { ctx, bbox } = chart;
    if (!(x >= bbox.left && x <= bbox.left + bbox.width)) return;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = colour(name);
    ctx.setLineDash(dash);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.font = `${11 * (window.devicePixelRatio || 1)}px system-ui, sans-serif`;
    ctx.fillText(text, x + 4, bbox.top + 12 * (window.devicePixelRatio || 1));
    ctx.restore();
  }

  const width = (plot) => Math.max(200, plot.element.clientWidth - 10);

  const nothing = (plot) => [[], ...plot.numbers.map(() => [])];

  // What the server says of a plot (messages.py): a held window whole, of one that goes on all or what is new.
  function show({ place, end, span, points, anew, follows, found }) {
    const plot = wanted()[place];
    if (!plot || found.length !== plot.numbers.length || found.some((each, k) => each.channel !== plot.numbers[k])) return;
    const chart = chartOf(plot);
    if (follows && !anew && !plot.strip) return;   // it belongs to one before
    plot.found = found;
    if (!follows) {
      plot.strip = null;
      chart.batch(() => {
        chart.setData(joined(found.map(drawable)), true);
        chart.setScale("x", { min: end - span, max: end });
      });
      placeCursor(chart);
    } else {
      if (anew) {
        if (!plot.strip) chart.setData(nothing(plot), false);
        plot.strip = makeStrip(found.length, points, span / points, wide(), Math.round(chart.bbox.height));
      }
      plot.strip.take(found, end);
      ranges(plot);
      chart.setScale("x", shownBy(plot));
      chart.batch(() => {});
    }
    plot.drawn++;
  }

  // The chart's cursor, where it is in its window.
  function placeCursor(chart) {
    const { cursor_s } = state(), left = cursor_s === null ? -10 : chart.valToPos(cursor_s, "x");
    chart.setCursor(left >= 0 ? { left, top: 10 } : { left: -10, top: -10 }, false);
  }

  // A column of a strip is as wide as a line, in pixels of the screen.
  const wide = () => Math.max(1, Math.round(window.devicePixelRatio || 1));

  function shownBy(plot) {
    const max = plot.strip.end();
    return { min: max - plot.chart.bbox.width / plot.strip.wide * plot.strip.column_s, max };
  }

  // Of each unit, what its axis shows; where that is another, all is painted anew.
  function ranges(plot) {
    for (const unit of units(plot)) {
      let least = Infinity, most = -Infinity;
      plot.numbers.forEach((number, k) => {
        if (unitOf(number) !== unit) return;
        const [low, high] = plot.strip.extremes(k);
        least = Math.min(least, low);
        most = Math.max(most, high);
      });
      if (!(least <= most)) continue;
      const before = plot.ranges[unit], [min, max] = uPlot.rangeNum(least, most, 0.1, true);
      if (before && least >= before[0] && most <= before[1] && max - min >= TIGHTER * (before[1] - before[0])) continue;
      plot.ranges[unit] = [min, max];
      plot.strip.spoil();
    }
  }

  const rangeOf = (plot, unit) => plot.ranges[unit] ?? [0, 1];

  function lines(plot, chart) {
    plot.strip.stretch(Math.max(1, Math.round(chart.bbox.height)));   // it is known for good when the axes have their figures
    plot.strip.paint(plot.numbers.map((number) => {
      const [least, most] = rangeOf(plot, unitOf(number));
      return { colour: shade(plot, number), dash: dashOf(pen(plot, number)), least, most };
    }));
    const { left, top, width } = chart.bbox, { strip } = plot;
    chart.ctx.save();
    chart.ctx.beginPath();
    chart.ctx.rect(left, top, width, strip.canvas.height);
    chart.ctx.clip();
    strip.show(chart.ctx, Math.round(left + width) - strip.canvas.width, Math.round(top));
    chart.ctx.restore();
  }

  // Of a channel of a plot: the value at the cursor as the server has it, without a cursor the newest that is drawn;
  // undefined: it is on its way.
  function valueOf(plot, number) {
    const { cursor_s, at_cursor } = state();
    if (cursor_s !== null) return at_cursor.time === cursor_s ? at_cursor.values[number] ?? null : undefined;
    const trace = plot.found?.find((each) => each.channel === number);
    return trace && trace.low.length ? trace.low[trace.low.length - 1] : null;
  }

  function inWords(number, value) {
    const { cursor_s, mark_s, at_mark } = state();
    return valueWords(channels()[number], value, cursor_s !== null && mark_s !== null ? at_mark[number] ?? null : null);
  }

  // now: the page's clock, where figures change too quickly to be read; 0: at once
  function values(now = 0) {
    if (now && now - figures_ms < READABLE_MS) return;
    figures_ms = now;
    for (const plot of plots) {
      for (const chip of plot.element.querySelectorAll(".chip")) {
        const value = valueOf(plot, +chip.dataset.channel);
        if (value !== undefined) put(chip.children[2], inWords(+chip.dataset.channel, value));
      }
    }
    if (!now || now - described_ms >= DESCRIBED_MS) { described_ms = now; plots.forEach(describe); }
  }

  // The picture in words, for readers who do not see it.
  function describe(plot) {
    const { min, max } = plot.chart?.scales.x ?? {};
    const lines = plot.numbers.map((number, k) => {
      const trace = plot.found?.find((each) => each.channel === number);
      const [least, most] = plot.strip ? plot.strip.extremes(k) : trace ? extremes(trace) : [Infinity, -Infinity];
      return { channel: channels()[number], text: inWords(number, valueOf(plot, number)), least, most };
    });
    plot.element.querySelector(".chart").setAttribute("aria-label", plotWords(nameOf(plot), [min, max], state().cursor_s, lines));
  }

  // The values at the cursor in words; nothing while they are on their way.
  function atCursor() {
    const now = state(), { cursor_s, at_cursor } = now;
    if (cursor_s === null || at_cursor.time !== cursor_s) return "";
    return `${cursor_s.toFixed(3)} s. ${drawn(now).map((number) => `${title(channels()[number])}: ${inWords(number, at_cursor.values[number]) || "no value"}`).join("; ")}`;
  }

  function redraw() { for (const plot of plots) plot.chart?.redraw(false); }

  // True: one has another width now. One that another view hides keeps its own.
  function resize() {
    const others = plots.filter((plot) => plot.chart && plot.element.clientWidth && plot.chart.width !== width(plot));
    for (const { chart, element } of others) chart.batch(() => chart.setSize({ width: width({ element }), height: HEIGHT }));
    return others.length > 0;
  }

  const sizes = new ResizeObserver(() => { if (resize()) update.plotsResized(); });
  const wanted = () => plots.filter((plot) => plot.numbers.length);

  // Other colours: all is drawn anew as it is.
  function restyle() {
    for (const plot of wanted()) {
      const { strip, chart } = plot, [x, ...data] = chart.data, { min, max } = chart.scales.x;
      build(plot);
      strip?.spoil();
      plot.chart.batch(() => { plot.chart.setData([x, ...data], true); plot.chart.setScale("x", { min, max }); });
    }
  }

  // How many points a plot wants: one for each column that goes on, and of a held window, where each is two, for every other pixel.
  function points(plot, follows) {
    const pixels = follows ? chartOf(plot).bbox.width / wide() : Math.min(MOST_POINTS, width(plot)) / 2;
    return Math.max(10, Math.min(MOST_POINTS, Math.floor(pixels)));
  }

  return { all: () => plots, wanted, show, points, atCursor };
}
