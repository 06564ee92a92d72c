// The page: what it shows is in the address, what comes from the server is handed to the parts.
import { makeChannelList } from "./channel_list.js";
import { connect } from "./connection.js";
import { makeFace } from "./face.js";
import * as keys from "./keys.js";
import { makeNotes } from "./notes.js";
import { download, makeParameters } from "./parameters.js";
import { makePlots } from "./plots.js";
import { put, reachable, renew } from "./renew.js";
import { makeStage } from "./stage.js";
import * as tables from "./tables.js";
import { figure } from "./words.js";

const by = (id) => document.getElementById(id);
const VALUES_MS = 500;
const MESSAGE_MS = 4000;
const QUIET_MS = 600;      // after the cursor's last step it is said what stands there
const OLD_MS = 1000;       // without a message or a newer value, what is shown is not live
const DESCRIBED_MS = 1000; // between two descriptions of the robot
const SHORTEST_S = 1e-3, LONGEST_S = 36_000;   // a plot's window
const FIRST = [["hip_rad", "ankle_outer_rad", "ankle_inner_rad"], ["hip_A", "outer_A", "inner_A"], ["FSM_HIP", "FSM_FO", "FSM_FI"]];
const FIRST_OF_A_LOG = [["MCH_ANGLE", "MCFO_RIGHT_ANKLE_ANGLE", "MCFI_MID_ANKLE_ANGLE"], ["MCH_MOTOR_CURRENT"], ["FSM_HIP"]];
const CURRENTS = [["hip", "hip_A", "hip"], ["outer ankle", "outer_A", "outer"], ["inner ankle", "inner_A", "inner"], ["steering", "steering_A", "steering"]];
const FULL_BAR_A = 10;

let colours = {};
const colour = (name) => colours[name] ??= getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

let hello = null, can = new Set(), number = new Map();
let span = [0, 0], held = null, window_s = 10, zooms = [], view = "plots", state = {}, pose = null;
let playing = false, played = null, at = null, trigger = null, shown = 0;

const stage = makeStage(by("stage"), colour);
const plots = makePlots(by("plots"), {
  changed: () => { look(); remember(); listDrawn(); atMark(); },
  chosen: () => listDrawn(),
  full: (most) => say(`${most} channels at a time are possible: take one out first`),
  resized: () => look(),
  cursor: (time) => { at = time; if (time === null && !can.has("live")) plots.setCursor(played); look(); },
  zoom: (begin, end) => { zooms.push(range()); hold([begin, end]); },
  widen: () => widen(),
  marked: () => { atMark(); look(); remember(); },
}, colour);
const channelList = makeChannelList(by("channels"), by("search"), (channel) => {
  const plot = plots.chosen();
  if (plot.numbers.includes(channel)) plots.take(plot, channel);
  else plots.put(plot, channel);
});
const listDrawn = () => channelList.drawn(plots.all().flatMap((plot) => plot.numbers), plots.chosen()?.numbers ?? []);
const notes = makeNotes(by("notes"), by("note"), {
  changed: (found) => { plots.setNotes(found); remember(); },
  go: (time) => { const half = (range().end - range().begin) / 2; plots.setMark(time); hold([time - half, time + half]); atMark(); },
});
const face = makeFace(by("face"), (key) => tell({ do: "key", key }, `key ${key} pressed`),
  (stick) => tell({ do: "radio", stick }, `radio stick at ${stick}`));
const parameters = makeParameters(by("parameter-groups"), {
  search: by("parameter-search"), changed: by("changed-only"), undo: by("undo"), save: by("save-set"), load: by("load-set"), compare: by("compare-set"),
  note: (text, bad) => { by("parameter-note").textContent = text; by("parameter-note").classList.toggle("bad", !!bad); },
}, (wish) => link.ask(wish));

const link = connect({
  hello: greet,
  picture: (found, lost) => { if (found[1] !== span[1]) newer_ms = performance.now(); span = found; shown++; light(lost); scrubber(); if (!held) triggered(); plots.values(performance.now()); },
  traces: (found) => plots.show(found),
  pose: (time, values) => { pose = values; by("clock").textContent = `${time.toFixed(3)} s`; stage.draw(values); bars(); describe(); },
  values: (found, time) => { if (time === instant()) { plots.stands(found, plots.cursor()); sayCursor(); } },
  state: (found) => { state = found; tell_state(); },
  closed: (reason, refused) => { document.body.dataset.connected = "no"; light(refused ? `refused: ${reason}` : `${reason}: trying again`); },
});

// ---- the beginning

function greet(found) {
  hello = found;
  can = new Set(hello.can);
  span = hello.span;
  number = new Map(hello.channels.map((channel, k) => [channel.name, k]));
  by("title").textContent = hello.title;
  document.title = `${hello.title} – panel`;
  plots.know(hello.channels);
  stage.know(hello);
  parameters.know(hello.parameters);
  const live = can.has("live");
  by("scrub").hidden = live;
  by("freeze").hidden = !live;
  by("pace").hidden = !can.has("pace");
  by("face").hidden = !can.has("panel");
  for (const [name, needs] of [["parameters", "parameters"], ["errors", "errors"], ["link", "link"], ["faults", "faults"]])
    document.querySelector(`[data-view=${name}]`).hidden = !can.has(needs);
  by("pose-note").textContent = hello.pose.includes("hip_y_m") ? "as its body is; inner legs hollow, contact forces thin" : hello.pose.length ? "as it estimates itself; inner legs hollow, the lower foot stands" : "no leg angles in this source";
  by("names").replaceChildren(...hello.channels.map((channel) => Object.assign(document.createElement("option"), { value: channel.name })));
  by("bars").replaceChildren(...CURRENTS.map(([name, , swatch]) => {
    const row = document.createElement("div");
    row.innerHTML = '<span></span><div class="bar"><i></i></div><span></span>';
    row.firstChild.textContent = name;
    row.style.setProperty("--swatch", `var(--${swatch})`);
    return row;
  }));
  faultForm();
  if (!plots.all().length) recall();
  if (!live) {
    hold(held ?? [span[0], Math.min(span[1], span[0] + window_s)]);
    goTo(played ?? held[0]);
  }
  channelList.know(hello.channels);
  listDrawn();
  document.body.dataset.connected = "yes";
  look();
}

// ---- what is looked at

const range = () => held ? { begin: held[0], end: held[1], follows: false } : { begin: span[1] - window_s, end: span[1], follows: true };

// Where robot, values, slots and frames stand: at the cursor; of a recording where it is played; at the mark, when the
// plots are held or another view hides them; null: at the newest.
const instant = () => at ?? (can.has("live") ? (held || view !== "plots" ? plots.mark() : null) : played);

async function atMark() {
  const time = plots.mark(), channels = [...new Set(plots.all().flatMap((plot) => plot.numbers))];
  if (time === null || !channels.length) return;
  try {
    const { values } = await link.ask({ do: "values", channels, at: time });
    plots.stoodAtMark(Object.fromEntries(channels.map((channel, k) => [channel, values[k]])));
  } catch { /* told by the light */ }
}

// Out of the last closer look; without one, twice as wide.
function widen() {
  const before = zooms.pop();
  if (!before) zoomBy(2);
  else hold(before.follows ? null : [before.begin, before.end]);
}

// The window by this factor, with the cursor where it is in it.
function zoomBy(factor) {
  const { begin, end } = range(), around = Math.min(end, Math.max(begin, instant() ?? (held ? (begin + end) / 2 : end)));
  const width = Math.min(LONGEST_S, Math.max(SHORTEST_S, (end - begin) * factor)), before = (around - begin) / (end - begin) * width;
  if (factor < 1) zooms.push(range());
  hold([around - before, around - before + width]);
}

// The plots' cursor, and the window with it where it would leave that.
function cursorTo(time) {
  const { begin, end } = range(), there = Math.min(span[1], Math.max(span[0], time)), by_s = Math.min(0, there - begin) + Math.max(0, there - end);
  if (!held || by_s) hold([begin + by_s, end + by_s]);
  at = there;
  plots.setCursor(at);
  look();
}

function look() {
  if (!hello) return;
  const wanted = plots.wanted().map((plot) => ({ channels: plot.numbers, begin: held ? held[0] : null, end: held ? held[1] : null, span: window_s, points: plots.points(plot, !held) }));
  const seen = view === "plots";
  link.send({ do: "look", plots: seen ? wanted : [], hidden: seen ? [] : wanted.flatMap((plot) => plot.channels), at: instant() });
}

function hold(window) {
  held = window;
  by("freeze").setAttribute("aria-pressed", String(!!held));
  by("freeze").textContent = held ? "Go on" : "Hold";
  if (!held) zooms = [];
  look();
  remember();
}

// name, comparison, number: the plots are held when it comes true
function triggered() {
  if (!trigger) return;
  const plot = plots.all().find((each) => each.numbers.includes(trigger.channel));
  const trace = plot?.found?.find((each) => each.channel === trigger.channel);
  if (!trace || !trace.x.length) return;
  for (let k = 1; k < trace.x.length; k++) {
    if (trace.x[k] <= trigger.since) continue;
    const low = trace.low[k], high = trace.high ? trace.high[k] : low, before = trace.low[k - 1];
    const is = (value) => trigger.sign === ">" ? value > trigger.value : trigger.sign === "<" ? value < trigger.value : value === trigger.value;
    if ((is(low) || is(high)) && !is(before)) {
      by("trigger-note").textContent = `held at ${trace.x[k].toFixed(3)} s`;
      plots.setMark(trace.x[k]);
      const half = window_s / 2;
      trigger = null;
      by("trigger").value = "";
      hold([trace.x[k] - half, trace.x[k] + half]);
      return;
    }
  }
  trigger.since = Math.max(trigger.since, trace.x[trace.x.length - 1] - 0.2);
}

by("trigger").onchange = () => {
  const parts = by("trigger").value.match(/^\s*(\S+)\s*(=|<|>|becomes)\s*(\S+)\s*$/);
  trigger = null;
  by("trigger-note").textContent = "";
  if (!by("trigger").value.trim()) return;
  const channel = parts && number.get(parts[1]);
  const states = channel !== undefined && parts ? hello.channels[channel].states : {};
  const named = parts && Object.keys(states).find((each) => states[each] === parts[3]);
  const value = parts ? Number(named ?? parts[3]) : NaN;
  if (channel === undefined || !Number.isFinite(value)) { by("trigger-note").textContent = "a name, then =, < or >, then a number or a state"; return; }
  if (!plots.all().some((plot) => plot.numbers.includes(channel))) plots.put(plots.chosen(), channel);
  trigger = { channel, sign: parts[2] === "becomes" ? "=" : parts[2], value, since: span[1] };
  by("trigger-note").textContent = "waiting";
};

// ---- what it shows, in the address

function remember() {
  const names = plots.all().map((plot) => plot.numbers.map((each) => hello.channels[each].name).join(","));
  const parts = new URLSearchParams({ view, span: window_s, plots: names.join(";") });
  if (held) parts.set("from", held[0].toFixed(6)), parts.set("to", held[1].toFixed(6));
  if (plots.mark() !== null) parts.set("mark", plots.mark().toFixed(6));
  if (notes.all().length) parts.set("notes", JSON.stringify(notes.all().map((each) => [each.time, each.text])));
  history.replaceState(null, "", `${location.search}#${parts}`);
}

// Plots where the address names none. Of two runs over each other one channel in each plot, of both.
function usual() {
  const sets = number.has("hip_rad") ? FIRST : FIRST_OF_A_LOG;
  const pairs = sets.flat().map((name) => [...number.keys()].filter((each) => each === name || each.startsWith(`${name} (`)));
  return pairs.some((pair) => pair.length > 1) ? pairs : sets;
}

function recall() {
  const parts = new URLSearchParams(location.hash.slice(1));
  const wanted = parts.get("plots");
  const sets = wanted !== null ? wanted.split(";").map((each) => each.split(",").filter(Boolean)) : usual();
  for (const names of sets) plots.add(names.map((name) => number.get(name)).filter((each) => each !== undefined));
  window_s = Number(parts.get("span")) || window_s;
  by("span").value = String(window_s);
  if (parts.get("from") !== null) hold([Number(parts.get("from")), Number(parts.get("to"))]);
  if (parts.get("mark") !== null) plots.setMark(Number(parts.get("mark")));
  try {
    for (const [time, text] of JSON.parse(parts.get("notes") ?? "[]")) notes.add(Number(time), String(text).slice(0, 80));
  } catch { say("the notes in the address cannot be read"); }
  choose(parts.get("view") ?? "plots");
}

function choose(name) {
  const tab = document.querySelector(`[data-view=${CSS.escape(name)}]`);
  view = tab && !tab.hidden ? name : "plots";
  for (const each of document.querySelectorAll("nav [role=tab]")) {
    const on = each.dataset.view === view;
    each.setAttribute("aria-selected", String(on));
    each.tabIndex = on ? 0 : -1;
    by(`view-${each.dataset.view}`).hidden = !on;
  }
  if (view === "plots") plots.resize();
  if (hello) { look(); remember(); tell_state(); reachable(by(`view-${view}`)); }
}

// ---- what is in no channel

// lost: why nothing more comes. What is shown of a robot is old when no message comes, or messages without news.
let said_lost = "connecting", newer_ms = performance.now();
function light(lost) {
  said_lost = lost;
  const unexpected = (state.errors ?? []).filter((row) => !row.normal).length;
  const silent_ms = link.silent_ms(), same_ms = performance.now() - newer_ms;
  const live = hello && can.has("live") && !lost, mute = live && silent_ms > OLD_MS;
  const old = mute || live && same_ms > OLD_MS && !state.ended && !state.pace?.paused;
  put(by("age"), old || lost && can.has("live") ? `${Math.round(Math.max(silent_ms, same_ms) / 1000)} s old` : "");
  document.body.dataset.old = old || lost && can.has("live") ? "yes" : "no";
  by("light").className = `light ${lost || old ? "off" : unexpected || state.ended ? "bad" : "good"}`;
  put(by("light-text"), lost || (mute ? "no message from the panel's server" : old ? "no new values from the robot" : state.ended ? `ended: ${state.ended}` : unexpected ? `${unexpected} unexpected error${unexpected > 1 ? "s" : ""}` : can.has("live") ? "no unexpected error" : "recording"));
}

setInterval(() => light(said_lost), OLD_MS / 4);   // also while nothing comes

function tell_state() {
  if (!hello) return;
  put(by("walked"), state.steps === undefined ? "" : `${state.steps} steps, ${figure(state.distance_m)} m, ${(state.speed_m_per_s ?? 0).toFixed(2)} m/s`);
  const spent = Object.entries(state.energy_Wh ?? {});
  put(by("energy"), spent.length ? `from the battery: ${spent.map(([name, value]) => `${name.replaceAll("_", " ")} ${(1e3 * value).toFixed(1)} mWh`).join(", ")}` + (state.tcot ? `; cost of transport ${state.tcot.toFixed(3)}` : "") : "");
  const pace = state.pace ?? {};
  put(by("pause"), pace.paused ? "Let the robot go on" : "Pause robot");
  put(by("pace-text"), pace.behind_s > 0.05 ? ` ${pace.behind_s.toFixed(2)} s late` : "");
  const errors = state.errors ?? [], unexpected = errors.filter((row) => !row.normal);
  put(by("error-count"), unexpected.length ? String(unexpected.length) : "");
  if (can.has("panel")) face.show(state.panel, state.panel_unseen);
  if (view === "errors") {
    renew(by("errors-unexpected"), tables.errors(unexpected, "unexpected errors"));
    renew(by("errors-normal"), tables.errors(errors.filter((row) => row.normal), "errors as in every healthy walk"));
  }
  if (view === "inside") {
    const missing = state.missing ?? {}, frames = state.frames ?? {}, names = Object.keys(frames);   // what a source has not, in its words
    renew(by("boards"), missing.slots ? tables.note(missing.slots) : tables.boards(state.boards ?? {}, state.slots ?? {}, hello.slots_us, tell));
    put(by("inside-at"), missing.slots && !names.length ? "" : insideAt());
    put(by("slots-note"), missing.slots ? "" : SLOTS_NOTE);
    renew(by("buses"), ...(names.length ? [tables.buses(state.buses ?? {})] : []), ...(missing.buses ? [tables.note(missing.buses)] : []));
    by("frames-part").hidden = !names.length;
    if (by("bus").length !== names.length) by("bus").replaceChildren(...names.map((name) => new Option(name, name)));
    renew(by("frames"), tables.frames(frames[by("bus").value] ?? [], by("frame-search").value));
  }
  if (view === "link" && state.link) {
    put(by("link-state"), tables.linkState(state.link));
    renew(by("link-lists"), tables.linkLists(state.link.lists));
    renew(by("link-chosen"), tables.linkRows(state.link.chosen));
  }
  if (view === "faults") renew(by("fault-list"), tables.faults(state.faults ?? [], tell));
  if (state.link) put(by("readout"), tables.linkState(state.link));
  else if (state.left_out && Object.keys(state.left_out).length) put(by("readout"), `left out because this program was too slow: ${Object.entries(state.left_out).map(([name, rows]) => `${rows} rows of ${name}`).join(", ")}`);
}

const SLOTS_NOTE = "Bar: what the slot took of its time; line: the longest of the second before. Late: by the wall clock, of the slots of the second before, from 1 µs to 1 s by the logarithm.";

// Of which instant slots and frames are.
function insideAt() {
  const seen = instant();
  return seen === null ? "now; click a plot, or move its cursor by the arrow keys, and robot, slots and frames stand at that instant" : `at ${seen.toFixed(3)} s${can.has("live") ? "; Escape leads back to now" : ""}`;
}

function bars() {
  if (!hello || !pose) return;
  CURRENTS.forEach(([, name], k) => {
    const place = hello.pose.indexOf(name), row = by("bars").children[k];
    row.hidden = place < 0;
    if (place < 0) return;
    const value = pose[place], share = Math.min(50, 50 * Math.abs(value) / FULL_BAR_A), bar = row.querySelector("i");
    bar.style.width = `${share}%`;
    bar.style.left = `${value < 0 ? 50 - share : 50}%`;
    put(row.lastChild, `${(Math.abs(value) < 0.005 ? 0 : value).toFixed(2)} A`);
  });
}

// The picture of the robot in words, for who does not see it.
let described_ms = 0;
function describe() {
  const now = performance.now();
  if (now - described_ms < DESCRIBED_MS) return;
  described_ms = now;
  by("stage").setAttribute("aria-label", `The robot, seen from its side: ${stage.words(pose)}`);
}

// What stands at the cursor is said once it rests, where it was moved by keys.
let resting = null, byKeys = false;
function sayCursor() {
  if (!byKeys) return;
  clearTimeout(resting);
  resting = setTimeout(() => { byKeys = false; put(by("said"), plots.atCursor()); }, QUIET_MS);
}

async function tell(wish, done) {
  try {
    await link.ask(wish);
    say(done ?? `${wish.do}: done`);
  } catch (fault) { say(String(fault)); }
}

let hiding = 0;
function say(text) {
  by("message").textContent = text;
  clearTimeout(hiding);
  hiding = setTimeout(() => { by("message").textContent = ""; }, MESSAGE_MS);
}

// ---- parameters: their values now, some times a second while they are looked at

setInterval(async () => {
  if (!hello || view !== "parameters") return;
  const names = hello.parameters.map((row) => row.name).filter((name) => number.has(name));
  try {
    const { values } = await link.ask({ do: "values", channels: names.map((name) => number.get(name)), at: null });
    parameters.show(Object.fromEntries(names.map((name, k) => [name, values[k]])));
  } catch { /* told by the light */ }
}, VALUES_MS);

// ---- faults

function faultForm() {
  const { places = [], modes = {} } = hello.faults;
  by("fault-place").replaceChildren(...places.map((place) => new Option(`${place.name}: ${place.what}`, place.name)));
  const renew = () => {
    const place = places.find((each) => each.name === by("fault-place").value), found = place ? modes[place.kind] ?? [] : [];
    by("fault-mode").replaceChildren(...found.map((each) => new Option(each.mode, each.mode)));
    meaning();
  };
  const meaning = () => {
    const place = places.find((each) => each.name === by("fault-place").value);
    by("fault-meaning").textContent = place ? (modes[place.kind] ?? []).find((each) => each.mode === by("fault-mode").value)?.meaning ?? "" : "";
  };
  by("fault-place").onchange = renew;
  by("fault-mode").onchange = meaning;
  renew();
}

by("fault-form").onsubmit = async (event) => {
  event.preventDefault();
  const start = by("fault-start").value.trim().replace(/^now$/, ""), end = by("fault-end").value.trim();
  const text = `${by("fault-place").value}:${by("fault-mode").value}${start || end ? `@${start || "0 s"}` : ""}${end ? `..${end}` : ""}`;
  try {
    const answer = await link.ask({ do: "fault", fault: text });
    by("fault-note").className = "note";
    by("fault-note").textContent = `armed at ${answer.time_s.toFixed(3)} s: ${text}`;
  } catch (fault) { by("fault-note").className = "note bad"; by("fault-note").textContent = String(fault); }
};

// ---- recordings: play, scrub, loop

function scrubber() {
  if (can.has("live")) return;
  const bar = by("position");
  bar.min = span[0];
  bar.max = span[1];
  if (document.activeElement !== bar) bar.value = played ?? span[0];
}

function goTo(time) {   // of a recording
  played = Math.max(span[0], Math.min(span[1], time));
  const width = held ? held[1] - held[0] : window_s;
  if (!held || played < held[0] || played > held[1]) hold([Math.max(span[0], played - width / 2), Math.max(span[0], played - width / 2) + width]);
  at = null;
  plots.setCursor(played);
  by("position").value = played;
  look();
}

let tick = null;
function play(on) {
  playing = on;
  by("play").textContent = on ? "Pause" : "Play";
  let before = performance.now();
  if (played >= span[1] && on) played = span[0];
  const step = (now) => {
    if (!playing) return;
    const next = played + (now - before) / 1000 * Number(by("speed").value);
    before = now;
    if (next >= span[1] && !by("loop").checked) { goTo(span[1]); play(false); return; }
    goTo(next >= span[1] ? span[0] : next);
    tick = requestAnimationFrame(step);
  };
  if (on) tick = requestAnimationFrame(step);
}

// ---- controls

for (const tab of document.querySelectorAll("nav [role=tab]")) tab.onclick = () => choose(tab.dataset.view);
function goTab(find) {
  const tabs = [...document.querySelectorAll("nav [role=tab]:not([hidden])")], next = tabs.at(find(tabs.indexOf(document.activeElement), tabs.length));
  next.focus();
  choose(next.dataset.view);
}

keys.bind("tabs", document.querySelector("nav"), {
  ArrowRight: () => goTab((here, count) => (here + 1) % count), ArrowLeft: () => goTab((here) => here - 1), Home: () => goTab(() => 0), End: () => goTab(() => -1),
});
by("skip").onclick = () => by(`view-${view}`).focus();
by("add-plot").onclick = () => { plots.add(); remember(); };
by("freeze").onclick = () => hold(held ? null : [span[1] - window_s, span[1]]);
by("span").onchange = () => { window_s = Number(by("span").value); if (held) hold([held[1] - window_s, held[1]]); look(); remember(); };
by("pause").onclick = () => tell({ do: state.pace?.paused ? "resume" : "pause" }, state.pace?.paused ? "the robot goes on" : "the robot is paused");
by("play").onclick = () => play(!playing);
by("position").oninput = () => { play(false); goTo(Number(by("position").value)); };
by("frame-search").oninput = () => tell_state();
by("bus").onchange = () => tell_state();

for (const kind of ["csv", "mf4"]) by(`save-${kind}`).onclick = () => {
  const { begin, end } = range(), channels = [...new Set(plots.all().flatMap((plot) => plot.numbers))];
  by(`save-${kind}`).href = `export/${kind}?${new URLSearchParams({ channels: channels.join(","), begin, end })}`;
};

by("note-form").onsubmit = (event) => {
  event.preventDefault();
  const text = by("note").value.trim(), time = plots.mark();
  if (!text || time === null) { say(time === null ? "click a plot first: the note stands at the mark" : "a note has a word or more"); return; }
  notes.add(time, text);
  by("note").value = "";
};

by("picture").onclick = () => {
  const drawn = plots.wanted().filter((plot) => plot.chart).map((plot) => [plot.chart.ctx.canvas, plot.numbers.map((each) => hello.channels[each].name).join(", ")]);
  if (!drawn.length) return;
  const all = document.createElement("canvas"), title = 26;
  all.width = Math.max(...drawn.map(([canvas]) => canvas.width));
  all.height = drawn.reduce((sum, [canvas]) => sum + canvas.height + title, 0);
  const context = all.getContext("2d");
  context.fillStyle = colour("paper");
  context.fillRect(0, 0, all.width, all.height);
  let y = 0;
  for (const [canvas, names] of drawn) {
    context.fillStyle = colour("ink");
    context.font = "16px system-ui, sans-serif";
    context.fillText(names, 10, y + 19);
    context.drawImage(canvas, 0, y + title);
    y += canvas.height + title;
  }
  all.toBlob((blob) => download("plots.png", blob));
};

// ---- keys

function step(by_s) {
  byKeys = true;
  if (can.has("live")) cursorTo((at ?? plots.cursor() ?? range().end) + by_s);
  else { play(false); goTo(played + by_s); }
}

function mark(time = instant() ?? span[1]) {
  plots.setMark(time);
  atMark();
  look();
  remember();
  say(`mark at ${time.toFixed(3)} s`);
}

function search() {
  const field = { parameters: "parameter-search", inside: "frame-search" }[view] ?? "search";
  if (field === "search") choose("plots");
  by(field).focus();
}

const digits = (count, act) => Array.from({ length: count }, (_, k) => act(k));
keys.bind("page", document, {
  h: () => can.has("live") ? by("freeze").click() : false,
  "/": search,
  ArrowLeft: () => step(-0.01), ArrowRight: () => step(0.01), "Shift+ArrowLeft": () => step(-0.1), "Shift+ArrowRight": () => step(0.1),
  "+": () => zoomBy(0.5), "-": widen,
  m: () => mark(),
  n: () => { choose("plots"); if (plots.mark() === null) mark(); by("note").focus(); },
  ...Object.fromEntries(digits(9, (k) => [String(k + 1), () => {
    const plot = plots.all()[k];
    if (!plot) return false;
    plots.choose(plot);
    say(`channels go into plot ${k + 1}`);
  }])),
  Space: () => can.has("live") ? false : play(!playing),
  Escape: () => { plots.setMark(null); plots.setCursor(null); at = null; look(); remember(); },
  ...Object.fromEntries(digits(6, (key) => [`Alt+${key}`, () => can.has("keys") ? void tell({ do: "key", key }, `key ${key} pressed`) : false])),
});
keys.help(by("keys"), by("signs"));

new ResizeObserver(() => { if (pose) stage.draw(pose); }).observe(by("stage"));
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours = {}; plots.restyle(); if (pose) stage.draw(pose); });
window.rangerPanel = { plots, keys: keys.bindings, shown: () => shown, state: () => state, span: () => span, held: () => held, channel: (name) => number.get(name), pose: () => pose };
choose("plots");
