// The view of a walk compared with its twins: progress, the verdict, the features that are unusual, and what it says.
import { by, put, renew } from "./renew.js";
import * as tables from "./tables.js";

const LEAST_SCALE = 5;   // deviations from the middle to the edge of the picture, at least
const LONGEST = 300;   // letters of a line that is shown whole

export function makeTwins({ update, subscribe }, { ask }) {
  let walks = null;

  async function order(request) {
    try {
      await ask(request);
    } catch (fault) { update.say(String(fault)); }
  }

  function offer(names) {
    walks = names;
    by("twins-walks").replaceChildren(...names.map((name, walk) => Object.assign(document.createElement("button"), {
      type: "button", textContent: `Compare ${name} with its twins`, onclick: () => order({ do: "compare", walk }),
    })));
  }

  subscribe(["hello"], ({ hello }) => {
    if (String(walks) !== String(hello.walks)) offer(hello.walks);
  });
  subscribe(["hello", "robot", "view"], ({ view, robot: { twins } }) => {
    if (view !== "twins" || !twins) return;
    const { walk, at, share, error, answer } = twins;
    for (const button of by("twins-walks").children) button.disabled = Boolean(at);
    by("twins-stop").hidden = by("twins-share").hidden = !at;
    by("twins-share").value = share;
    by("twins-note").className = error ? "note bad" : "note";
    put(by("twins-note"), error ? `${walk}: ${error}` : at ? `${walk}: ${at}` : "");
    by("twins-answer").hidden = !answer;
    if (!answer) return;
    put(by("twins-verdict"), `${walk}: ${answer.headline}`);
    renew(by("twins-causes"), ...answer.causes.map(item));
    by("twins-picture").hidden = !answer.unusual.length;
    renew(by("twins-unusual"), unusual(answer));
    renew(by("twins-lines"), ...answer.lines.map(item));
  });
  by("twins-stop").onclick = () => order({ do: "stop comparing" });
}

// A line; of a long list only its first words, until it is opened.
function item(text) {
  const row = document.createElement("li"), end = text.length > LONGEST ? text.indexOf(": ") : -1;
  if (end < 0) {
    row.textContent = text;
    return row;
  }
  const details = document.createElement("details"), summary = document.createElement("summary");
  summary.textContent = text.slice(0, end);
  details.append(summary, text.slice(end + 2));
  row.append(details);
  return row;
}

// A bar for each feature, over the band in which sound walks are.
function unusual({ unusual: rows, usual }) {
  const scale = Math.max(LEAST_SCALE, ...rows.map(([, away]) => Math.abs(away)));
  const share = (value) => 50 + 50 * value / scale;
  return tables.table("features, the most unusual first", ["feature", "picture", "#deviations", "-judged"], rows.map(([name, away]) => {
    const box = document.createElement("div"), band = document.createElement("b"), bar = document.createElement("i"), is_odd = Math.abs(away) > usual;
    box.className = is_odd ? "away odd" : "away";
    box.setAttribute("aria-hidden", "true");
    band.style.left = `${share(-usual)}%`, band.style.right = `${100 - share(usual)}%`;
    bar.style.left = `${share(Math.min(0, away))}%`, bar.style.right = `${100 - share(Math.max(0, away))}%`;
    box.append(band, bar);
    return [name, box, `${away < 0 ? "−" : "+"}${Math.abs(away).toFixed(1)}`, is_odd ? "unusual" : "usual"];
  }));
}
