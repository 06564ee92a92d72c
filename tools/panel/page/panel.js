// The page: makes its state, its views and its connection, and connects them. A view draws when fields of the state
// change to which it subscribed; views are called in the order in which they are made here.
import { makeAddress } from "./address.js";
import { makeAnnouncer } from "./announcer.js";
import { makeChannelList } from "./channel_list.js";
import { connect } from "./connection.js";
import { makeErrors } from "./errors.js";
import { makeFace } from "./face.js";
import { makeFaults } from "./faults.js";
import { makeHeader } from "./header.js";
import { makeInside } from "./inside.js";
import * as keys from "./keys.js";
import { makeLink } from "./link.js";
import { makeMessage } from "./message.js";
import { makeNotes } from "./notes.js";
import { bindPageKeys } from "./page_keys.js";
import { makeParameters } from "./parameters.js";
import { makePlayback } from "./playback.js";
import { makePlotTools } from "./plot_tools.js";
import { makePlots } from "./plots.js";
import { by } from "./renew.js";
import { makeRequests } from "./requests.js";
import { makeRobot } from "./robot.js";
import { initial, updates } from "./state.js";
import { makeStore } from "./store.js";
import { makeTabs } from "./tabs.js";
import { makeTrigger } from "./trigger.js";
import { makeTwins } from "./twins.js";

const store = makeStore({ ...initial, newest_ms: performance.now() }, updates), { state, update } = store;

// Traces are handed to the plots as they come: each adds to what is drawn, so none of them is a state.
const connection = connect({
  hello: (hello) => update.connected(hello, location.hash.slice(1)),
  picture: ([first, last], lost) => update.pictureReceived([first, last], lost, performance.now()),
  traces: (found) => plots.show(found),
  pose: update.poseReceived,
  values: update.valuesReceived,
  state: update.stateReceived,
  closed: (reason, refused) => update.closed(refused ? `refused: ${reason}` : `${reason}: trying again`),
});
const requests = makeRequests(store, connection);

makeHeader(store, requests, connection.silent_ms);
makeTabs(store);
makeRobot(store);
makeFace(store, requests, by("face"));
const plots = makePlots(store, by("plots"));
makeChannelList(store, by("channels"), by("search"));
makePlotTools(store, plots);
makeTrigger(store, plots);
makePlayback(store);
makeNotes(store, by("notes"), by("note"));
makeParameters(store, requests, by("parameter-groups"));
makeErrors(store);
makeInside(store, requests);
makeLink(store);
makeFaults(store, requests);
makeTwins(store, requests);
makeMessage(store);
makeAnnouncer(store, plots);
makeAddress(store);
requests.follow(plots);
bindPageKeys(store, requests);
keys.help(by("keys"), by("signs"));

// For tests and for a person at the browser's console.
window.rangerPanel = {
  plots: {
    ...plots, mark: () => state().mark_s, cursor: () => state().cursor_s, setMark: update.setMark,
    put: ({ id }, channel) => update.putChannel(id, channel), take: ({ id }, channel) => update.takeChannel(id, channel),
  },
  keys: keys.bindings, shown: () => state().pictures, state: () => state().robot, span: () => state().span, held: () => state().held,
  channel: (name) => state().numbers.get(name), pose: () => state().pose,
};
