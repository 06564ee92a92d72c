// The newest message to the user, for some seconds.
import { by } from "./renew.js";

const MESSAGE_MS = 4000;

export function makeMessage({ subscribe }) {
  let hiding = 0;
  subscribe(["message"], ({ message }) => {
    by("message").textContent = message.text;
    clearTimeout(hiding);
    hiding = setTimeout(() => { by("message").textContent = ""; }, MESSAGE_MS);
  });
}
