// The view of faults: a form that arms one, and the list of those that were armed.
import { by, renew } from "./renew.js";
import * as tables from "./tables.js";

export function makeFaults({ state, subscribe }, { ask, order }) {
  const place = () => (state().hello.faults.places ?? []).find((each) => each.name === by("fault-place").value);
  const modes = () => state().hello.faults.modes?.[place()?.kind] ?? [];

  function listModes() {
    by("fault-mode").replaceChildren(...modes().map((each) => new Option(each.mode, each.mode)));
    explain();
  }

  function explain() {
    by("fault-meaning").textContent = modes().find((each) => each.mode === by("fault-mode").value)?.meaning ?? "";
  }

  async function arm() {
    const start = by("fault-start").value.trim().replace(/^now$/, ""), end = by("fault-end").value.trim();
    const text = `${by("fault-place").value}:${by("fault-mode").value}${start || end ? `@${start || "0 s"}` : ""}${end ? `..${end}` : ""}`;
    try {
      const answer = await ask({ do: "fault", fault: text });
      note(`armed at ${answer.time_s.toFixed(3)} s: ${text}`);
    } catch (fault) { note(String(fault), true); }
  }

  function note(text, is_bad = false) {
    by("fault-note").className = is_bad ? "note bad" : "note";
    by("fault-note").textContent = text;
  }

  subscribe(["hello"], ({ hello }) => {
    by("fault-place").replaceChildren(...(hello.faults.places ?? []).map((each) => new Option(`${each.name}: ${each.what}`, each.name)));
    listModes();
  });
  subscribe(["hello", "robot", "view"], ({ view, robot }) => {
    if (view === "faults") renew(by("fault-list"), tables.faults(robot.faults ?? [], order));
  });
  by("fault-place").onchange = listModes;
  by("fault-mode").onchange = explain;
  by("fault-form").onsubmit = (event) => {
    event.preventDefault();
    arm();
  };
}
