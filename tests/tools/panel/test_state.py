"""The state of the page and its store: known answers of the updates, without a robot and without views."""

import json

import pytest

from tests import browser
from tests.tools.panel.test_page import page_of, served

pytestmark = pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
HELLO = {
    "can": ["live", "panel"],
    "span": [0, 100],
    "channels": [{"name": f"channel_{k}", "states": {"7": "WALK"} if k == 3 else {}} for k in range(60)],
}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A page with both modules; what it shows itself does not matter."""
    folder = tmp_path_factory.mktemp("state")
    log = folder / "log.csv"
    log.write_text("time_s,hip_rad\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(30)), encoding="utf-8")
    with served(str(log)) as (address, _), page_of(address, folder) as page:
        page.value("void import('/state.js').then((state) => { window.state = state; })")
        page.value("void import('/store.js').then((store) => { window.store = store; })")
        page.until("window.state !== undefined && window.store !== undefined")
        yield page


def result(page, script, address="plots=channel_0,channel_1;channel_2&span=10", hello=HELLO):
    """What a script returns that has `state()`, `update`, `subscribe`, the modules and a connected store."""
    return page.value(
        f"""(() => {{
            const at = window.state, {{ makeStore }} = window.store;
            const store = makeStore(at.initial, at.updates), {{ state, update, subscribe }} = store;
            update.connected({json.dumps(hello)}, {json.dumps(address)});
            {script}
        }})()"""
    )


def test_the_address_that_a_state_writes_recalls_the_same_state(page):
    script = """
        update.hold([20, 30]);
        update.setMark(22);
        update.addNote("a step");
        const address = at.addressOf(state());
        const other = makeStore(at.initial, at.updates);
        other.update.connected(state().hello, address);
        const { plots, notes } = other.state();
        return [address, at.addressOf(other.state()), plots.map((plot) => plot.channels), notes];
    """
    address, again, plots, notes = result(page, script)
    assert address == again
    assert plots == [[0, 1], [2]]
    assert notes == [{"time": 22, "text": "a step"}]


def test_a_view_that_the_source_does_not_offer_is_the_plots(page):
    script = "update.show('help'); const first = state().view; update.show('faults'); return [first, state().view];"
    assert result(page, script) == ["help", "plots"]


def test_a_closer_look_keeps_the_cursor_at_its_share_and_wider_leads_back(page):
    script = """
        update.hold([20, 30]);
        update.point(22);
        update.zoomBy(0.5);
        const near = state().held;
        update.widen();
        const back = state().held;
        update.widen();
        return [near, back, state().held];
    """
    assert result(page, script) == [[21, 26], [20, 30], [18, 38]]


def test_keys_that_move_the_cursor_out_of_the_window_move_the_window(page):
    script = """
        update.hold([20, 30]);
        update.point(29);
        update.moveCursor(3);
        return [state().cursor_s, state().held, state().is_announced];
    """
    assert result(page, script) == [32, [22, 32], False]


def test_closing_the_chosen_plot_chooses_the_next_and_the_last_leaves_an_empty_one(page):
    script = """
        const [first, second] = state().plots.map((plot) => plot.id);
        update.choosePlot(first);
        update.closePlot(first);
        const chosen = state().chosen === second;
        update.closePlot(second);
        return [chosen, state().plots.map((plot) => plot.channels), state().chosen === state().plots[0].id];
    """
    assert result(page, script) == [True, [[]], True]


def test_a_channel_beyond_the_limit_is_refused_by_a_message(page):
    script = """
        const { id } = state().plots[0];
        for (let k = 3; k < 60; k++) update.putChannel(id, k);
        return [at.drawn(state()).length, state().message.text];
    """
    assert result(page, script) == [48, "48 channels at a time are possible: take one out first"]


def test_a_trigger_takes_the_name_of_a_state_and_draws_its_channel(page):
    script = """
        update.setTrigger("channel_3 becomes WALK");
        const { trigger, trigger_note } = state();
        update.setTrigger("channel_3 about 7");
        return [trigger, trigger_note, at.drawn(state()), state().trigger, state().trigger_note];
    """
    trigger, waiting, drawn, refused, why = result(page, script)
    assert trigger == {"channel": 3, "sign": "=", "value": 7, "since": 100}
    assert waiting == "waiting" and drawn == [0, 1, 2, 3]
    assert refused is None and why == "a name, then =, < or >, then a number or a state"


def test_values_of_another_time_than_the_cursors_are_too_late(page):
    script = """
        update.point(5);
        update.valuesReceived({ 0: 1.5 }, 4);
        const late = state().at_cursor;
        update.valuesReceived({ 0: 2.5 }, 5);
        return [late.time, state().at_cursor];
    """
    assert result(page, script) == [None, {"time": 5, "values": {"0": 2.5}}]


def test_a_recording_is_played_within_its_span_and_its_window_goes_with_it(page):
    script = """
        const begin = [state().played_s, state().held];
        update.goTo(55);
        const middle = [state().played_s, state().held];
        update.goTo(1000);
        return [begin, middle, state().played_s, state().cursor_s];
    """
    recorded = {**HELLO, "can": []}
    assert result(page, script, hello=recorded) == [[0, [0, 10]], [55, [50, 60]], 100, 100]


def test_an_update_that_a_view_makes_waits_until_every_view_has_drawn_the_one_before(page):
    script = """
        const calls = [];
        subscribe(["mark_s"], ({ mark_s }) => { calls.push(`first ${mark_s}`); if (mark_s === 1) update.setMark(2); });
        subscribe(["mark_s"], ({ mark_s }) => calls.push(`second ${mark_s}`));
        subscribe(["view"], () => calls.push("view"));
        update.setMark(1);
        return calls;
    """
    assert result(page, script) == ["first 1", "second 1", "first 2", "second 2"]


def test_a_subscription_to_an_unknown_field_is_refused(page):
    script = 'try { subscribe(["marks"], () => {}); } catch (error) { return error.message; } return "";'
    assert result(page, script) == "the state has no field marks"


def test_a_recording_without_the_robots_angles_has_no_picture_of_the_robot(page):
    assert page.value("document.getElementById('robot').hidden")
    columns = "getComputedStyle(document.querySelector('main')).gridTemplateColumns"
    assert len(page.value(columns).split()) == 1
