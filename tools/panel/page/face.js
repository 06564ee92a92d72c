// The front panel as the user interface board drives it: display, lights, tone, sync light; keys are the robot's.
import { put } from "./renew.js";

const KEYS = ["", "walk", "stop", "", "sync light", ""];   // of the record walk's program; others give them other meanings
const LIGHTS = 16, TONE = 22, SYNC = 23, PRESSED = 24, LEDS = 25;
const LED_COLOURS = { green: "#17a34a", red: "#dc2626", blue: "#2563eb" };   // in the order of their bits

const COLOURS = ["off", "red", "green", "yellow", "blue", "purple", "turquoise", "white"];   // by which of red, green, blue shine

function lamp(name, text) {
  const box = Object.assign(document.createElement("div"), { innerHTML: `<i></i>${text}` });
  box.setAttribute("role", "img");
  box.dataset.name = name;
  return box;
}

function shine(box, background, words) {
  box.firstChild.style.background = background;
  box.title = words;
  box.setAttribute("aria-label", `${box.dataset.name}: ${words}`);
}

// In words: what shines at least half as bright as the brightest.
function colourWords(rgb) {
  const most = Math.max(...rgb);
  return most ? `${COLOURS[rgb.reduce((sum, each, k) => sum + (2 * each >= most) * (1 << k), 0)]} (red ${rgb[0]}, green ${rgb[1]}, blue ${rgb[2]})` : "off";
}

export function makeFace({ subscribe }, { order }, box) {
  box.innerHTML = '<p class="note" id="unseen" role="status"></p><div class="top"><div class="lcd" role="img" aria-label="display"></div><div><label><input type="checkbox" id="hear"> sound of the buzzer</label><p class="note" id="tone"></p></div></div>' +
    '<div class="lights"></div><div class="lights leds"></div><div class="keys"></div>' +
    '<label class="stick">radio <input type="range" min="-1" max="1" step="0.05" value="0" aria-label="radio stick, left to right"> <output>0</output></label>';
  const lights = box.querySelector(".lights"), keys = box.querySelector(".keys"), lcd = box.querySelector(".lcd"), stick = box.querySelector(".stick input");
  for (let k = 0; k < 6; k++) lights.append(lamp(`light ${k + 1}`, k + 1));
  lights.append(lamp("sync light", "sync"));
  const leds = box.querySelector(".leds");
  for (const name of Object.keys(LED_COLOURS)) leds.append(lamp(`${name} light next to the processor`, name));
  KEYS.forEach((name, k) => {
    const button = Object.assign(document.createElement("button"), { type: "button", innerHTML: `key ${k}<small></small>` });
    button.querySelector("small").textContent = name;
    button.onclick = () => order({ do: "key", key: k }, `key ${k} pressed`);
    keys.append(button);
  });
  stick.oninput = () => { box.querySelector("output").textContent = stick.value; };
  stick.onchange = () => order({ do: "radio", stick: Number(stick.value) }, `radio stick at ${Number(stick.value)}`);
  let audio = null, tone = null, gain = null;
  box.querySelector("#hear").onchange = (event) => {
    if (!event.target.checked) { gain && (gain.gain.value = 0); return; }
    if (!audio) {
      audio = new AudioContext();
      tone = audio.createOscillator();
      gain = audio.createGain();
      tone.type = "square";
      gain.gain.value = 0;
      tone.connect(gain).connect(audio.destination);
      tone.start();
    }
    audio.resume();
  };

  // `unseen`: why there are no words.
  function show(words, unseen) {
    put(box.querySelector("#unseen"), words ? "" : unseen || "Nothing is known of the front panel yet.");
    for (const each of [box.querySelector(".top"), lights, leds]) each.hidden = !words;
    if (!words) {
      for (const key of keys.children) key.classList.remove("down");
      if (gain) gain.gain.value = 0;
      return;
    }
    const text = words.slice(0, 16).map((code) => code >= 32 && code < 127 ? String.fromCharCode(code) : " ").join("");
    put(lcd, `${text.slice(0, 8)}\n${text.slice(8)}`);
    lcd.setAttribute("aria-label", `display: ${text.trim().replace(/ +/g, " ") || "empty"}`);
    for (let k = 0; k < 6; k++) {
      const word = words[LIGHTS + k], rgb = [word & 255, word >> 8 & 255, word >> 16 & 255];
      shine(lights.children[k], word ? `rgb(${rgb.join()})` : "transparent", colourWords(rgb));
    }
    shine(lights.children[6], words[SYNC] ? "#fff3a0" : "transparent", words[SYNC] ? "on" : "off");
    Object.values(LED_COLOURS).forEach((colour, k) => {
      const lit = words[LEDS] >> k & 1;
      shine(leds.children[k], lit ? colour : "transparent", lit ? "on" : "off");
    });
    for (let k = 0; k < 6; k++) keys.children[k].classList.toggle("down", (words[PRESSED] >> k & 1) === 1);
    put(box.querySelector("#tone"), words[TONE] ? `buzzer: ${words[TONE]} Hz` : "buzzer: silent");
    if (gain) {
      tone.frequency.value = words[TONE] || 1;
      gain.gain.value = words[TONE] && box.querySelector("#hear").checked ? 0.05 : 0;
    }
  }
  subscribe(["hello"], ({ can }) => { box.hidden = !can.has("panel"); });
  subscribe(["hello", "robot"], ({ can, robot }) => { if (can.has("panel")) show(robot.panel, robot.panel_unseen); });
}
