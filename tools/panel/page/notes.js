// Notes: marks that are kept with a word, in the address and on the plots; a click goes there.
import { bind } from "./keys.js";

// on: {changed(notes), go(time)}; beside: what gets the focus when the last note is gone
export function makeNotes(box, beside, on) {
  const notes = [];   // {time, text}

  function list() {
    box.replaceChildren(...notes.map((each, k) => {
      const part = Object.assign(document.createElement("span"), { className: "kept" });
      const going = Object.assign(document.createElement("button"), { type: "button", className: "chip", title: "go there", textContent: `${each.time.toFixed(3)} s: ${each.text}` });
      const closer = Object.assign(document.createElement("button"), { type: "button", className: "close", textContent: "×" });
      closer.setAttribute("aria-label", `take away the note at ${each.time.toFixed(3)} s`);
      going.onclick = () => on.go(each.time);
      closer.onclick = () => take(k);
      bind("note", going, { Delete: () => take(k), Backspace: () => take(k) });
      part.append(going, closer);
      return part;
    }));
    on.changed(notes);
  }

  function take(k) {
    notes.splice(k, 1);
    list();
    (box.children[Math.min(k, notes.length - 1)]?.firstChild ?? beside).focus();
  }

  function add(time, text) {
    notes.push({ time, text });
    notes.sort((one, other) => one.time - other.time);
    list();
  }

  return { add, all: () => notes };
}
