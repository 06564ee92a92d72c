// The field "hold when": a name, a comparison and a number. The plots are held when it comes true in what they show.
import { by } from "./renew.js";

const OVERLAP_S = 0.2;   // a later picture may change what the one before had of its newest times

export function makeTrigger({ state, update, subscribe }, plots) {
  let since = 0;   // up to here nothing came true

  subscribe(["trigger"], ({ trigger }) => { if (trigger) since = trigger.since; });
  subscribe(["trigger_note"], ({ trigger_note }) => { by("trigger-note").textContent = trigger_note; });
  subscribe(["pictures"], ({ held, trigger }) => { if (!held && trigger) look(trigger); });
  by("trigger").onchange = () => update.setTrigger(by("trigger").value);

  function look({ channel, sign, value }) {
    const trace = plots.all().find((each) => each.numbers.includes(channel))?.found?.find((each) => each.channel === channel);
    if (!trace || !trace.x.length) return;
    const holds = (found) => sign === ">" ? found > value : sign === "<" ? found < value : found === value;
    for (let k = 1; k < trace.x.length; k++) {
      if (trace.x[k] <= since) continue;
      const low = trace.low[k], high = trace.high ? trace.high[k] : low;
      if ((holds(low) || holds(high)) && !holds(trace.low[k - 1])) {
        by("trigger").value = "";
        update.triggered(trace.x[k]);
        return;
      }
    }
    since = Math.max(since, trace.x[trace.x.length - 1] - OVERLAP_S);
  }
}
