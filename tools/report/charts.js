// Draws the charts by Plotly and marks the cursor's time in each of them.
// walk: `series` arrays over `series.time_s` [s since power-up], `steps` done by then, `states` {machine: {names, runs
// [[since, number]]}}, `charts` as charts.py describes them, `decimals`: those of each unit. colour(name): of the page's
// style. onPoint(seconds, gone): the pointer is on a time, or has left.
function makeCharts(walk, colour, onPoint) {
  const time = walk.series.time_s, first = time[0], last = time[time.length - 1];
  const PX_PER_S = 180;     // a state of 0.1 s is wide enough for its name
  const LEAST_S = 0.05;     // of a view
  const LABEL_PX = 15;      // a state so wide has its name in it
  const coarse = window.matchMedia("(pointer: coarse)").matches;
  const charts = walk.charts.map((spec) => {
    const figure = document.getElementById("chart-" + spec.key);
    const plot = figure.querySelector(".plot");
    return { spec, plot, mark: figure.querySelector(".mark"), values: [...figure.querySelectorAll("[data-line]")],
             chips: [...figure.querySelectorAll("[data-state]")], lines: spec.lines.map(
               (line) => ({ ...line, x: numbers(line.x), y: numbers(line.y) })) };
  });
  const timed = charts.filter((chart) => chart.spec.kind === "time");
  let view = { from: first, to: last }, changing = false;

  function numbers(x) { return typeof x === "string" ? walk.series[x] : x; }

  // index of the last entry that is not above `value`
  function before(sorted, value) {
    let low = 0, high = sorted.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (sorted[middle] <= value) low = middle; else high = middle;
    }
    return low;
  }

  function stateAt(machine, seconds) {
    const runs = walk.states[machine].runs;
    return runs.length ? runs[before(runs.map((run) => run[0]), seconds)][1] : null;
  }

  function usualSpan() {
    const room = timed.length ? timed[0].plot.clientWidth - 70 : 700;
    return Math.min(last - first, Math.max(1.2, room / PX_PER_S));
  }

  function bands(chart) {
    if (!chart.spec.machine) return [];
    const { names, runs } = walk.states[chart.spec.machine];
    const pxPerS = (chart.plot.clientWidth - 70) / (view.to - view.from);
    return runs.map(([from, number], k) => [from, k + 1 < runs.length ? runs[k + 1][0] : last, number])
      .filter(([from, to]) => to > view.from && from < view.to)
      .map(([from, to, number]) => {
        const x0 = Math.max(from, view.from), x1 = Math.min(to, view.to);
        const text = (x1 - x0) * pxPerS >= LABEL_PX ? names[number] : "";
        return { type: "rect", xref: "x", yref: "paper", x0, x1, y0: 0, y1: 1, layer: "below", line: { width: 0 },
                 fillcolor: colour("state-" + number % 10),
                 label: { text, textangle: -90, textposition: "top left", xanchor: "right", yanchor: "top", padding: 2,
                          font: { size: 10, color: colour("ink") } } };
      });
  }

  function axis(text, more) {
    return { title: { text, standoff: 6, font: { size: 12 } }, gridcolor: colour("line"), zerolinecolor: colour("line"),
             linecolor: colour("line"), tickfont: { size: 11 }, fixedrange: true, automargin: true, nticks: 6, ...more };
  }

  function layout(chart) {
    const { spec, plot } = chart, kind = spec.kind;
    const made = {
      height: spec.height, width: plot.clientWidth, margin: { l: 56, r: 12, t: 6, b: 40 }, showlegend: false,
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: colour("ink"), size: 12 },
      hovermode: kind === "slots" ? "closest" : false, dragmode: kind === "time" && !coarse ? "zoom" : false,
      xaxis: axis(spec.x_title), yaxis: axis(spec.y_title, spec.from_zero ? { rangemode: "tozero" } : {}),
    };
    if (kind === "time") {
      Object.assign(made.xaxis, { range: [view.from, view.to], fixedrange: coarse, automargin: false,
                                  nticks: Math.max(3, plot.clientWidth / 90) });
      made.yaxis.automargin = false;     // so that a time is at the same place in all of them
      made.shapes = bands(chart);
    } else if (kind === "slots") {
      Object.assign(made.yaxis, { autorange: "reversed", dtick: 1 });
      Object.assign(made.xaxis, { range: [0, 107], dtick: plot.clientWidth < 600 ? 20 : 10 });
      made.shapes = [{ type: "line", x0: 100, x1: 100, yref: "paper", y0: 0, y1: 1,
                       line: { color: colour("bad"), dash: "dash" } }];
    }
    return made;
  }

  function traces(chart) {
    if (chart.spec.kind === "slots") return [heat(chart)];
    return chart.lines.map((line) => ({
      type: "scatter", x: line.x, y: line.y, hoverinfo: "skip", mode: line.points ? "markers" : "lines",
      line: { color: colour(line.colour), width: 1.5 }, marker: { color: colour(line.colour), size: 5 },
    }));
  }

  function heat(chart) {
    const lines = chart.lines, wide = chart.plot.clientWidth >= 720;
    return {
      type: "heatmap", x: lines[0].x, y: lines.map((line) => line.name), customdata: lines.map((line) => line.y),
      z: lines.map((line) => line.y.map((share) => share > 0 ? Math.log10(share) : null)), zmin: -4, zmax: 2.6,
      text: lines.map((line) => line.y.map((share) => share > 0 ? String(share) : "")),
      texttemplate: wide ? "%{text}" : "", textfont: { size: 11 }, showscale: false, xgap: 2, ygap: 4,
      colorscale: [[0, colour("heat-low")], [1, colour("heat-high")]],
      hovertemplate: "%{y}: %{customdata} % of the slots took about %{x} % of their length<extra></extra>",
    };
  }

  // All charts anew: for another width or other colours.
  async function draw() {
    const from = Math.max(first, Math.min(view.from, last - usualSpan()));
    view = { from, to: from + usualSpan() };
    changing = true;
    for (const chart of charts) {
      await Plotly.react(chart.plot, traces(chart), layout(chart), { displayModeBar: false, doubleClick: false });
      chart.plot.append(chart.mark);
    }
    changing = false;
  }

  // The same stretch of time in all charts over time.
  async function show(from, to) {
    const span = Math.min(last - first, Math.max(LEAST_S, to - from));
    from = Math.max(first, Math.min(from, last - span));
    view = { from, to: from + span };
    changing = true;
    await Promise.all(timed.map((chart) =>
      Plotly.relayout(chart.plot, { "xaxis.range": [view.from, view.to], shapes: bands(chart) })));
    changing = false;
  }

  function place(chart, x, y) {
    const { xaxis, yaxis, _size: size } = chart.plot._fullLayout;
    const left = xaxis._offset + xaxis.d2p(x), inside = left >= xaxis._offset - 1 && left <= xaxis._offset + xaxis._length + 1;
    chart.mark.hidden = !inside;
    if (y === null) {
      chart.mark.className = "mark line";
      chart.mark.style.height = yaxis._length + "px";
      chart.mark.style.transform = `translate(${left}px, ${size.t}px)`;
    } else {
      chart.mark.className = "mark dot";
      chart.mark.style.transform = `translate(${left}px, ${yaxis._offset + yaxis.d2p(y)}px)`;
    }
  }

  // Mark the time in every chart, and show the values there.
  function mark(seconds, i) {
    if (!changing && (seconds < view.from || seconds > view.to)) show(seconds, seconds + view.to - view.from);
    for (const chart of charts) {
      const kind = chart.spec.kind;
      if (!chart.plot._fullLayout || kind === "slots") continue;
      if (kind === "steps") place(chart, walk.steps[i], null);
      else if (kind === "plane") place(chart, chart.lines[0].x[i], chart.lines[0].y[i]);
      else place(chart, seconds, null);
      if (kind === "time") {
        chart.lines.forEach((line, k) => {
          const value = line.y[before(line.x, seconds)];
          chart.values[k].textContent = value === null ? "" : value.toFixed(walk.decimals[line.unit]) + " " + line.unit;
        });
        const state = chart.spec.machine ? stateAt(chart.spec.machine, seconds) : null;
        chart.chips.forEach((chip) => chip.classList.toggle("on", chip.dataset.state === String(state)));
      }
    }
  }

  // The time under the pointer, or null.
  function pointed(chart, event) {
    const box = chart.plot.getBoundingClientRect(), { xaxis, yaxis } = chart.plot._fullLayout;
    const px = event.clientX - box.left - xaxis._offset, py = event.clientY - box.top - yaxis._offset;
    if (px < 0 || px > xaxis._length || py < 0 || py > yaxis._length) return null;
    if (chart.spec.kind === "time") return Math.max(first, Math.min(last, xaxis.p2d(px)));
    if (chart.spec.kind === "steps") {
      const i = walk.steps.indexOf(Math.round(xaxis.p2d(px)));
      return i < 0 ? null : time[i];
    }
    let nearest = null, least = Infinity;
    chart.lines[0].x.forEach((x, i) => {
      const far = (xaxis.d2p(x) - px) ** 2 + (yaxis.d2p(chart.lines[0].y[i]) - py) ** 2;
      if (far < least) { least = far; nearest = time[i]; }
    });
    return nearest;
  }

  for (const chart of charts) {
    if (chart.spec.kind === "slots") continue;
    const point = (event) => {
      if (!chart.plot._fullLayout) return;
      const seconds = pointed(chart, event);
      if (seconds !== null) onPoint(seconds, false);
    };
    chart.plot.addEventListener("pointermove", point, true);
    chart.plot.addEventListener("pointerdown", point, true);
    chart.plot.addEventListener("pointerleave", () => onPoint(null, true));
  }

  function listen() {
    for (const chart of timed) {
      chart.plot.on("plotly_relayout", (change) => {
        if (!changing && "xaxis.range[0]" in change) show(change["xaxis.range[0]"], change["xaxis.range[1]"]);
      });
      chart.plot.on("plotly_doubleclick", () => show(view.from, view.from + usualSpan()));
    }
  }

  return { draw, mark, listen, stateAt, before };
}
