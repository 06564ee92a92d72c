// What the server is asked for: the data of the views as they are, the values at the mark, and orders to the robot.
import { drawn, instant } from "./state.js";

export function makeRequests({ state, update, subscribe }, connection) {
  const ask = connection.ask;

  // An order to the robot; a message reports what became of it.
  async function order(request, done) {
    try {
      await ask(request);
      update.say(done ?? `${request.do}: done`);
    } catch (fault) { update.say(String(fault)); }
  }

  // From now on the server is asked for what plots and cursor need.
  function follow(plots) {
    subscribe(["hello", "view", "plots", "held", "width_s", "pointed_s", "mark_s", "played_s", "layouts"], (now) => {
      const { view, held, width_s } = now;
      const wanted = plots.wanted().map((plot) => ({ channels: plot.numbers, begin: held ? held[0] : null, end: held ? held[1] : null, span: width_s, points: plots.points(plot, !held) }));
      const is_seen = view === "plots";
      connection.send({ do: "look", plots: is_seen ? wanted : [], hidden: is_seen ? [] : wanted.flatMap((plot) => plot.channels), at: instant(now) });
    });
    subscribe(["plots", "mark_s"], (now) => {
      if (now.mark_s !== null) valuesAtMark(now.mark_s, drawn(now));
    });
  }

  async function valuesAtMark(time, channels) {
    if (!channels.length) return;
    try {
      const { values } = await ask({ do: "values", channels, at: time });
      update.valuesAtMarkReceived(Object.fromEntries(channels.map((channel, k) => [channel, values[k]])), time);
    } catch { /* the light shows it */ }
  }

  return { ask, order, follow };
}
