// The notes at times, a click goes there; and the field for a note at the mark, which gets the focus when the last note is gone.
import { bind } from "./keys.js";
import { by } from "./renew.js";

export function makeNotes({ state, update, subscribe }, box, field) {
  subscribe(["notes"], ({ notes }) => {
    box.replaceChildren(...notes.map((each, k) => {
      const part = Object.assign(document.createElement("span"), { className: "kept" });
      const there = Object.assign(document.createElement("button"), { type: "button", className: "chip", title: "go there", textContent: `${each.time.toFixed(3)} s: ${each.text}` });
      const closer = Object.assign(document.createElement("button"), { type: "button", className: "close", textContent: "×" });
      closer.setAttribute("aria-label", `take away the note at ${each.time.toFixed(3)} s`);
      there.onclick = () => update.goToMark(each.time);
      closer.onclick = () => take(k);
      bind("note", there, { Delete: () => take(k), Backspace: () => take(k) });
      part.append(there, closer);
      return part;
    }));
  });

  function take(k) {
    update.removeNote(k);
    (box.children[Math.min(k, state().notes.length - 1)]?.firstChild ?? field).focus();
  }

  by("note-form").onsubmit = (event) => {
    event.preventDefault();
    const text = field.value.trim(), { mark_s } = state();
    if (!text || mark_s === null) { update.say(mark_s === null ? "click a plot first: the note belongs to the mark" : "a note has a word or more"); return; }
    update.addNote(text);
    field.value = "";
  };
}
