// The robot's picture, its motor currents and its energy.
import { by, put } from "./renew.js";
import { makeStage } from "./stage.js";
import { colour, onOtherColours } from "./theme.js";

const DESCRIBED_MS = 1000;   // between two descriptions of the picture
const CURRENTS = [["hip", "hip_A", "hip"], ["outer ankle", "outer_A", "outer"], ["inner ankle", "inner_A", "inner"], ["steering", "steering_A", "steering"]];
const FULL_BAR_A = 10;

export function makeRobot({ state, subscribe }) {
  const stage = makeStage(by("stage"), colour), draw = () => { if (state().pose) stage.draw(state().pose); };
  let described_ms = 0;

  subscribe(["hello"], ({ hello }) => {
    stage.know(hello);
    by("robot").hidden = !hello.pose.length;   // another machine's recording
    by("pose-note").textContent = hello.pose.includes("hip_y_m") ? "as its body is; inner legs hollow, contact forces thin" : "as it estimates itself; inner legs hollow, the lower foot stands";
    by("bars").replaceChildren(...CURRENTS.map(([name, , swatch]) => {
      const row = document.createElement("div");
      row.innerHTML = '<span></span><div class="bar"><i></i></div><span></span>';
      row.firstChild.textContent = name;
      row.style.setProperty("--swatch", `var(--${swatch})`);
      return row;
    }));
  });
  subscribe(["pose", "pose_s"], (now) => {
    draw();
    bars(now);
    describe(now);
  });
  subscribe(["robot"], ({ robot }) => {
    const spent = Object.entries(robot.energy_Wh ?? {}).map(([name, value]) => `${name.replaceAll("_", " ")} ${(1e3 * value).toFixed(1)} mWh`);
    put(by("energy"), spent.length ? `from the battery: ${spent.join(", ")}` + (robot.tcot ? `; cost of transport ${robot.tcot.toFixed(3)}` : "") : "");
  });
  new ResizeObserver(draw).observe(by("stage"));
  onOtherColours(draw);

  function bars({ hello, pose }) {
    if (!hello) return;
    CURRENTS.forEach(([, name], k) => {
      const place = hello.pose.indexOf(name), row = by("bars").children[k];
      row.hidden = place < 0;
      if (place < 0) return;
      const value = pose[place], share = Math.min(50, 50 * Math.abs(value) / FULL_BAR_A), bar = row.querySelector("i");
      bar.style.width = `${share}%`;
      bar.style.left = `${value < 0 ? 50 - share : 50}%`;
      put(row.lastChild, `${(Math.abs(value) < 0.005 ? 0 : value).toFixed(2)} A`);
    });
  }

  // The picture in words, for readers who do not see it.
  function describe({ pose }) {
    const now = performance.now();
    if (now - described_ms < DESCRIBED_MS) return;
    described_ms = now;
    by("stage").setAttribute("aria-label", `The robot, seen from its side: ${stage.words(pose)}`);
  }
}
