// What the page knows and shows: the fields of its state, their updates, and what follows from them. Times are seconds
// of the robot unless their name ends in _ms. No document is needed here.

const SHORTEST_S = 1e-3, LONGEST_S = 36_000;   // a plot's window
const MOST_CHANNELS = 48;   // of all plots (server.py)
const LONGEST_NOTE = 80;
const VIEWS = { plots: null, parameters: "parameters", errors: "errors", inside: null, link: "link", faults: "faults", twins: "twins", help: null };   // and what each needs of the source
const FIRST = [["hip_rad", "ankle_outer_rad", "ankle_inner_rad"], ["hip_A", "outer_A", "inner_A"], ["FSM_HIP", "FSM_FO", "FSM_FI"]];
const FIRST_OF_A_LOG = [["MCH_ANGLE", "MCFO_RIGHT_ANKLE_ANGLE", "MCFI_MID_ANKLE_ANGLE"], ["MCH_MOTOR_CURRENT"], ["FSM_HIP"]];

export const initial = {
  // from the server
  hello: null,            // description of the source; null before the first connection
  can: new Set(),         // what the source offers
  numbers: new Map(),     // {name of a channel: its number}
  is_connected: false,
  lost: "connecting",     // why nothing more comes; "" while something comes
  span: [0, 0],           // first and last time of the source
  newest_ms: 0,           // when the last time changed, by the page's clock
  pictures: 0,            // received
  robot: {},              // state of what has no channel: errors, slots, frames, faults, pace
  pose: null, pose_s: 0,  // values of hello.pose
  at_cursor: { time: null, values: {} },   // exact values there
  at_mark: {},
  // chosen by the user
  view: "plots",
  plots: [], chosen: null,   // {id, channels}; the id of the one into which channels go
  held: null,             // the window's begin and end; null: it ends at the newest time
  width_s: 10,            // of a window that ends there
  zooms: [],              // windows before closer ones
  cursor_s: null,         // where the plots' cursor is
  pointed_s: null,        // where the user placed it; null: it follows a recording that plays, or is not there
  is_announced: true,     // false: keys moved the cursor, and the values there are not announced yet
  mark_s: null,
  notes: [],              // {time, text}, by time
  trigger: null,          // {channel, sign, value, since}: the plots are held when it comes true
  trigger_note: "",
  played_s: null,         // of a recording; null while a robot is live
  is_playing: false,
  layouts: 0,             // how often plots changed their width
  message: { text: "" },  // for some seconds at the edge of the page
};

// ---- what follows from the state

export const isLive = ({ can }) => can.has("live");

export const isOffered = ({ can }, view) => Object.hasOwn(VIEWS, view) && (!VIEWS[view] || can.has(VIEWS[view]));

export const range = ({ held, span, width_s }) => held ? { begin: held[0], end: held[1], follows: false } : { begin: span[1] - width_s, end: span[1], follows: true };

// The time of robot, values, slots and frames: at the cursor; of a recording where it is played; at the mark, when the
// plots are held or another view hides them; null: the newest.
export const instant = (state) => state.pointed_s ?? (isLive(state) ? (state.held || state.view !== "plots" ? state.mark_s : null) : state.played_s);

export const filled = ({ plots }) => plots.filter((plot) => plot.channels.length);

export const drawn = ({ plots }) => [...new Set(plots.flatMap((plot) => plot.channels))];

export const unexpected = ({ robot }) => (robot.errors ?? []).filter((row) => !row.normal);

const chosenPlot = ({ plots, chosen }) => plots.find((plot) => plot.id === chosen);

// ---- parts of updates

const within = (least, value, most) => Math.min(most, Math.max(least, value));

const hold = ({ zooms }, held) => ({ held, zooms: held ? zooms : [] });

const withChannels = (plots, id, channels) => plots.map((plot) => plot.id === id ? { ...plot, channels } : plot);

const nextId = (plots) => 1 + Math.max(0, ...plots.map((plot) => plot.id));

const sorted = (notes) => [...notes].sort((one, other) => one.time - other.time);

function goTo(state, time) {
  const { span, held, width_s } = state, played_s = within(span[0], time, span[1]), width = held ? held[1] - held[0] : width_s;
  const begin = Math.max(span[0], played_s - width / 2), is_outside = !held || played_s < held[0] || played_s > held[1];
  return { ...(is_outside ? hold(state, [begin, begin + width]) : {}), played_s, pointed_s: null, cursor_s: played_s };
}

// The window by this factor, with the cursor at the same share of it.
function zoomBy(state, factor) {
  const before = range(state), { begin, end } = before, around = within(begin, instant(state) ?? (state.held ? (begin + end) / 2 : end), end);
  const width = within(SHORTEST_S, (end - begin) * factor, LONGEST_S), first = around - (around - begin) / (end - begin) * width;
  return hold(factor < 1 ? { zooms: [...state.zooms, before] } : state, [first, first + width]);
}

// Plots where the address names none. Of two runs over each other one channel in each plot, of both.
function usual(numbers) {
  const sets = numbers.has("hip_rad") ? FIRST : FIRST_OF_A_LOG;
  const pairs = sets.flat().map((name) => [...numbers.keys()].filter((each) => each === name || each.startsWith(`${name} (`)));
  return pairs.some((pair) => pair.length > 1) ? pairs : sets;
}

// What the address holds, as `addressOf` writes it.
function recalled(state, address) {
  const parts = new URLSearchParams(address), names = parts.get("plots"), view = parts.get("view") ?? "plots";
  const sets = names !== null ? names.split(";").map((each) => each.split(",").filter(Boolean)) : usual(state.numbers);
  const plots = sets.map((set, k) => ({ id: k + 1, channels: set.map((name) => state.numbers.get(name)).filter((each) => each !== undefined) }));
  const found = { plots, chosen: plots.at(-1).id, width_s: Number(parts.get("span")) || state.width_s, view: isOffered(state, view) ? view : "plots" };
  if (parts.get("from") !== null) found.held = [Number(parts.get("from")), Number(parts.get("to"))];
  if (parts.get("mark") !== null) found.mark_s = Number(parts.get("mark"));
  try {
    found.notes = sorted(JSON.parse(parts.get("notes") ?? "[]").map(([time, text]) => ({ time: Number(time), text: String(text).slice(0, LONGEST_NOTE) })));
  } catch { found.message = { text: "the notes in the address cannot be read" }; }
  return found;
}

// What is shown, for the address.
export function addressOf(state) {
  const { hello, view, width_s, plots, held, mark_s, notes } = state;
  const parts = new URLSearchParams({ view, span: width_s, plots: plots.map(({ channels }) => channels.map((each) => hello.channels[each].name).join(",")).join(";") });
  if (held) parts.set("from", held[0].toFixed(6)), parts.set("to", held[1].toFixed(6));
  if (mark_s !== null) parts.set("mark", mark_s.toFixed(6));
  if (notes.length) parts.set("notes", JSON.stringify(notes.map((each) => [each.time, each.text])));
  return String(parts);
}

// ---- updates: each of the state and its arguments, and what changes

export const updates = {
  // from the server

  // A new connection; the first one recalls what the address holds.
  connected(state, hello, address) {
    const known = { ...state, hello, can: new Set(hello.can), numbers: new Map(hello.channels.map((channel, k) => [channel.name, k])), span: hello.span, is_connected: true };
    const found = { ...known, ...(state.plots.length ? {} : recalled(known, address)) };
    if (isLive(found)) return found;
    const held = found.held ?? [found.span[0], Math.min(found.span[1], found.span[0] + found.width_s)];
    return { ...found, held, ...goTo({ ...found, held }, found.played_s ?? held[0]) };
  },
  closed: (_, reason) => ({ is_connected: false, lost: reason }),
  pictureReceived: ({ span: before, newest_ms, pictures }, span, lost, now_ms) => ({ span, lost, pictures: pictures + 1, newest_ms: span[1] === before[1] ? newest_ms : now_ms }),
  poseReceived: (_, time, pose) => ({ pose, pose_s: time }),
  stateReceived: (_, robot) => ({ robot }),
  // Values at the requested time; those of another time are too late.
  valuesReceived: (state, values, time) => time === instant(state) ? { at_cursor: { time: state.cursor_s, values } } : {},
  valuesAtMarkReceived: ({ mark_s }, values, time) => time === mark_s ? { at_mark: values } : {},

  // views and messages

  show: (state, view) => ({ view: isOffered(state, view) ? view : "plots" }),
  say: (_, text) => ({ message: { text } }),

  // plots and their channels

  addPlot: ({ plots }) => ({ plots: [...plots, { id: nextId(plots), channels: [] }], chosen: nextId(plots) }),
  closePlot(state, id) {
    const place = state.plots.findIndex((plot) => plot.id === id), rest = state.plots.filter((plot) => plot.id !== id);
    const plots = rest.length ? rest : [{ id: nextId(state.plots), channels: [] }];
    return { plots, chosen: state.chosen === id ? plots[Math.min(place, plots.length - 1)].id : state.chosen };
  },
  choosePlot: (_, id) => ({ chosen: id }),
  putChannel({ plots, hello }, id, channel) {
    const { channels } = plots.find((plot) => plot.id === id);
    if (!hello.channels[channel] || channels.includes(channel)) return {};
    if (plots.reduce((sum, plot) => sum + plot.channels.length, 0) >= MOST_CHANNELS) return { message: { text: `${MOST_CHANNELS} channels at a time are possible: take one out first` } };
    return { plots: withChannels(plots, id, [...channels, channel]) };
  },
  takeChannel: ({ plots }, id, channel) => ({ plots: withChannels(plots, id, plots.find((plot) => plot.id === id).channels.filter((each) => each !== channel)) }),
  // A click in the list: into the chosen plot, or out of it.
  toggleChannel(state, channel) {
    const { id, channels } = chosenPlot(state);
    return channels.includes(channel) ? updates.takeChannel(state, id, channel) : updates.putChannel(state, id, channel);
  },
  // From one plot to another, which is then the chosen one if `chooses`; to null: to a new one.
  moveChannel(state, channel, from, to, chooses = false) {
    const added = to === null ? updates.addPlot(state) : {}, plots = added.plots ?? state.plots, target = plots.find((plot) => plot.id === (to ?? added.chosen));
    const chosen = chooses ? target.id : added.chosen ?? state.chosen;
    if (target.id === from || target.channels.includes(channel)) return { chosen };
    const rest = plots.find((plot) => plot.id === from).channels.filter((each) => each !== channel);
    return { chosen, plots: withChannels(withChannels(plots, from, rest), target.id, [...target.channels, channel]) };
  },
  plotsResized: ({ layouts }) => ({ layouts: layouts + 1 }),

  // window, cursor, mark and notes

  hold,
  holdOrFollow: (state) => hold(state, state.held ? null : [state.span[1] - state.width_s, state.span[1]]),
  setWidth: (state, width_s) => ({ width_s, ...(state.held ? hold(state, [state.held[1] - width_s, state.held[1]]) : {}) }),
  zoomTo: (state, begin, end) => hold({ zooms: [...state.zooms, range(state)] }, [begin, end]),
  zoomBy,
  // Back to the window before the last closer one; without one, twice as wide.
  widen(state) {
    const before = state.zooms.at(-1);
    return before ? hold({ zooms: state.zooms.slice(0, -1) }, before.follows ? null : [before.begin, before.end]) : zoomBy(state, 2);
  },
  // By the mouse; null when it leaves the plots.
  point: ({ played_s }, time) => ({ pointed_s: time, cursor_s: time ?? played_s }),
  // By keys: the cursor by so much, and the window with it where it would leave that; a recording is played from there.
  moveCursor(state, by_s) {
    if (!state.hello) return {};
    if (!isLive(state)) return { ...goTo(state, state.played_s + by_s), is_playing: false, is_announced: false };
    const { begin, end } = range(state), there = within(state.span[0], (state.pointed_s ?? state.cursor_s ?? end) + by_s, state.span[1]);
    const shift = Math.min(0, there - begin) + Math.max(0, there - end);
    return { ...(!state.held || shift ? hold(state, [begin + shift, end + shift]) : {}), pointed_s: there, cursor_s: there, is_announced: false };
  },
  announced: () => ({ is_announced: true }),
  setMark: (_, time) => ({ mark_s: time }),
  markHere(state) {
    const time = instant(state) ?? state.span[1];
    return { mark_s: time, message: { text: `mark at ${time.toFixed(3)} s` } };
  },
  clearMarkAndCursor: () => ({ mark_s: null, cursor_s: null, pointed_s: null }),
  // A mark, in the middle of a window.
  goToMark: (state, time, width = range(state).end - range(state).begin) => ({ mark_s: time, ...hold(state, [time - width / 2, time + width / 2]) }),
  addNote: ({ notes, mark_s }, text) => ({ notes: sorted([...notes, { time: mark_s, text }]) }),
  removeNote: ({ notes }, place) => ({ notes: notes.filter((_, k) => k !== place) }),

  // `text`: a name, a comparison, a number or a state's name; "" takes the trigger away
  setTrigger(state, text) {
    if (!text.trim()) return { trigger: null, trigger_note: "" };
    const [, name, sign, wanted] = text.match(/^\s*(\S+)\s*(=|<|>|becomes)\s*(\S+)\s*$/) ?? [], channel = state.numbers.get(name);
    const { states = {} } = state.hello?.channels[channel] ?? {}, value = Number(Object.keys(states).find((each) => states[each] === wanted) ?? wanted);
    if (channel === undefined || !Number.isFinite(value)) return { trigger: null, trigger_note: "a name, then =, < or >, then a number or a state" };
    const put = drawn(state).includes(channel) ? {} : updates.putChannel(state, state.chosen, channel);
    return { ...put, trigger: { channel, sign: sign === "becomes" ? "=" : sign, value, since: state.span[1] }, trigger_note: "waiting" };
  },
  triggered: (state, time) => ({ ...updates.goToMark(state, time, state.width_s), trigger: null, trigger_note: `held at ${time.toFixed(3)} s` }),

  // recordings

  goTo,
  play: (state) => ({ ...(state.played_s >= state.span[1] ? { played_s: state.span[0] } : {}), is_playing: true }),
  pausePlay: () => ({ is_playing: false }),
};
