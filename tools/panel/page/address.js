// What is shown, in the address: the same view can be opened again by it.
import { addressOf } from "./state.js";

export function makeAddress({ subscribe }) {
  subscribe(["hello", "view", "width_s", "plots", "held", "mark_s", "notes"], (state) => {
    if (state.hello) history.replaceState(null, "", `${location.search}#${addressOf(state)}`);
  });
}
