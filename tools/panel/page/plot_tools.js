// The tools above the plots: hold, window, another plot, saving of data and of a picture; and the note below them.
import { download } from "./download.js";
import { by, put } from "./renew.js";
import { drawn, isLive, range } from "./state.js";
import { linkState } from "./tables.js";
import { colour } from "./theme.js";

export function makePlotTools({ state, update, subscribe }, plots) {
  subscribe(["hello"], (now) => {
    by("freeze").hidden = !isLive(now);
    by("names").replaceChildren(...now.hello.channels.map((channel) => Object.assign(document.createElement("option"), { value: channel.name })));
  });
  subscribe(["held"], ({ held }) => {
    by("freeze").setAttribute("aria-pressed", String(!!held));
    by("freeze").textContent = held ? "Go on" : "Hold";
  });
  subscribe(["hello", "width_s"], ({ width_s }) => { by("span").value = String(width_s); });
  subscribe(["hello", "robot"], ({ robot }) => {
    const left_out = Object.entries(robot.left_out ?? {}).map(([name, rows]) => `${rows} rows of ${name}`);
    if (robot.link) put(by("readout"), linkState(robot.link));
    else if (left_out.length) put(by("readout"), `left out because this program was too slow: ${left_out.join(", ")}`);
  });
  by("freeze").onclick = update.holdOrFollow;
  by("span").onchange = () => update.setWidth(Number(by("span").value));
  by("add-plot").onclick = update.addPlot;
  for (const kind of ["csv", "mf4"]) by(`save-${kind}`).onclick = () => {
    const { begin, end } = range(state());
    by(`save-${kind}`).href = `export/${kind}?${new URLSearchParams({ channels: drawn(state()).join(","), begin, end })}`;
  };
  by("picture").onclick = () => savePicture(plots.wanted().filter((plot) => plot.chart).map((plot) =>
    [plot.chart.ctx.canvas, plot.numbers.map((each) => state().hello.channels[each].name).join(", ")]));
}

// charts: of each its canvas and its title
function savePicture(charts) {
  if (!charts.length) return;
  const all = document.createElement("canvas"), title = 26;
  all.width = Math.max(...charts.map(([canvas]) => canvas.width));
  all.height = charts.reduce((sum, [canvas]) => sum + canvas.height + title, 0);
  const context = all.getContext("2d");
  context.fillStyle = colour("paper");
  context.fillRect(0, 0, all.width, all.height);
  let y = 0;
  for (const [canvas, names] of charts) {
    context.fillStyle = colour("ink");
    context.font = "16px system-ui, sans-serif";
    context.fillText(names, 10, y + 19);
    context.drawImage(canvas, 0, y + title);
    y += canvas.height + title;
  }
  all.toBlob((blob) => download("plots.png", blob));
}
