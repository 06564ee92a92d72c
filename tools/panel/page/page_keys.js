// The keys that act everywhere on the page.
import { bind } from "./keys.js";
import { by } from "./renew.js";
import { isLive } from "./state.js";

const PLOTS = 9, ROBOT_KEYS = 6;
const SEARCHES = { parameters: "parameter-search", inside: "frame-search" };   // of other views the channels' one

export function bindPageKeys({ state, update }, { order }) {
  const step = (by_s) => () => update.moveCursor(by_s);

  function search() {
    const field = SEARCHES[state().view];
    if (!field) update.show("plots");
    by(field ?? "search").focus();
  }

  function note() {
    update.show("plots");
    if (state().mark_s === null) update.markHere();
    by("note").focus();
  }

  function choose(place) {
    const plot = state().plots[place];
    if (!plot) return false;
    update.choosePlot(plot.id);
    update.say(`channels go into plot ${place + 1}`);
  }

  function press(key) {
    if (!state().can.has("keys")) return false;
    order({ do: "key", key }, `key ${key} pressed`);
  }

  function play() {
    if (isLive(state())) return false;
    by("play").click();
  }

  const digits = (count, name, act) => Object.fromEntries(Array.from({ length: count }, (_, k) => [name(k), () => act(k)]));
  bind("page", document, {
    h: () => isLive(state()) ? update.holdOrFollow() : false,
    "/": search,
    ArrowLeft: step(-0.01), ArrowRight: step(0.01), "Shift+ArrowLeft": step(-0.1), "Shift+ArrowRight": step(0.1),
    "+": () => update.zoomBy(0.5), "-": () => update.widen(),
    m: () => update.markHere(),
    n: note,
    ...digits(PLOTS, (k) => String(k + 1), choose),
    Space: play,
    Escape: () => update.clearMarkAndCursor(),
    ...digits(ROBOT_KEYS, (k) => `Alt+${k}`, press),
  });
}
