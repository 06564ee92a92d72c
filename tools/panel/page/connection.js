// The one WebSocket: JSON out, binary messages in (messages.py has their form). Comes back by itself when it is lost.
// A frame of the screen paints one picture: painted as its messages come, one picture would cost two frames.
const VERSION = 2, TEXT = 1, TRACES = 2, POSE = 3, ENVELOPE = 1, FOLLOWS = 1, ANEW = 2;
const AGAIN_MS = [300, 1000, 3000];

export function connect(heard) {
  let socket = null, tries = 0, number = 0, refused = false;
  let coming = [], pictures = [];   // what to do for the picture of which messages come, and for each that is there whole
  const waiting = new Map();

  function open() {
    const token = new URLSearchParams(location.search).get("token");
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket` + (token ? `?token=${token}` : ""));
    socket.binaryType = "arraybuffer";
    coming = [];
    pictures = [];
    socket.onopen = () => { tries = 0; };
    socket.onmessage = (event) => take(event.data);
    socket.onclose = (event) => {
      for (const { fail } of waiting.values()) fail("the connection was lost");
      waiting.clear();
      refused = event.code === 1008;
      heard.closed(event.reason || (tries ? "no answer" : "the connection was lost"), refused);
      if (!refused) setTimeout(open, AGAIN_MS[Math.min(tries++, AGAIN_MS.length - 1)]);
    };
  }

  function take(buffer) {
    const view = new DataView(buffer);
    if (view.getUint8(0) !== VERSION) { heard.closed("the server speaks another version: load the page again", true); return; }
    const kind = view.getUint8(1);
    if (kind === TEXT) takeText(JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 16))));
    else if (kind === TRACES) coming.push(() => heard.traces(plot(buffer, view)));
    else if (kind === POSE) coming.push(() => heard.pose(view.getFloat64(16, true), new Float32Array(buffer, 24, view.getUint32(8, true))));
  }

  function whole(picture) {
    pictures.push([...coming, picture]);
    coming = [];
    if (pictures.length === 1) requestAnimationFrame(paint);
  }

  function paint() {
    if (!pictures.length) return;   // it belonged to a connection that was lost
    for (const act of pictures.shift()) act();
    send({ do: "shown" });
    if (pictures.length) requestAnimationFrame(paint);
  }

  function takeText(content) {
    if ("hello" in content) heard.hello(content.hello);
    else if ("values" in content && "at" in content) heard.values(content.values, content.at);
    else if ("state" in content) heard.state(content.state);
    else if ("picture" in content) whole(() => heard.picture(content.picture, content.lost));
    else if ("answer" in content) {
      const asked = waiting.get(content.answer);
      waiting.delete(content.answer);
      if (asked) content.error ? asked.fail(content.error) : asked.done(content);
    }
  }

  function plot(buffer, view) {
    const flags = view.getUint16(6, true);
    return { place: view.getUint16(2, true), points: view.getUint32(8, true), follows: !!(flags & FOLLOWS), anew: !!(flags & ANEW),
      end: view.getFloat64(16, true), span: view.getFloat64(24, true), found: traces(buffer, view, view.getUint16(4, true)) };
  }

  function traces(buffer, view, channels) {
    const found = [];
    let at = 32;
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

  const send = (wish) => { if (socket && socket.readyState === 1) socket.send(JSON.stringify(wish)); };
  const ask = (wish) => new Promise((done, fail) => {
    if (!socket || socket.readyState !== 1) { fail("there is no connection"); return; }
    waiting.set(++number, { done, fail });
    send({ ...wish, number });
  });
  open();
  return { send, ask };
}
