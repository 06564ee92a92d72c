// Tables of the page: errors, boards, buses, frames, parameters, faults. Text only ever enters as text.
import { figure } from "./words.js";

// headings: "#" before one of numbers, "-" (after that) before one that is only read aloud. The first column names its row.
export function table(caption, headings, rows) {
  const box = document.createElement("div");
  box.className = "scroll";
  box.setAttribute("role", "group");
  box.setAttribute("aria-label", caption);
  const element = document.createElement("table");
  element.createCaption().textContent = caption;
  const head = element.createTHead().insertRow();
  for (const heading of headings) {
    const cell = Object.assign(document.createElement("th"), { scope: "col", className: kind(heading) }), text = heading.replace(/^#?-?/, "");
    cell.append(/^#?-/.test(heading) ? Object.assign(document.createElement("span"), { className: "unseen", textContent: text }) : text);
    head.append(cell);
  }
  const body = element.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    row.forEach((content, k) => {
      const cell = Object.assign(document.createElement(k ? "td" : "th"), { className: kind(headings[k]) });
      if (!k) cell.scope = "row";
      cell.append(content ?? "–");
      line.append(cell);
    });
  }
  box.append(element);
  return box;
}

const kind = (heading) => heading.startsWith("#") ? "number" : "";

export const note = (text) => Object.assign(document.createElement("p"), { className: "note", textContent: text });

// alarms: near its end it is red, as a slot that is nearly full
export function meter(share, text, alarms = true) {
  const box = document.createElement("div");
  box.className = "meter" + (alarms && share > 0.9 ? " high" : "");
  box.setAttribute("role", "meter");
  box.setAttribute("aria-valuenow", Math.round(100 * share));
  box.setAttribute("aria-valuetext", text);
  box.setAttribute("aria-label", text);
  const bar = document.createElement("i");
  bar.style.width = `${Math.max(0, Math.min(100, 100 * share))}%`;
  box.append(bar);
  return box;
}

// a meter with a line at another share
function marked(box, share) {
  const mark = document.createElement("b");
  mark.style.left = `${Math.max(0, Math.min(100, 100 * share))}%`;
  box.append(mark);
  return box;
}

const seconds = (value) => value === null || value === undefined ? "–" : `${value.toFixed(3)} s`;

export function errors(rows, caption) {
  if (!rows.length) return note("none");
  const then = rows.some((row) => (row.until ?? null) !== null);   // at the cursor
  return table(caption, ["board", "error", "#count", ...(then ? ["#until the cursor"] : []), "#first", "#last", "meaning"],
    rows.map((row) => [row.board, row.name, whole(row.count), ...(then ? [whole(row.until)] : []), seconds(row.first_s), seconds(row.last_s), row.text]));
}

const time = (us) => us === undefined || us === null ? "–" : us < 100 ? `${us.toFixed(1)} µs` : us < 1e3 ? `${Math.round(us)} µs` : us < 1e6 ? `${(us / 1e3).toFixed(1)} ms` : `${(us / 1e6).toFixed(1)} s`;

// Of a slot: what it took (the bar), what the worst of the second before it took (the mark).
function slotBar(name, slot, slot_us) {
  const share = slot.used_us / slot_us, worst = slot.used ? slot.used.worst / slot_us : share;
  return marked(meter(share, `${name}: ${Math.round(100 * share)} % of its slot, at worst ${Math.round(100 * worst)} % in the second before`), worst);
}

const LATEST_US = 1e6;   // the bar of lateness goes from 1 µs to 1 s, by the logarithm
const lateShare = (us) => us === null || us === undefined ? 0 : Math.max(0, Math.min(1, Math.log10(Math.max(us, 1)) / Math.log10(LATEST_US)));

function lateBars(name, late) {
  if (!late) return document.createTextNode("no pace is kept");
  const box = document.createElement("div");
  box.className = "late";
  box.setAttribute("role", "img");
  box.setAttribute("aria-label", `${name}: half of the slots of the second before were at most ${time(late.median)} late, 99 of 100 ${time(late.most)}, the latest ${time(late.worst)}`);
  for (const which of ["median", "most", "worst"]) {
    const bar = document.createElement("i");
    bar.style.width = `${100 * lateShare(late[which])}%`;
    box.append(bar);
  }
  box.append(Object.assign(document.createElement("small"), { textContent: `${time(late.median)}, ${time(late.most)}, ${time(late.worst)}` }));
  return box;
}

// found: the supervisor's view; slots: of each board at the time that is shown, where it reports them
export function boards(found, slots, slots_us, ask) {
  const names = [...new Set([...Object.keys(found), ...Object.keys(slots).filter((name) => slots[name])])];
  if (!names.length) return note("nothing is known of the boards yet");
  const supervised = Object.keys(found).length > 0, paced = names.some((name) => slots[name]?.late);
  const headings = ["board", ...(supervised ? ["state"] : []), "slot", "#took", "#margin", ...(paced ? ["late: half, 99 %, worst"] : []),
    ...(supervised ? ["#longest", "#overruns", "#errors", "-restart"] : [])];
  return table("slots of the boards", headings, names.map((name) => {
    const board = found[name], slot = slots[name], slot_us = slots_us[name], known = slot && slot.used_us !== null;
    const row = [name];
    if (supervised) row.push(board?.state);
    row.push(known ? slotBar(name, slot, slot_us) : "not reported", known ? time(slot.used_us) : "–", known ? `${(100 * (1 - slot.used_us / slot_us)).toFixed(0)} %` : "–");
    if (paced) row.push(slot ? lateBars(name, slot.late) : "–");
    if (supervised) {
      const restart = Object.assign(document.createElement("button"), { type: "button", textContent: "Restart" });
      restart.setAttribute("aria-label", `restart ${name}`);
      restart.onclick = () => ask({ do: "restart", board: name });
      row.push(time(board?.max_slot_us), board?.overruns, board?.errors, restart);
    }
    return row;
  }));
}

const whole = (count) => count === null || count === undefined ? "–" : count.toLocaleString("en");
const percent = (value) => value === null || value === undefined ? "–" : `${value.toFixed(1)} %`;

// Of a bus: the load of the last 10 ms (the bar), the fullest 10 ms of the second before (the mark).
export function buses(found) {
  const names = Object.keys(found);
  return table("loads of the buses", ["bus", "load in 10 ms", "#-share", "#fullest of 1 s", "#frames in 1 s", "#error frames"], names.map((name) => {
    const bus = found[name], worst = bus.of_second?.worst ?? bus.load;
    const bar = bus.load === null ? "not known"
      : marked(meter(bus.load / 100, `${name}: ${percent(bus.load)} of it taken, at most ${percent(worst)} in the second before`), worst / 100);
    return [rated(name, bus.rates ?? []), bar, percent(bus.load), percent(bus.of_second?.worst), whole(bus.frames_per_s), whole(bus.errors)];
  }));
}

const mega = (rate) => rate >= 1e6 ? `${rate / 1e6} Mbit/s` : `${rate / 1e3} kbit/s`;
const rated = (name, rates) => rates.length > 1 ? `${name} (${rates.map(mega).join(", data ")})` : name;

// A bus with CAN FD frames has two more columns.
export function frames(rows, filter) {
  const wanted = filter.trim().toUpperCase();
  const shown = rows.filter((row) => !wanted || row.name.toUpperCase().includes(wanted) || String(row.id) === wanted);
  if (!shown.length) return note("no frames");
  const fd = rows.some((row) => row.fd);
  const found = table("newest frames", ["#time", "#id", ...(fd ? ["format", "#bytes"] : []), "name", "#value", "data", "#total"], shown.map((row) =>
    [seconds(row.time_s), row.id, ...(fd ? [row.fd ?? "", row.bytes ?? bytesOf(row.data)] : []), row.name, typeof row.value === "string" ? several(row.value) : figure(row.value),
      Object.assign(document.createElement("code"), { textContent: row.data }), whole(row.count)]));
  found.querySelector("table").classList.toggle("fd", fd);
  return found;
}

// Several signals of a frame: four lines of them, all when pointed at.
const several = (text) => Object.assign(document.createElement("div"), { className: "several", textContent: text, title: text });
const bytesOf = (data) => data && data !== "remote" ? data.split(" ").length : 0;

// ---- the data link

export const linkState = (link) => `${link.state}${link.asked ? ", lists asked for" : ""}; ${link.points.toLocaleString("en")} points, silent ${link.gaps} times (longest ${link.longest_gap_ms} ms), ${link.bad_checksums} bad checksums, ${link.restarts} restarts of the robot`;

const rate = (hz) => hz === null || hz === undefined ? "–" : hz >= 100 ? hz.toFixed(0) : hz.toFixed(1);

function achieved({ rate_hz, promised_hz }, name) {
  const share = promised_hz ? rate_hz / promised_hz : 0;
  return meter(share, `${name}: ${Math.round(100 * share)} % of its rate`, false);
}

const gaps = (row) => [row.gaps, row.gaps ? `${row.longest_ms} ms` : "–", seconds(row.last_s)];

export function linkLists(rows) {
  return table("lists of the data link", ["list", "#variables", "#received, 1/s", "of what is expected", "#expected, 1/s", "#gaps", "#longest", "#last"],
    rows.map((row) => [row.list, row.variables, rate(row.rate_hz), achieved(row, row.list), rate(row.promised_hz), ...gaps(row)]));
}

export function linkRows(rows) {
  if (!rows.length) return note("nothing yet: the robot has not sent its lists");
  return table("variables on the fast and the medium list", ["variable", "list", "#received, 1/s", "of what is expected", "#expected, 1/s", "#gaps", "#longest", "#last"],
    rows.map((row) => [row.name, row.list, rate(row.rate_hz), achieved(row, row.name), `${row.regular ? "" : "≥ "}${rate(row.promised_hz)}`, ...gaps(row)]));
}

export function faults(rows, ask) {
  if (!rows.length) return note("none was armed");
  return table("faults", ["#-number", "fault", "#armed", "#active since", "acted", "largest difference", "#ended", "#clear", "-take away"], rows.map((row, k) => {
    const clear = Object.assign(document.createElement("button"), { type: "button", textContent: "Clear", disabled: row.ended_s !== null || row.gave_way_to !== null });
    clear.setAttribute("aria-label", `clear ${row.fault}`);
    clear.onclick = () => ask({ do: "clear", which: k });
    return [k, row.fault, seconds(row.armed_s), seconds(row.activated_s), row.acted ? `yes, ${row.acted_count}×, first at ${seconds(row.acted_s)}` : row.gave_way_to ? `never: gave way at ${seconds(row.gave_way_s)}, ${row.gave_way_to}` : "not yet",
      row.acted ? `${figure(row.largest_difference)} ${row.unit}` : "–", seconds(row.ended_s), row.cleared_s === null && row.permanent ? `after ${row.permanent}` : seconds(row.cleared_s), clear];
  }));
}
