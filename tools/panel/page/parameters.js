// The view of parameters in groups: value now, limits, default, what was changed here; undo; sets as files; two sets compared.
import { download } from "./download.js";
import { bind } from "./keys.js";
import { by } from "./renew.js";
import { figure } from "./words.js";

const VALUES_MS = 500;   // between two requests for the values, while the view is shown

export function makeParameters({ state, subscribe }, { ask }, box) {
  const tools = {
    search: by("parameter-search"), changed: by("changed-only"), undo: by("undo"), save: by("save-set"), load: by("load-set"), compare: by("compare-set"),
    note: (text, is_bad) => { by("parameter-note").textContent = text; by("parameter-note").classList.toggle("bad", !!is_bad); },
  };
  let rows = [], current = {}, first = null, compared = null;
  const undone = [], inputs = new Map();

  function list(found) {
    rows = found;
    inputs.clear();
    const groups = new Map();
    for (const row of rows) groups.has(row.group) ? groups.get(row.group).push(row) : groups.set(row.group, [row]);
    box.replaceChildren(...[...groups].map(([group, members]) => {
      const part = document.createElement("details");
      part.dataset.group = group;
      part.append(Object.assign(document.createElement("summary"), { textContent: `${group} (${members.length})` }));
      const scroll = Object.assign(document.createElement("div"), { className: "scroll" }), element = document.createElement("table");
      element.createTHead().insertRow().innerHTML = ["parameter", "#value", "unit", "#least", "#most", "#default", "#other set", "meaning"]
        .map((each) => `<th scope="col"${each.startsWith("#") ? ' class="number"' : ""}>${each.replace("#", "")}</th>`).join("");
      element.createCaption().textContent = `parameters of the group ${group}`;
      const body = element.createTBody();
      for (const row of members) body.append(line(row));
      scroll.append(element);
      part.append(scroll);
      return part;
    }));
    filter();
  }

  function line(row) {
    const element = document.createElement("tr");
    const input = Object.assign(document.createElement("input"), { inputMode: "decimal", autocomplete: "off" });
    input.setAttribute("aria-label", row.name);
    input.onchange = () => set(row.name, Number(input.value));
    const cell = (text, kind = "") => Object.assign(document.createElement("td"), { textContent: text ?? "", className: kind });
    const value = document.createElement("td");
    value.className = "number";
    value.append(input);
    const name = Object.assign(document.createElement("th"), { scope: "row", textContent: row.name });
    element.append(name, value, cell(row.unit), cell(row.least === null ? "" : figure(row.least), "number"), cell(row.most === null ? "" : figure(row.most), "number"),
      cell(figure(row.default), "number"), cell("", "number compare"), cell(row.description));
    element.dataset.words = `${row.name} ${row.description} ${row.unit}`.toLowerCase();
    inputs.set(row.name, { input, element, row });
    return element;
  }

  async function set(name, value, remembers = true) {
    const before = current[name];
    try {
      if (!Number.isFinite(value)) throw "a number is expected";
      await ask({ do: "set", name, value });
      if (remembers) undone.push({ name, value: before });
      tools.undo.disabled = !undone.length;
      tools.note(`${name} = ${figure(value)}`);
    } catch (fault) {
      tools.note(String(fault), true);
      inputs.get(name).input.value = figure(before);
    }
  }

  function show(values) {   // {name: value now}
    current = values;
    if (first === null && Object.values(values).some((value) => value !== null)) first = { ...values };
    for (const [name, { input, element }] of inputs) {
      if (document.activeElement !== input) input.value = figure(values[name]);
      element.classList.toggle("changed", first !== null && values[name] !== null && first[name] !== values[name]);
    }
    filter();
  }

  function filter() {
    const wanted = tools.search.value.trim().toLowerCase(), changed = tools.changed.checked;
    for (const part of box.children) {
      let any = false;
      for (const element of part.querySelectorAll("tbody tr")) {
        const differs = compared && element.classList.contains("differs");
        element.hidden = (wanted && !element.dataset.words.includes(wanted)) || (changed && !element.classList.contains("changed") && !differs);
        any ||= !element.hidden;
      }
      part.hidden = !any;
      if (wanted || changed) part.open = any;
    }
  }

  function undo() {
    const last = undone.pop();
    tools.undo.disabled = !undone.length;
    if (last && last.value !== null) set(last.name, last.value, false);
  }

  function save() {
    const content = Object.fromEntries(rows.map((row) => [row.name, current[row.name]]).filter(([, value]) => value !== null && value !== undefined));
    download("parameters.json", JSON.stringify({ parameters: content }, null, 1));
  }

  async function read(file) {
    const content = JSON.parse(await file.text());
    const found = content.parameters ?? content;
    const unknown = Object.keys(found).filter((name) => !inputs.has(name));
    if (unknown.length) throw `${file.name}: unknown parameter ${unknown[0]}`;
    return found;
  }

  async function load(file) {
    try {
      const found = await read(file), differing = Object.entries(found).filter(([name, value]) => Math.fround(value) !== Math.fround(current[name]));
      for (const [name, value] of differing) await set(name, value);
      tools.note(`${file.name}: ${differing.length} of ${Object.keys(found).length} parameters were written`);
    } catch (fault) { tools.note(String(fault), true); }
  }

  async function compare(file) {
    try {
      compared = await read(file);
      let count = 0;
      for (const [name, { element }] of inputs) {
        const other = compared[name], differs = other !== undefined && Math.fround(other) !== Math.fround(current[name]);
        element.querySelector(".compare").textContent = other === undefined ? "" : figure(other);
        element.querySelector(".compare").classList.toggle("warn", differs);
        element.classList.toggle("differs", differs);
        count += differs;
      }
      tools.note(`${count} parameters differ from ${file.name}`);
      filter();
    } catch (fault) { tools.note(String(fault), true); }
  }

  bind("parameter", box, { Escape: ({ target }) => {
    if (!target.matches("input")) return false;
    target.value = figure(current[target.getAttribute("aria-label")]);
  } });
  tools.search.oninput = filter;
  tools.changed.onchange = filter;
  tools.undo.onclick = undo;
  tools.save.onclick = save;
  tools.load.onchange = () => { if (tools.load.files[0]) load(tools.load.files[0]); tools.load.value = ""; };
  tools.compare.onchange = () => { if (tools.compare.files[0]) compare(tools.compare.files[0]); tools.compare.value = ""; };
  subscribe(["hello"], ({ hello }) => list(hello.parameters));
  setInterval(async () => {
    const { hello, view, numbers } = state();
    if (!hello || view !== "parameters") return;
    const names = rows.map((row) => row.name).filter((name) => numbers.has(name));
    try {
      const { values } = await ask({ do: "values", channels: names.map((name) => numbers.get(name)), at: null });
      show(Object.fromEntries(names.map((name, k) => [name, values[k]])));
    } catch { /* the light shows it */ }
  }, VALUES_MS);
}
