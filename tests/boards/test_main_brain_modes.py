"""Modes, keys, display, lights, song."""

import pytest

from ranger_sim.boards.main_brain.mode_machine import lcd_words
from tests.boards.main_brain_bench import Bench

OFF = (0.0, 0.0, 0.0)


def display(bench):
    """The sixteen characters on the display."""
    words = [bench.get(f"UI_SET_LCD_QUAD_{i}") & 0xFFFFFFFF for i in (1, 2, 3, 4)]
    text = b"".join(word.to_bytes(4, "little") for word in words).decode()
    return text[:8].strip(), text[8:].strip()


@pytest.mark.parametrize(
    "keys, mode",
    [
        ((), "calibrate"),
        ((0,), "calibrate"),
        ((2,), "calibrate"),  # standby is reached from walk only
        ((1,), "walk"),
        ((1, 1), "walk"),
        ((1, 0), "walk"),
        ((1, 2), "standby"),
        ((1, 2, 0), "calibrate"),
        ((1, 2, 1), "walk"),
        ((1, 3, 4, 5), "walk"),
    ],
)
def test_keys_choose_the_mode(keys, mode):
    bench = Bench()
    bench.tick()
    for key in keys:
        bench.press(key)
    assert bench.states()[0] == mode
    assert bench.get("FSM_UI") == ("calibrate", "standby", "walk", "stop").index(mode)
    assert bench.get("EST_UI_FSM_MODE") == bench.get("FSM_UI")


def test_a_key_counts_when_it_goes_down_not_while_it_is_held():
    bench = Bench()
    bench.tick(UI_BUTTONS=2)
    bench.tick(UI_BUTTONS=2 | 4)  # key 2 comes down while key 1 is held
    assert bench.states()[0] == "standby"
    for _ in range(5):
        bench.tick()
    assert bench.states()[0] == "standby"


@pytest.mark.parametrize("keys", [(), (1, 2)])
def test_motors_are_off_outside_walking(keys):
    bench = Bench()
    bench.tick()
    for key in keys:
        bench.press(key)
    bench.store.mark_read(18, 1)
    bench.tick()
    for board in ("MCH", "MCFO", "MCFI"):
        assert bench.command(board) == OFF
    # rewritten in every slot, so the link sends it again
    assert bench.store.is_unread(18, 1)


def test_standby_stops_the_steering_of_the_walk_that_it_ends():
    bench = Bench()
    bench.tick()
    bench.press(1)
    bench.modes.steering.twist = 55.0
    bench.set(MCSI_COMMAND_CURRENT=55.0)
    bench.press(2)
    assert (bench.states()[0], bench.modes.steering.twist) == ("standby", 0.0)
    assert bench.command("MCSI") == OFF


def put_machines(bench, leg, hip, inner, outer, steering):
    modes = bench.modes
    modes.leg.machine.set_state(leg)
    modes.hip.machine.set_state(hip)
    modes.inner_foot.machine.set_state(inner)
    modes.outer_foot.machine.set_state(outer)
    modes.steering.machine.set_state(steering)


def test_leaving_walk_puts_every_machine_back_to_its_start():
    bench = Bench()
    bench.tick()
    bench.press(1)
    put_machines(bench, "LI_premid", "HO_premid", "prepush", "flipup", "stance")
    bench.set(MCH_ANGLE=0.15)  # no other transition is due
    bench.press(2)
    assert bench.states() == ("standby", "LO_aftermid", "HI_starthold", "startflipdown", "startstance", "front")
    assert bench.get("FSM_RESET") == 0  # 1 only while the machines went back
    assert bench.get("E_SWING_LEG") == 1


def test_a_machine_with_another_transition_due_takes_that_one_and_misses_the_reset():
    bench = Bench()
    bench.tick()
    bench.press(1)
    # swing leg 1: the outer legs have struck; hip behind -0.1 rad
    put_machines(bench, "LI_aftermid", "HO_ehold", "prepush", "flipup", "back")
    bench.set(MCH_ANGLE=-0.2)
    bench.press(2)
    assert bench.states() == ("standby", "LO_preswing", "HI_preswing", "startflipdown", "flipdown", "swing")


def test_every_walk_begins_with_the_preset_rate_and_the_first_one_remembers_it():
    bench = Bench()
    bench.tick()
    bench.press(1)
    assert bench.get("E_AM_L_ABSRATE") == pytest.approx(0.5)
    assert (bench.modes.leg.outer.mid_rate, bench.modes.leg.inner.mid_rate) == (0.5, 0.5)
    bench.modes.leg.outer.enter_premid()
    bench.modes.leg.outer.mid_rate = 0.8
    bench.modes.leg.inner.mid_rate = 0.7
    bench.set(E_AM_L_ABSRATE=1.2)
    bench.press(2)
    bench.press(1)
    assert bench.get("E_AM_L_ABSRATE") == pytest.approx(0.5)
    # the legs remember the walk before
    assert (bench.modes.leg.outer.mid_rate, bench.modes.leg.inner.mid_rate) == (0.8, 0.7)


def test_calibrate_zeroes_steps_and_distance_and_standby_keeps_them():
    bench = Bench()
    bench.tick()
    bench.press(1)
    bench.estimator.steps = 12
    bench.estimator.distance_m = 4.5
    bench.set(E_STEP_COUNT=12, E_DISTANCE=4.5)
    bench.press(2)
    assert bench.get("E_STEP_COUNT") == 12
    bench.press(0)
    assert bench.get("E_STEP_COUNT") == 0
    assert bench.get("E_DISTANCE") == 0.0
    assert bench.estimator.steps == 0


def test_a_new_walk_counts_steps_distance_and_songs_from_zero_and_energy_on():
    bench = Bench()
    bench.tick()
    bench.press(1)
    bench.estimator.steps = 3100
    bench.estimator.distance_m = 1085.0
    bench.set(E_STEP_COUNT=3100)
    bench.estimator.hip_energy.energy_J = 5.0
    bench.tick()
    bench.press(2)
    bench.press(1)
    assert (bench.get("E_STEP_COUNT"), bench.get("E_DISTANCE")) == (0, 0.0)
    assert bench.estimator.hip_energy.energy_J == 5.0
    bench.store.mark_read(156, 1)
    bench.machines_only(E_STEP_COUNT=2999)
    assert not bench.store.is_unread(156, 1)
    bench.machines_only(E_STEP_COUNT=3000)
    assert bench.store.is_unread(156, 1)


def test_four_characters_make_a_word_first_character_lowest():
    assert lcd_words("STEPS", "12") == [0x50455453, 0x20202053, 0x20203231, 0x20202020]


def test_the_display_cycles_battery_steps_metres_every_four_seconds():
    bench = Bench()
    bench.tick(MCH_BATT_VOLTAGE=25.86)
    bench.press(1)
    assert display(bench) == ("WALK", "")
    bench.estimator.steps = 7
    bench.set(E_STEP_COUNT=7, E_DISTANCE=2.56)
    pages = []
    for _ in range(4 * 2000 + 10):
        bench.machines_only()
        if not pages or pages[-1][1] != display(bench):
            pages.append((bench.ms, display(bench)))
    assert [page for _, page in pages] == [
        ("WALK", ""),
        ("BATTERY", "25.9 V"),
        ("STEPS", "7"),
        ("METRES", "2.6"),
        ("BATTERY", "25.9 V"),
    ]
    gaps = [b[0] - a[0] for a, b in zip(pages[1:], pages[2:], strict=False)]
    assert gaps == [4000, 4000, 4000]


def test_the_display_is_written_only_when_a_page_turns():
    bench = Bench()
    bench.tick()
    bench.press(1)
    for number in (130, 131, 132, 133):
        bench.store.mark_read(number, 1)
    for _ in range(500):
        bench.machines_only()
    assert not any(bench.store.is_unread(number, 1) for number in (130, 131, 132, 133))


def test_a_song_is_played_every_3000_steps():
    bench = Bench()
    bench.tick()
    bench.press(1)
    songs = []
    for steps in range(0, 7001):
        bench.store.mark_read(156, 1)
        bench.machines_only(E_STEP_COUNT=steps)
        if bench.store.is_unread(156, 1):
            songs.append(steps)
    assert songs == [3000, 6000]
    assert bench.get("UI_EMPTY_TX2") == 1


def test_a_light_warns_of_pushes_that_began_too_early():
    bench = Bench()
    bench.tick()
    bench.press(1)
    bench.machines_only(E_FI_PP2HS_TIME=70)
    assert bench.get("UI_SET_LED_3") == 0
    bench.machines_only(E_FI_PP2HS_TIME=72)
    assert bench.get("UI_SET_LED_3") == 0x000080
    bench.machines_only(E_FI_PP2HS_TIME=40, E_FO_PP2HS_TIME=40)
    assert bench.get("UI_SET_LED_3") == 0


def test_the_colour_of_light_1_shows_the_mode():
    bench = Bench()
    bench.tick()
    colours = [bench.get("UI_SET_LED_1")]
    for key in (1, 2):
        bench.press(key)
        colours.append(bench.get("UI_SET_LED_1"))
    assert colours == [0xE22B8A, 0x800000, 0x008000]  # purple, blue, green


def test_stop_after_a_fall_is_left_by_keys_only():
    bench = Bench()
    bench.tick()
    bench.press(1)
    bench.estimator.fallen = True
    bench.machines_only()
    assert bench.states()[0] == "stop"
    bench.press(1)
    assert bench.states()[0] == "stop"
    bench.press(2)
    assert bench.states()[0] == "standby"


def test_by_parameter_a_fall_does_not_stop_the_machines():
    bench = Bench()
    bench.set(D_UI_STOP_ON_FALL=0.0)
    bench.tick()
    bench.press(1)
    bench.estimator.fallen = True
    bench.machines_only()
    assert bench.states()[0] == "walk"


def test_parameters_can_be_changed_while_walking():
    bench = Bench()
    bench.tick()
    bench.press(1)
    bench.tick(P_HI_SH_H_TANG=0.2, C_HI_SH_H_ANG=20.0)
    assert bench.command("MCH") == pytest.approx((4.0, 20.0, 3.0))
