// The one WebSocket: JSON out, binary messages in (messages.py has their form). Comes back by itself when it is lost.
// A frame of the screen paints one picture, when it is due: painted on arrival, one picture would cost two frames.
const VERSION = 3, TEXT = 1, TRACES = 2, POSE = 3, PICTURE = 4, ENVELOPE = 1, FOLLOWS = 1, ANEW = 2;
const AGAIN_MS = [300, 1000, 3000];

// on: {hello, picture, traces, pose, values, state, closed}, called with what was received
export function connect(on) {
  let socket = null, tries = 0, number = 0, refused = false;
  let pictures = [];   // received and not painted
  let received_ms = performance.now();   // when the last message was received
  const waiting = new Map();

  function open() {
    const token = new URLSearchParams(location.search).get("token");
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket` + (token ? `?token=${token}` : ""));
    socket.binaryType = "arraybuffer";
    pictures = [];
    socket.onopen = () => { tries = 0; };
    socket.onmessage = (event) => { received_ms = performance.now(); take(event.data); };
    socket.onclose = (event) => {
      for (const { fail } of waiting.values()) fail("the connection was lost");
      waiting.clear();
      refused = event.code === 1008;
      on.closed(event.reason || (tries ? "no answer" : "the connection was lost"), refused);
      if (!refused) setTimeout(open, AGAIN_MS[Math.min(tries++, AGAIN_MS.length - 1)]);
    };
  }

  function take(buffer) {
    const head = new DataView(buffer);
    if (head.getUint8(0) !== VERSION) on.closed("the server has another version: load the page again", true);
    else if (head.getUint8(1) !== PICTURE) part(buffer, 0, buffer.byteLength);
    else if (pictures.push(buffer) === 1) requestAnimationFrame(paint);
  }

  function paint() {
    if (!pictures.length) return;   // they belonged to a connection that was lost
    const buffer = pictures.shift(), view = new DataView(buffer);
    for (let k = view.getUint32(8, true), at = 16; k > 0; k--) {
      const length = view.getUint32(at, true);
      part(buffer, at + 8, length);
      at += 8 + length + (8 - length % 8) % 8;
    }
    send({ do: "shown" });
    if (pictures.length) requestAnimationFrame(paint);
  }

  // A message, or one of those in a picture.
  function part(buffer, at, length) {
    const view = new DataView(buffer, at, length), kind = view.getUint8(1);
    if (kind === TEXT) takeText(JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, at + 16, length - 16))));
    else if (kind === TRACES) on.traces(plot(buffer, at, view));
    else if (kind === POSE) on.pose(view.getFloat64(16, true), new Float32Array(buffer, at + 24, view.getUint32(8, true)));
  }

  function takeText(content) {
    if ("hello" in content) on.hello(content.hello);
    else if ("values" in content && "at" in content) on.values(content.values, content.at);
    else if ("state" in content) on.state(content.state);
    else if ("picture" in content) on.picture(content.picture, content.lost);
    else if ("answer" in content) {
      const asked = waiting.get(content.answer);
      waiting.delete(content.answer);
      if (asked) content.error ? asked.fail(content.error) : asked.done(content);
    }
  }

  function plot(buffer, at, view) {
    const flags = view.getUint16(6, true);
    return { place: view.getUint16(2, true), points: view.getUint32(8, true), follows: !!(flags & FOLLOWS), anew: !!(flags & ANEW),
      end: view.getFloat64(16, true), span: view.getFloat64(24, true), found: traces(buffer, at + 32, view.getUint16(4, true)) };
  }

  function traces(buffer, at, channels) {
    const found = [], view = new DataView(buffer);
    for (let k = 0; k < channels; k++) {
      const channel = view.getUint32(at, true), flags = view.getUint32(at + 4, true), count = view.getUint32(at + 8, true);
      at += 16;
      const x = new Float64Array(buffer, at, count);
      at += 8 * count;
      const low = new Float32Array(buffer, at, count);
      const high = flags & ENVELOPE ? new Float32Array(buffer, at + 4 * count, count) : null;
      const bytes = 4 * count * (high ? 2 : 1);
      at += bytes + (8 - bytes % 8) % 8;
      found.push({ channel, x, low, high });
    }
    return found;
  }

  const send = (request) => { if (socket && socket.readyState === 1) socket.send(JSON.stringify(request)); };
  const ask = (request) => new Promise((done, fail) => {
    if (!socket || socket.readyState !== 1) { fail("not connected"); return; }
    waiting.set(++number, { done, fail });
    send({ ...request, number });
  });
  open();
  return { send, ask, silent_ms: () => performance.now() - received_ms };
}
