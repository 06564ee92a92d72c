"""The picture of a plot that goes on with time: what is painted piece by piece is what would be painted at once."""

import json

import pytest

from tests import browser
from tests.tools.panel.test_page import page_of, served

pytestmark = pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")

# Columns of 10 ms, 60 of them, 40 pixels high. The first channel has extremes, one of each column; the second samples,
# one in 4 ms, with lines between. Both have a gap, from 0.95 to 1.05 s.
PROGRAM = """
(() => {
  const { makeStrip } = window.strip, COLUMNS = 60, WIDTH = 0.01, PERIOD = 0.004;
  const there = (t) => !(t > 0.95 && t < 1.05);
  const wave = (t) => Math.sin(9 * t) + 0.5 * Math.sin(171 * t);
  const extremes = (first, last) => {
    const x = [], low = [], high = [];
    for (let c = first; c <= last; c++) {
      x.push(c * WIDTH);
      low.push(there(c * WIDTH) ? wave(c * WIDTH) - 0.3 : NaN);
      high.push(there(c * WIDTH) ? wave(c * WIDTH) + 0.2 * (c % 3) : NaN);
    }
    return { x, low, high };
  };
  const samples = (begin, end) => {
    const x = [], low = [];
    for (let n = Math.max(0, Math.ceil(begin / PERIOD - 1e-6) - 1); n * PERIOD <= end + 1e-9; n++) {
      x.push(n * PERIOD);
      low.push(there(n * PERIOD) ? wave(n * PERIOD + 1) : NaN);
    }
    return { x, low, high: null };
  };
  const of = (first, last) => [extremes(first, last), samples(first * WIDTH, last * WIDTH)];
  const pen = (colour, dash, most) => ({ colour, dash, least: -2, most });
  const pens = (most) => [pen("#1f6fb2", "-", most), pen("#d9731a", "------      ", most)];
  const seen = (strip) => {
    const canvas = Object.assign(document.createElement("canvas"), { width: COLUMNS, height: 40 });
    const onto = canvas.getContext("2d");
    strip.show(onto, 0, 0);
    return onto.getImageData(0, 0, COLUMNS, 40).data;
  };
  const atOnce = (last, most) => {
    const strip = makeStrip(2, COLUMNS, WIDTH, 1, 40);
    strip.take(of(Math.max(0, last - COLUMNS), last), last * WIDTH);
    strip.paint(pens(most));
    return seen(strip);
  };
  const same = (one, other) => one.every((value, k) => value === other[k]);
  const told = { different: [], painted: 0, gap: null, before: null };
  const strip = makeStrip(2, COLUMNS, WIDTH, 1, 40);
  for (let last = 70, step = 0, sent = 10; last <= 190; sent = last, last += [1, 3, 7, 0, 2, 65][step++ % 6]) {
    const most = last < 120 ? 2 : 3;
    if (last >= 120 && sent < 120) strip.spoil();   // another scale: all anew
    if (sent === 81) { strip.stretch(50); strip.paint(pens(most)); strip.stretch(40); }
    strip.take(of(Math.max(0, sent - 5, last - COLUMNS), last), last * WIDTH);
    strip.paint(pens(most));
    const now = seen(strip);
    if (!same(now, atOnce(last, most))) told.different.push(last);
    told.painted += now.some((value) => value) ? 1 : 0;
  }
  const column = (data, c) => {
    let count = 0;
    for (let y = 0; y < 40; y++) count += data[4 * (y * COLUMNS + c) + 3] ? 1 : 0;
    return count;
  };
  const gap = atOnce(110, 2);   // columns 51 to 110 are seen; nothing came in 96 to 104
  told.gap = [96, 100, 104].map((c) => column(gap, c - 51));
  told.before = [94, 107].map((c) => column(gap, c - 51));
  const numbers = makeStrip(1, 4, 1, 1, 8);
  numbers.take([{ x: [0, 1, 2, 3], low: [1, -5, 2, 0], high: [2, -4, 9, 0] }], 3);
  told.extremes = numbers.extremes(0);
  numbers.take([{ x: [7, 8], low: [1, 3], high: [1, 3] }], 8);
  told.later = [numbers.extremes(0), numbers.end()];
  return JSON.stringify(told);
})()
"""


def test_what_is_painted_piece_by_piece_is_what_would_be_painted_at_once(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("time_s,hip_rad\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(300)), encoding="utf-8")
    with served(str(log)) as (address, _), page_of(address, tmp_path) as page:
        page.value("void import('/strip.js').then((found) => { window.strip = found; })")
        page.until("window.strip !== undefined")
        reported = json.loads(page.value(PROGRAM))
    assert reported["different"] == [] and reported["painted"] > 10
    assert reported["gap"] == [0, 0, 0] and min(reported["before"]) > 0
    assert reported["extremes"] == [-5, 9]
    assert reported["later"] == [[1, 3], 9]  # what is no longer seen does not stretch the axis


# Level lines, each in a row of its own, of every pen of a plot: held they are uPlot's, while they go on the strip's. Of
# each the columns of a row are told that are drawn, not faint; a line between two rows has half of its colour in each.
DASHES = """
(() => {
  const { plots } = window.rangerPanel, [plot] = plots.wanted(), END = 2;
  const rows = () => {
    const { chart } = plot, { left, width } = chart.bbox;
    chart.axes.forEach((axis) => { axis.grid.show = false; });
    chart.redraw(false);
    chart.batch(() => {});
    return plot.numbers.map((number, k) => {
      const y = Math.round(chart.valToPos(k, "1", true));
      const { data } = chart.ctx.getImageData(left, y - 1, width, 3);
      let row = "";
      const opaque = (c) => Math.max(...[0, 1, 2].map((r) => data[4 * (r * width + c) + 3]));
      for (let c = 4; c < width - 4; c++) row += opaque(c) > 100 ? "-" : " ";
      return row;
    });
  };
  const points = plots.points(plot, true), x = [0, 1, END];
  const found = plot.numbers.map((channel, k) => ({ channel, x, low: [k, k, k], high: null }));
  const shown = (follows) => {
    plots.show({ place: 0, end: END, span: 1.5, points, anew: true, follows, found });
    return rows();
  };
  const strip = shown(true), { min, max } = plot.chart.scales.x;
  plots.show({ place: 0, end: max, span: max - min, points, anew: true, follows: false, found });
  return JSON.stringify({ strip, uplot: rows() });
})()
"""


def test_a_dash_is_the_same_while_a_plot_goes_on_and_while_it_is_held(tmp_path):
    names = [f"level_{k}" for k in range(48)]
    log = tmp_path / "log.csv"
    rows = (f"{t / 100}," + ",".join(map(str, range(48))) for t in range(300))
    log.write_text("\n".join([",".join(["time_s", *names]), *rows]) + "\n", encoding="utf-8")
    with served(str(log)) as (address, _), page_of(f"{address}#plots={','.join(names)}", tmp_path) as page:
        page.until("window.rangerPanel.plots.wanted()[0]?.drawn > 0")
        reported = json.loads(page.value(DASHES))
    assert reported["strip"] == reported["uplot"]
    assert len(set(reported["strip"])) == 6 and set(reported["strip"][0]) == {"-"}
    assert all(len(set(reported["strip"][k : k + 8])) == 1 for k in range(0, 48, 8))  # eight colours, one dash
