// The header: the source's name, the light with the state of robot and connection, the robot's time and age, what it
// walked, its pace.
import { by, put } from "./renew.js";
import { isLive, unexpected } from "./state.js";
import { figure } from "./words.js";

const OLD_MS = 1000;   // without a message or a newer value, what is shown is not live

export function makeHeader({ state, subscribe }, { order }, silent_ms) {
  subscribe(["hello"], ({ hello, can }) => {
    by("title").textContent = hello.title;
    document.title = `${hello.title} – panel`;
    by("pace").hidden = !can.has("pace");
  });
  subscribe(["is_connected"], ({ is_connected }) => { document.body.dataset.connected = is_connected ? "yes" : "no"; });
  subscribe(["pictures", "lost"], light);
  setInterval(light, OLD_MS / 4);   // also while nothing comes
  subscribe(["pose_s"], ({ pose_s }) => { by("clock").textContent = `${pose_s.toFixed(3)} s`; });
  subscribe(["hello", "robot"], ({ robot }) => {
    const { pace = {} } = robot;
    put(by("walked"), robot.steps === undefined ? "" : `${robot.steps} steps, ${figure(robot.distance_m)} m, ${(robot.speed_m_per_s ?? 0).toFixed(2)} m/s`);
    put(by("pause"), pace.paused ? "Let the robot go on" : "Pause robot");
    put(by("pace-text"), pace.behind_s > 0.05 ? ` ${pace.behind_s.toFixed(2)} s late` : "");
  });
  by("pause").onclick = () => {
    const is_paused = state().robot.pace?.paused;
    order({ do: is_paused ? "resume" : "pause" }, is_paused ? "the robot goes on" : "the robot is paused");
  };

  // What is shown of a robot is old when no message comes, or messages without news.
  function light() {
    const now = state(), { robot, lost } = now, errors = unexpected(now).length, silence_ms = silent_ms(), same_ms = performance.now() - now.newest_ms;
    const is_robot = isLive(now), is_live = is_robot && !lost, is_silent = is_live && silence_ms > OLD_MS;
    const is_old = is_silent || is_live && same_ms > OLD_MS && !robot.ended && !robot.pace?.paused, shows_age = is_old || lost && is_robot;
    put(by("age"), shows_age ? `${Math.round(Math.max(silence_ms, same_ms) / 1000)} s old` : "");
    document.body.dataset.old = shows_age ? "yes" : "no";
    by("light").className = `light ${lost || is_old ? "off" : errors || robot.ended ? "bad" : "good"}`;
    put(by("light-text"), lost || (is_silent ? "no message from the panel's server" : is_old ? "no new values from the robot" : robot.ended ? `ended: ${robot.ended}`
      : errors ? `${errors} unexpected error${errors > 1 ? "s" : ""}` : is_robot ? "no unexpected error" : "recording"));
  }
}
