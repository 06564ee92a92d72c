// The values at the cursor, announced to readers who do not see them once the cursor rests where keys moved it.
import { by, put } from "./renew.js";

const QUIET_MS = 600;   // after the newest values

export function makeAnnouncer({ update, subscribe }, plots) {
  let resting = 0;
  subscribe(["at_cursor"], ({ is_announced }) => {
    if (is_announced) return;
    clearTimeout(resting);
    resting = setTimeout(() => {
      update.announced();
      put(by("said"), plots.atCursor());
    }, QUIET_MS);
  });
}
