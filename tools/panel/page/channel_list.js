// The list of channels: searched by words, walked through by the arrow keys (one of its buttons is reached by Tab).
import { bind } from "./keys.js";
import { drawn } from "./state.js";

export function makeChannelList({ state, update, subscribe }, box, search) {
  let channels = [], listed = [], here = 0;   // listed: numbers of channels, group by group; here: the button that Tab reaches
  const words = (channel) => `${channel.name} ${channel.unit} ${channel.description} ${channel.group}`.toLowerCase();
  const buttons = () => [...box.querySelectorAll("button")];

  function order(found) {
    channels = found;
    const groups = [...new Set(channels.map((channel) => channel.group))];
    listed = [...channels.keys()].sort((a, b) => groups.indexOf(channels[a].group) - groups.indexOf(channels[b].group) || a - b);
    list();
  }

  function list() {
    const wanted = search.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    const rows = [];
    let group = null;
    for (const k of listed) {
      const channel = channels[k], text = words(channel);
      if (!wanted.every((each) => text.includes(each))) continue;
      if (channel.group !== group) { group = channel.group; rows.push(Object.assign(document.createElement("li"), { className: "group", textContent: group })); }
      rows.push(line(channel, k));
    }
    if (!rows.length) rows.push(Object.assign(document.createElement("li"), { className: "note", textContent: "no channel has these words" }));
    box.replaceChildren(...rows);
    box.scrollTop = here = 0;
    reachBy(0);
    mark(state());
  }

  function line(channel, k) {
    const item = document.createElement("li"), button = Object.assign(document.createElement("button"), { type: "button", draggable: true, tabIndex: -1, title: channel.description });
    button.dataset.channel = k;
    button.append(channel.name, Object.assign(document.createElement("small"), { textContent: channel.unit ? ` ${channel.unit}` : "" }));
    button.ondragstart = (event) => event.dataTransfer.setData("text/plain", String(k));
    button.onclick = () => { reachBy(buttons().indexOf(button)); update.toggleChannel(k); };
    item.append(button);
    return item;
  }

  // Tab leads to this one of the buttons.
  function reachBy(place) {
    const all = buttons();
    if (all[here]) all[here].tabIndex = -1;
    here = Math.max(0, Math.min(all.length - 1, place));
    if (all[here]) all[here].tabIndex = 0;
    return all[here];
  }

  const go = (place) => { if (place < 0) search.focus(); else reachBy(place)?.focus(); };
  bind("channels", box, { ArrowDown: () => go(here + 1), ArrowUp: () => go(here - 1), Home: () => go(0), End: () => go(Infinity) });
  bind("search", search, { ArrowDown: () => go(here) });
  search.oninput = list;

  // Which channels are drawn in some plot, and which in the chosen one.
  function mark(now) {
    const anywhere = new Set(drawn(now)), there = now.plots.find((plot) => plot.id === now.chosen)?.channels ?? [];
    for (const button of buttons()) {
      const k = +button.dataset.channel;
      button.classList.toggle("on", anywhere.has(k));
      button.setAttribute("aria-pressed", String(there.includes(k)));
    }
  }

  subscribe(["hello"], ({ hello }) => order(hello.channels));
  subscribe(["plots", "chosen"], mark);
}
