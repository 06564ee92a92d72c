// The view of the inside: slots of the boards, loads of the buses, newest frames.
import { by, put, renew } from "./renew.js";
import { instant, isLive } from "./state.js";
import * as tables from "./tables.js";

const SLOTS_NOTE = "Bar: what the slot took of its time; line: the longest of the second before. Late: by the wall clock, of the slots of the second before, from 1 µs to 1 s by the logarithm.";

export function makeInside({ state, subscribe }, { order }) {
  subscribe(["hello", "robot", "view"], draw);
  by("frame-search").oninput = () => draw(state());
  by("bus").onchange = () => draw(state());

  function draw(now) {
    const { hello, view, robot } = now;
    if (view !== "inside" || !hello) return;
    const { missing = {}, frames = {} } = robot, names = Object.keys(frames);   // missing: why the source lacks a part
    renew(by("boards"), missing.slots ? tables.note(missing.slots) : tables.boards(robot.boards ?? {}, robot.slots ?? {}, hello.slots_us, order));
    put(by("inside-at"), missing.slots && !names.length ? "" : whenOf(now));
    put(by("slots-note"), missing.slots ? "" : SLOTS_NOTE);
    renew(by("buses"), ...(names.length ? [tables.buses(robot.buses ?? {})] : []), ...(missing.buses ? [tables.note(missing.buses)] : []));
    by("frames-part").hidden = !names.length;
    if (by("bus").length !== names.length) by("bus").replaceChildren(...names.map((name) => new Option(name, name)));
    renew(by("frames"), tables.frames(frames[by("bus").value] ?? [], by("frame-search").value));
  }

  // The time of slots and frames.
  function whenOf(now) {
    const seen = instant(now);
    return seen === null ? "now; click a plot, or move its cursor by the arrow keys, and robot, slots and frames are those of that time" : `at ${seen.toFixed(3)} s${isLive(now) ? "; Escape leads back to now" : ""}`;
  }
}
