// Puts the page into motion: unpacks library and data, and moves one cursor through charts and animation.
(async function () {
  "use strict";
  const by = (id) => document.getElementById(id);

  async function unpacked(id) {
    const bytes = Uint8Array.from(atob(by(id).textContent.trim()), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  }

  if (!("DecompressionStream" in window)) {
    by("too-old").hidden = false;
    return;
  }
  const walk = JSON.parse(await unpacked("packed-walk"));
  const library = document.createElement("script");
  library.textContent = await unpacked("packed-plotly");
  document.head.append(library);

  const root = document.documentElement;
  const colour = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  let colours = {};
  const cached = (name) => colours[name] ?? (colours[name] = colour(name));

  const time = walk.series.time_s, first = time[0], last = time[time.length - 1];
  const speed = by("speed"), position = by("position"), play = by("play");
  let at = first, running = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  let held = false, previous = null;

  const stage = makeStage(by("stage"), walk, cached);
  const charts = makeCharts(walk, cached, (seconds, gone) => {
    held = !gone;
    if (!gone) setCursor(seconds);
  });
  position.max = time.length - 1;

  function setCursor(seconds) {
    at = Math.max(first, Math.min(last, seconds));
    const i = charts.before(time, at);
    stage.draw(i);
    charts.mark(at, i);
    by("clock").textContent = at.toFixed(3) + " s";
    position.value = i;
    position.setAttribute("aria-valuetext", at.toFixed(3) + " s after power-up");
    for (const [machine, series, motor] of [
      ["hip", "hip_rad", "hip_A"], ["outer_foot", "ankle_outer_rad", "outer_A"], ["inner_foot", "ankle_inner_rad", "inner_A"]]) {
      const now = by("now-" + machine), state = charts.stateAt(machine, at);
      now.querySelector(".state").textContent = state === null ? "" : walk.states[machine].names[state];
      now.querySelector(".state").style.background = state === null ? "" : cached("state-" + state % 10);
      now.querySelector(".angle").textContent = walk.series[series][i].toFixed(3) + " rad";
      const current = walk.series[motor][i];
      now.querySelector(".current").textContent = current.toFixed(2) + " A";
      const bar = now.querySelector(".bar i"), share = Math.min(50, Math.abs(current) * 5);   // full at 10 A
      bar.style.width = share + "%";
      bar.style.left = (current < 0 ? 50 - share : 50) + "%";
    }
  }

  function setRunning(on) {
    running = on;
    play.textContent = on ? "Pause" : "Play";
  }

  function tick(now) {
    if (running && !held && previous !== null) {
      const next = at + (now - previous) / 1000 * parseFloat(speed.value);
      setCursor(next > last ? first : next);
    }
    previous = now;
    window.requestAnimationFrame(tick);
  }

  // Arrows move the cursor by 10 ms, with Shift by 100 ms, wherever they have no other meaning.
  document.addEventListener("keydown", (event) => {
    const direction = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!direction || event.ctrlKey || event.altKey || event.metaKey || event.target.matches("select, input")) return;
    event.preventDefault();
    setRunning(false);
    setCursor(at + direction * (event.shiftKey ? 0.1 : 0.01));
  });
  play.onclick = () => setRunning(!running);
  position.oninput = () => { setRunning(false); setCursor(time[position.value]); };

  async function redraw() {
    colours = {};
    stage.resize();
    await charts.draw();
    setCursor(at);
    root.dataset.drawn = window.innerWidth;
  }

  setRunning(running);
  await redraw();
  charts.listen();
  let width = root.clientWidth, ratio = window.devicePixelRatio, drawing = Promise.resolve();
  window.addEventListener("resize", () => {
    if (width === root.clientWidth && ratio === window.devicePixelRatio) return;
    width = root.clientWidth;
    ratio = window.devicePixelRatio;
    drawing = drawing.then(redraw);
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { drawing = drawing.then(redraw); });
  window.requestAnimationFrame(tick);
  window.rangerReport = { cursor: () => at, setCursor, setRunning };
})();
