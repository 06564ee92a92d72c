// The one state of the page. Updates are pure functions: of the state and their arguments they make the fields that
// change. Views subscribe to fields and draw from the state.

export function makeStore(initial, updates) {
  let state = initial;
  const subscribers = [], waiting = [];
  let is_drawing = false;

  // An update that a subscriber makes waits until all have drawn the one before.
  function apply(change) {
    waiting.push(change);
    if (is_drawing) return;
    is_drawing = true;
    try {
      while (waiting.length) {
        const before = state;
        state = { ...before, ...waiting.shift()(before) };
        for (const { fields, draw } of subscribers) if (fields.some((each) => state[each] !== before[each])) draw(state, before);
      }
    } finally {
      is_drawing = false;
      waiting.length = 0;
    }
  }

  return {
    state: () => state,
    // {name: function of the update's arguments}
    update: Object.fromEntries(Object.entries(updates).map(([name, change]) => [name, (...values) => apply((before) => change(before, ...values))])),
    // draw(state, before) is called, in the order of subscription, after each update that changed one of these fields.
    subscribe: (fields, draw) => {
      for (const each of fields) if (!Object.hasOwn(initial, each)) throw new Error(`the state has no field ${each}`);
      subscribers.push({ fields, draw });
    },
  };
}
