// Every key that does something here, by the place where it does. The help is made of this table, and no key can be
// bound that is not in it. native: the browser does it, as for every button and list.
const row = (keys, text, native = false) => ({ keys: keys.split(" "), text, native });
const PLACES = {
  page: ["Everywhere", [
    row("h", "hold the plots, or let them go on"),
    row("/", "search channels, parameters or frames"),
    row("ArrowLeft ArrowRight", "move the cursor by 10 ms"),
    row("Shift+ArrowLeft Shift+ArrowRight", "move the cursor by 100 ms"),
    row("+ -", "look closer or wider, around the cursor"),
    row("m", "set the mark where the cursor is"),
    row("n", "write a note at the mark"),
    row("1 2 3 4 5 6 7 8 9", "the plot into which channels go"),
    row("Space", "play a recording, or pause it"),
    row("Escape", "take mark and cursor away"),
    row("Alt+0 Alt+1 Alt+2 Alt+3 Alt+4 Alt+5", "press that key of the robot"),
  ]],
  tabs: ["On the names of the views", [
    row("ArrowLeft ArrowRight", "the view before or after"),
    row("Home End", "the first or the last view"),
  ]],
  search: ["In the search of channels", [row("ArrowDown", "go to the list")]],
  channels: ["On a channel in the list", [
    row("ArrowUp ArrowDown", "the channel before or after; before the first is the search"),
    row("Home End", "the first or the last channel"),
    row("Enter", "put it into the chosen plot, or take it out", true),
  ]],
  chip: ["On a channel above a plot", [
    row("ArrowUp ArrowDown", "move it into the plot before or after; after the last is a new one"),
    row("Delete Backspace", "take it out"),
    row("Enter", "take it out", true),
  ]],
  note: ["On a note", [
    row("Enter", "go there", true),
    row("Delete Backspace", "take the note away"),
  ]],
  parameter: ["In the value of a parameter", [
    row("Enter", "write it", true),
    row("Escape", "leave it as it was"),
  ]],
  stick: ["On the radio stick", [row("ArrowLeft ArrowRight", "move it by a twentieth", true)]],
};
const SHOWN = { ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", Escape: "Esc", Delete: "Del" };
const SIGNS = new Set(PLACES.page[1].flatMap(({ keys }) => keys).filter((key) => key.length === 1));   // keys of one sign
const TYPING = "input:not([type=checkbox]), select, textarea", USES_SPACE = "button, summary, [type=checkbox]";

const bound = new Map();   // place: keys that something is bound to
const STORED = "ranger-sim signs";
let signs = true;          // keys of one sign act; users of speech input may not want them
try { signs = localStorage.getItem(STORED) !== "off"; } catch { /* nothing is stored here: they act */ }

// A key's name, also with Alt on keyboards where that gives other signs.
function named(event) {
  if (event.altKey) return `Alt+${/^(Digit|Numpad)\d$/.test(event.code) ? event.code.at(-1) : event.key}`;
  const key = event.key === " " ? "Space" : event.key;
  return event.shiftKey && key.length > 1 ? `Shift+${key}` : key;
}

// True if the key belongs to what has the focus, so that it does nothing for the page.
function isTaken(key, target) {
  if (SIGNS.has(key) && !signs) return true;
  if (key === "Space" && target.matches(USES_SPACE)) return true;
  return !key.startsWith("Alt+") && target.matches(TYPING);
}

// actions: {key: what it does}; one that returns false has done nothing.
export function bind(place, element, actions) {
  const listed = new Set(PLACES[place][1].flatMap((each) => each.native ? [] : each.keys));
  for (const key of Object.keys(actions)) if (!listed.has(key)) throw new Error(`the help does not list ${key} in ${place}`);
  bound.set(place, new Set([...bound.get(place) ?? [], ...Object.keys(actions)]));
  element.addEventListener("keydown", (event) => {
    const key = named(event);
    if (event.ctrlKey || event.metaKey || !Object.hasOwn(actions, key) || (place === "page" && isTaken(key, event.target))) return;
    if (actions[key](event) === false) return;
    event.preventDefault();
    event.stopPropagation();
  });
}

// {place: {listed, bound}}, keys in the order of the alphabet.
export const bindings = () => Object.fromEntries(Object.entries(PLACES).map(([place, [, rows]]) =>
  [place, { listed: rows.flatMap((each) => each.native ? [] : each.keys).sort(), bound: [...bound.get(place) ?? []].sort() }]));

function shown(keys) {
  const key = (name) => (name.length > 1 ? name.split("+") : [name]).flatMap((each, k) =>
    [k ? "+" : "", Object.assign(document.createElement("kbd"), { textContent: SHOWN[each] ?? each })]);
  return keys.length > 3 ? [...key(keys[0]), " … ", ...key(keys.at(-1))] : keys.flatMap((each) => [...key(each), " "]);
}

export function help(box, checkbox) {
  for (const [title, rows] of Object.values(PLACES)) {
    const list = document.createElement("dl");
    for (const each of rows) {
      const keys = document.createElement("dt");
      keys.append(...shown(each.keys));
      list.append(keys, Object.assign(document.createElement("dd"), { textContent: each.text }));
    }
    box.append(Object.assign(document.createElement("h3"), { textContent: title }), list);
  }
  checkbox.checked = signs;
  checkbox.onchange = () => {
    signs = checkbox.checked;
    try { localStorage.setItem(STORED, signs ? "on" : "off"); } catch { /* it holds until the page is left */ }
  };
}
