// The controls of a recording: play, speed, loop and position.
import { by } from "./renew.js";
import { isLive } from "./state.js";

export function makePlayback({ state, update, subscribe }) {
  const bar = by("position");

  subscribe(["hello"], (now) => { by("scrub").hidden = isLive(now); });
  subscribe(["pictures"], (now) => {
    if (isLive(now)) return;
    [bar.min, bar.max] = now.span;
    if (document.activeElement !== bar) bar.value = now.played_s ?? now.span[0];
  });
  subscribe(["played_s"], ({ played_s }) => { bar.value = played_s; });
  subscribe(["is_playing"], ({ is_playing }) => {
    by("play").textContent = is_playing ? "Pause" : "Play";
    if (is_playing) requestAnimationFrame((begin) => requestAnimationFrame((now) => step(begin, now)));
  });
  by("play").onclick = () => state().is_playing ? update.pausePlay() : update.play();
  bar.oninput = () => {
    update.pausePlay();
    update.goTo(Number(bar.value));
  };

  // A frame of the screen: as much of the recording as passed since the one before.
  function step(before, now) {
    const { is_playing, played_s, span } = state();
    if (!is_playing) return;
    const next = played_s + (now - before) / 1000 * Number(by("speed").value), is_over = next >= span[1];
    update.goTo(is_over && by("loop").checked ? span[0] : next);
    if (is_over && !by("loop").checked) update.pausePlay();
    else requestAnimationFrame((after) => step(now, after));
  }
}
