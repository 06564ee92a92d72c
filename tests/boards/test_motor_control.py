"""Compliant law, current loop, limits and bridge output: known answers, then a board with a motor on it."""

import pytest

from ranger_sim.boards.modules.compliant_control import CompliantControl
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.motor_limits import MotorLimits
from ranger_sim.boards.modules.motor_output import PINS as MOTOR_PINS
from ranger_sim.boards.modules.motor_output import SHUTDOWN
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import errors as codes
from tests.boards.motor_bench import BOARDS, SLOT_NS, Bench, Winding

ONE = 65536
WATCHDOG = MOTOR_PINS["motor_watchdog"]
HIP = dict(
    target_min=-4.0,
    target_max=4.0,
    current_min=-5.0,
    current_max=5.0,
    thermal_current=3.1,
    thermal_time=10.0,
    excess_limit=20,
    gear=66.0,
)


def limits(**changes):
    return MotorLimits(ErrorModule(3, NetworkTime()), codes, **{**HIP, **changes})


# --- compliant law ----------------------------------------------------------------------------------------


def test_stiffness_and_dampness_pull_back_from_position_and_velocity():
    law = CompliantControl()
    law.set_command(2 * ONE)
    law.set_stiffness(30 * ONE)
    law.set_dampness(3 * ONE)
    # 2 - 30 x 0.1 - 3 x (-0.5) = 0.5 A, with each product floored to 1/65536
    assert law.update(6553, -32768) == 2 * ONE - 30 * 6553 + 3 * 32768


def test_the_products_are_floored():
    law = CompliantControl()
    law.set_stiffness(1)
    assert law.update(-1, 0) == 1  # (1 x -1) >> 16 is -1, and the law subtracts it


def test_the_appendixs_printed_sign_adds_the_gain_terms():
    law = CompliantControl(sign=1)
    law.set_stiffness(2 * ONE)
    assert law.update(ONE, 0) == 2 * ONE


@pytest.mark.parametrize("latch", [False, True])
def test_gains_come_into_force_on_arrival_or_with_the_next_command(latch):
    law = CompliantControl(latch_with_current=latch)
    law.set_stiffness(5 * ONE)
    assert law.update(ONE, 0) == (0 if latch else -5 * ONE)
    law.set_command(0)
    assert law.update(ONE, 0) == -5 * ONE


def test_a_command_applies_the_gains_of_the_slot_before_in_the_firmware_of_2016():
    bench = Bench("MCFI", Quirks(gains_latch_with_current=True)).run(ms=2)
    for value in (10.0, 20.0):  # the main brain sends the constant term before the gain
        bench.command("COMMAND_CURRENT", 0.5)
        bench.command("STIFFNESS", value)
        bench.run(ms=2)
    assert bench.board.compliance.stiffness == 10 * ONE
    assert bench.board.compliance.received_stiffness == 20 * ONE


def test_a_direct_target_is_overwritten_within_the_slot():
    bench = Bench("MCH").run(ms=2)
    bench.command("MOTOR_TARGET_CURRENT", 3.0)
    bench.run(ms=1)
    assert bench.board.compliance.target == 0


# --- clips --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "low", "high", "current_low", "current_high", "duty", "thermal", "slope"),
    [
        ("MCH", -4.0, 4.0, -5.0, 5.0, 250, 96.1, -0.0145),
        ("MCFO", -1.0, 6.0, -2.0, 8.0, 300, 96.1, -0.0145),
        ("MCFI", -1.0, 6.0, -2.0, 8.0, 300, 96.1, -0.0145),
        ("MCSI", -0.25, 0.25, -0.3, 0.3, 200, 0.909, -2.6195),
    ],
)
def test_every_board_has_the_limits_of_its_motor(name, low, high, current_low, current_high, duty, thermal, slope):
    board = Bench(name, Quirks.firmware_2016()).board
    assert board.limits.target_min / ONE == low
    assert board.limits.target_max / ONE == high
    assert board.limits.current_min / ONE == pytest.approx(current_low, abs=1 / ONE)
    assert board.limits.current_max / ONE == pytest.approx(current_high, abs=1 / ONE)
    assert board.output.largest == duty
    assert board.limits.thermal_limit / ONE == pytest.approx(thermal, abs=2 / ONE)
    # the firmware's mistake of units, as read back from the images
    assert board.limits.thermal_slope / ONE == pytest.approx(slope, abs=1e-4)
    assert board.current_control.integral_limit == duty * ONE // 20
    assert (board.current_control.proportional_gain, board.current_control.integral_gain) == (0, 20 * ONE)
    # never loosened by any switch
    ours = Bench(name).board
    assert (ours.limits.target_min, ours.limits.target_max) == (board.limits.target_min, board.limits.target_max)
    assert ours.output.largest == duty
    assert ours.current_control.proportional_gain == 4 * ONE


def test_only_the_outer_feet_motor_is_mounted_the_other_way_round():
    assert {name: Bench(name).board.output.sign for name in BOARDS} == {"MCH": 1, "MCFO": -1, "MCFI": 1, "MCSI": 1}


def test_the_target_is_clipped_and_reported():
    motor = limits()
    assert motor.limit_target(5 * ONE, 0) == 4 * ONE
    assert motor.limit_target(-9 * ONE, 0) == -4 * ONE
    assert motor.limit_target(3 * ONE, 0) == 3 * ONE
    assert motor.errors.totals[codes.MC_TCURR_OOB] == 2


# --- thermal --------------------------------------------------------------------------------------------------


def heat(motor, wanted, seconds, obey=True):
    """The motor's current follows the allowed target exactly; returns the current at the end, A."""
    current = 0
    for _ in range(int(seconds * 2000)):
        motor.monitor(current)
        current = motor.limit_target(wanted, 0) if obey else wanted
        if motor.too_hot:
            current = 0
    return current / ONE


def test_the_thermal_limit_brings_a_lasting_current_below_the_rated_one_without_switching_off():
    motor = limits()
    assert heat(motor, 4 * ONE, 3.0) == 4.0  # a burst above the rated 3.1 A is allowed
    settled = heat(motor, 4 * ONE, 60.0)
    # i = 4 m with m = 1 - (i^2 tau - 0.75 L)/(0.25 L), L = 3.1^2 tau: the root is 2.82 A, 2.6 % more for the
    # truncated time step (0.488 for 0.5 ms does not matter in balance) and the floored products
    assert settled == pytest.approx(2.82, rel=0.02)
    assert not motor.too_hot
    assert motor.errors.totals[codes.MC_TEMP_SAFE] > 0
    assert motor.errors.totals[codes.MC_TEMP_OFF] == 0


def test_a_current_that_does_not_obey_is_switched_off_and_comes_back_cold():
    motor = limits()
    heat(motor, 5 * ONE, 5.5, obey=False)
    assert motor.too_hot
    assert motor.errors.totals[codes.MC_TEMP_OFF] == 1
    heat(motor, 0, 2.0)
    assert motor.too_hot  # above three quarters of the limit it stays off
    heat(motor, 0, 2.0)
    assert not motor.too_hot
    assert motor.errors.totals[codes.MC_TEMP_ON] == 1


def test_the_thermal_state_has_the_rotors_time_constant():
    motor = limits()
    heat(motor, 2 * ONE, 40.0, obey=False)
    assert motor.thermal / ONE == pytest.approx(4.0 * 10.0, rel=0.03)  # I^2 tau; truncation as in the firmware
    top = motor.thermal
    heat(motor, 0, 10.0, obey=False)
    assert motor.thermal / top == pytest.approx(0.3679, abs=0.02)


def test_the_firmwares_own_thermal_slope_never_limits():
    motor = limits(derating=False)
    assert heat(motor, 4 * ONE, 7.0) == 4.0
    assert motor.thermal_soft < motor.thermal
    assert motor.thermal_multiplier > ONE
    assert motor.limit_duty(100 * ONE, 0) >= 100 * ONE


# --- peak ---------------------------------------------------------------------------------------------------


def test_a_current_beyond_its_peak_cuts_the_duty_in_the_same_slot():
    motor = limits()
    assert motor.limit_duty(240 * ONE, 6 * ONE) == 200 * ONE
    assert motor.limit_duty(-240 * ONE, -6 * ONE) == -200 * ONE
    assert motor.limit_duty(-240 * ONE, 6 * ONE) == -240 * ONE  # braking is not cut
    assert motor.limit_duty(240 * ONE, 5 * ONE) == 240 * ONE
    assert motor.errors.totals[codes.MC_CURR_OOB] == 2
    assert limits(peak=False).limit_duty(240 * ONE, 6 * ONE) == 240 * ONE


def test_the_integral_of_the_excess_fades_the_duty_and_switches_off():
    motor = limits(peak=False)
    motor.monitor(6 * ONE)  # 1 A too much for one sample
    assert motor.excess == ONE
    assert motor.excess_multiplier == ONE // 2
    assert motor.limit_duty(200 * ONE, 0) == 100 * ONE
    motor.monitor(6 * ONE)
    assert motor.excess_multiplier == 0
    for _ in range(18):
        motor.monitor(6 * ONE)
    assert motor.overloaded
    assert motor.errors.totals[codes.MC_MECH_OFF] == 1
    motor.monitor(0)  # and in every further slot at the limit
    assert motor.errors.totals[codes.MC_MECH_OFF] == 2
    assert motor.excess == 20 * ONE  # exactly zero current changes nothing
    for _ in range(5):
        motor.monitor(65)  # 1 mA: 5 A less each time
    assert not motor.overloaded
    assert motor.errors.totals[codes.MC_MECH_ON] == 1


# --- speed ----------------------------------------------------------------------------------------------------


def test_near_the_rated_speed_current_fades_in_the_direction_of_motion_only():
    motor = limits()
    assert motor.speed_max / ONE == pytest.approx(6300 * 2 * 3.14159265 / 60 / 66, rel=1e-5)
    slow = int(8.9 * ONE)
    half = (motor.speed_soft + motor.speed_max) // 2
    assert motor.limit_target(4 * ONE, slow) == 4 * ONE
    assert motor.limit_target(4 * ONE, half) == pytest.approx(2 * ONE, rel=1e-3)
    assert motor.limit_target(4 * ONE, motor.speed_max) == 0
    assert motor.limit_target(4 * ONE, 2 * motor.speed_max) == 0
    assert motor.limit_target(-4 * ONE, 2 * motor.speed_max) == -4 * ONE  # braking
    assert motor.limit_target(-4 * ONE, -half) == pytest.approx(-2 * ONE, rel=1e-3)
    assert motor.errors.totals[codes.MC_SPEED_LIMIT] == 4


def test_without_the_limiter_speed_changes_nothing():
    assert limits(speed=False).limit_target(4 * ONE, 100 * ONE) == 4 * ONE


def test_thermal_and_speed_limits_multiply():
    motor = limits()
    motor.thermal = (motor.thermal_soft + motor.thermal_limit) // 2
    motor.monitor(0)
    half = (motor.speed_soft + motor.speed_max) // 2
    assert motor.limit_target(4 * ONE, 0) == pytest.approx(2 * ONE, rel=2e-3)
    assert motor.limit_target(4 * ONE, half) == pytest.approx(ONE, rel=3e-3)


# --- bridge ----------------------------------------------------------------------------------------------------


def patterns(quirks, duty):
    board = Bench("MCH", quirks).run(ms=1).board
    board.output.second_pattern = False
    board.output.write(duty)
    first = (board.pwm.MR2, board.pwm.MR6)
    board.output.write(duty)
    return first, (board.pwm.MR2, board.pwm.MR6)


def test_the_two_leads_take_turns_with_the_same_net_drive():
    assert patterns(Quirks(), 100) == ((100, 0), (600, 500))
    assert patterns(Quirks(), -100) == ((0, 100), (500, 600))
    assert patterns(Quirks(), 0) == ((0, 0), (600, 600))


def test_the_firmware_of_2016_drives_14_counts_more_in_the_second_pattern():
    quirks = Quirks(alternating_offset_counts=14)
    assert patterns(quirks, 100) == ((100, 0), (600, 486))
    assert patterns(quirks, -100) == ((0, 100), (486, 600))
    assert patterns(quirks, 0) == ((0, 0), (600, 586))


@pytest.mark.parametrize("duty", [260, 599, 100000])
def test_the_duty_never_exceeds_its_clip(duty):
    assert patterns(Quirks(), duty) == ((250, 0), (600, 350))
    assert patterns(Quirks(), -duty) == ((0, 250), (350, 600))


def test_a_mirrored_motor_swaps_the_leads():
    board = Bench("MCFO").run(ms=1).board
    board.output.second_pattern = False
    board.output.write(50)
    assert (board.pwm.MR2, board.pwm.MR6) == (0, 50)


def test_the_watchdog_is_toggled_twice_per_slot():
    bench = Bench("MCH").run(ms=5)
    bench.pin_log.clear()
    bench.run(ms=10)
    toggles = [level for _, pin, level in bench.pin_log if pin == WATCHDOG]
    assert len(toggles) == 40
    assert toggles == [1 - toggles[0], toggles[0]] * 20 or toggles == [toggles[0], 1 - toggles[0]] * 20


def test_shutdown_starves_the_watchdog_and_drives_nothing():
    bench = Bench("MCH").run(ms=5)
    bench.command("COMMAND_CURRENT", 1.0)
    bench.command("SHUTDOWN", 1)
    bench.run(ms=2)
    bench.pin_log.clear()
    bench.run(ms=10)
    assert bench.pwm == (0, 0)
    assert not [1 for _, pin, _ in bench.pin_log if pin == WATCHDOG]
    assert bench.errors()["MC_NOT_RUNNING"] >= 20
    bench.command("SHUTDOWN", 0)
    bench.run(ms=2)
    assert bench.board.output.off == 0


@pytest.mark.parametrize("output", ["duty", "duty_then_current", "current"])
def test_a_steering_board_that_is_shut_down_notes_one_error_in_every_slot(output):
    bench = Bench("MCSI", Quirks(steering_output=output)).run(ms=3)
    bench.command("SHUTDOWN", 1)
    bench.run(ms=2)
    before = bench.errors()["MC_NOT_RUNNING"]
    bench.run(slots=20)
    assert bench.errors()["MC_NOT_RUNNING"] - before == 20
    # a duty of 0 in either pattern; with two writes in a slot the second pattern always stays
    assert bench.pwm == (600, 600) if output == "duty_then_current" else bench.pwm in ((0, 0), (600, 600))


def test_sleep_opens_the_bridge_and_feeds_the_watchdog():
    bench = Bench("MCFI").run(ms=5)
    bench.command("COMMAND_CURRENT", 1.0)
    bench.run(ms=3)
    assert bench.pwm != (0, 0)
    bench.command("SLEEP", 1)
    bench.run(ms=2)
    bench.pin_log.clear()
    bench.run(ms=10)
    assert bench.pwm == (0, 0)
    assert len([1 for _, pin, _ in bench.pin_log if pin == WATCHDOG]) == 40
    low_sides = [bench.pins[MOTOR_PINS[name]] for name in ("low_side_2", "low_side_6")]
    assert low_sides == [0, 0]
    bench.command("SLEEP", 0)
    bench.run(ms=2)
    assert [bench.pins[MOTOR_PINS[name]] for name in ("low_side_2", "low_side_6")] == [1, 1]


@pytest.mark.parametrize(("value", "stopped"), [(0x8000, False), (0x10000, False), (0x7FFF, True), (2, True)])
def test_bits_15_and_above_of_shutdown_are_ignored(value, stopped):
    bench = Bench("MCH").run(ms=2)
    bench.command("SHUTDOWN", value)
    bench.run(ms=1)
    assert bench.board.output.off == (SHUTDOWN if stopped else 0)
    assert bench.board.output.shutdown.frames == 1


def test_a_motor_keeps_its_last_command_when_the_network_falls_silent():
    bench = Bench("MCH")
    bench.motor = Winding()
    bench.run(ms=2)
    bench.command("COMMAND_CURRENT", 1.0)
    bench.run(ms=20)
    bench.sync = False
    bench.run(ms=100)
    assert bench.motor.current == pytest.approx(1.0, abs=0.05)


# --- the loop with a motor --------------------------------------------------------------------------------------


def step_response(name, amperes, quirks=None, **winding):
    bench = Bench(name, quirks)
    bench.motor = Winding(**winding)
    bench.run(ms=3)
    bench.motor.log.clear()
    start = bench.now
    bench.command("COMMAND_CURRENT", amperes)
    bench.run(ms=25)
    return bench, [((time - start) * 1e-6, current) for time, current in bench.motor.log]


@pytest.mark.parametrize("name", ["MCH", "MCFO", "MCFI"])
@pytest.mark.parametrize("proportional", [True, False])
def test_the_current_settles_in_a_few_milliseconds_without_overshoot(name, proportional):
    bench, log = step_response(name, 2.0, Quirks(proportional_current_control=proportional))
    late = [current for ms, current in log if ms > 6.0]
    # the loop's truncated gain makes 1 % (hip 100 for 100.9); the rest is one count of duty (0.03 A)
    assert all(current == pytest.approx(2.0, abs=0.06) for current in late)
    assert max(current for _, current in log) < 2.0 * 1.1
    assert bench.board.limits.excess == 0


@pytest.mark.parametrize(("resistance", "volts"), [(1.0, 28.0), (1.34, 25.9), (1.8, 22.0)])
def test_the_loop_is_stable_over_the_motors_resistance_and_the_battery(resistance, volts):
    _, log = step_response("MCFI", 4.0, resistance=resistance, volts=volts)
    late = [current for ms, current in log if ms > 10.0]
    assert max(late) - min(late) < 0.12
    assert sum(late) / len(late) == pytest.approx(4.0, abs=0.08)


def test_an_ankle_pulls_at_most_1_A_and_pushes_at_most_6():
    _, log = step_response("MCFI", -5.0)
    assert log[-1][1] == pytest.approx(-1.0, abs=0.06)
    _, log = step_response("MCFI", 9.0)
    assert log[-1][1] == pytest.approx(6.0, abs=0.1)


def test_a_blocked_direction_gives_no_current():
    bench = Bench("MCH")
    bench.board.words[0] = 4590 + 790
    bench.motor = Winding()
    bench.run(ms=3)
    bench.command("COMMAND_CURRENT", 2.0)
    bench.run(ms=10)
    assert bench.motor.current == pytest.approx(2.0, abs=0.06)
    bench.board.words[0] = 4590 + 801
    bench.run(ms=10)
    assert bench.motor.current == pytest.approx(0.0, abs=0.06)
    bench.command("COMMAND_CURRENT", -2.0)
    bench.run(ms=10)
    assert bench.motor.current == pytest.approx(-2.0, abs=0.06)


@pytest.mark.parametrize(
    ("angle", "stretch", "negative", "positive", "error"),
    [
        (1.5, 0.0, False, False, None),
        (0.19, 0.0, True, False, "ANKL_LO"),
        (2.91, 0.0, False, True, "ANKL_HI"),
        (1.5, 0.31, True, False, "CBL_STRCH"),
        (1.5, 0.29, False, False, None),
    ],
)
@pytest.mark.parametrize("name", ["MCFO", "MCFI"])
def test_an_ankle_is_blocked_at_its_ends_and_when_the_cable_is_off(name, angle, stretch, negative, positive, error):
    bench = Bench(name)
    encoder = bench.board.encoder
    bench.board.words[0] = encoder.zero + encoder.sign * round(angle / 0.0007669922)
    bench.run(ms=3)
    bench.board.motor.set_position(int((angle - stretch) * ONE))
    before = bench.errors()
    bench.run(ms=2)
    control = bench.board.current_control
    assert (control.block_negative, control.block_positive) == (negative, positive)
    new = {key for key, value in bench.errors().items() if value > before.get(key, 0) and key.startswith(name)}
    assert new == ({f"{name}_{error}"} if error else set())
    assert bool(bench.board.heartbeat.remaining_red) is bool(error)


def test_a_closed_limit_switch_blocks_pulling():
    from ranger_sim.boards.motor_board import PINS

    bench = Bench("MCFO")
    encoder = bench.board.encoder
    bench.board.words[0] = encoder.zero - 2000
    bench.run(ms=3)
    assert not bench.board.current_control.block_negative
    bench.board.inbox.push(bench.now + 1, 256, 1, PINS["limit_switch_left"], 0, -1, 0)
    bench.run(ms=3)
    assert bench.board.current_control.block_negative
    assert bench.errors()["MCFO_ANKL_LS"] > 0


# --- steering --------------------------------------------------------------------------------------------------


def test_steering_takes_pulse_width_counts_as_in_2011():
    bench = Bench("MCSI").run(ms=3)
    bench.counts("motor_current", 25)
    bench.command("COMMAND_CURRENT", -75.9)
    bench.run(ms=3)
    assert bench.board.output.duty == -75
    assert {(mr2, mr6) for _, mr2, mr6 in bench.pwm_log[-4:]} == {(0, 75), (525, 600)}


def test_steering_by_the_firmware_of_2016_writes_twice_and_stays_in_the_second_pattern():
    bench = Bench("MCSI", Quirks(steering_output="duty_then_current")).run(ms=4)
    bench.counts("motor_current", 25)
    bench.command("COMMAND_CURRENT", 0.2)
    bench.run(ms=4)
    last = [update for update in bench.pwm_log if update[0] > bench.now - 2_000_000]
    # the direct duty is int(0.2) = 0 in the first pattern; the loop follows in the second
    assert {update[1:] for update in last if update[1] != 600} == {(0, 0)}
    assert {update[1] for update in last if update[1:] != (0, 0)} == {600}


def test_steering_as_a_current_loop_follows_its_amperes():
    bench = Bench("MCSI", Quirks(steering_output="current"))
    bench.motor = Winding(resistance=20.0, inductance=1e-3)
    bench.run(ms=4)
    bench.command("COMMAND_CURRENT", 0.2)
    bench.run(ms=80)
    assert bench.motor.current == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_direct_duty_of_steering_goes_past_every_limiter_but_the_largest_duty(sign):
    bench = Bench("MCSI").run(ms=3)
    limits = bench.board.limits
    bench.counts("motor_current", 25 - sign * 2600)  # 0.4 A where 0.3 is the most, so the duty of a loop would fade
    bench.command("COMMAND_CURRENT", sign * 75.0)
    bench.run(ms=3)
    assert limits.excess_multiplier < ONE
    assert bench.board.output.duty == sign * 75
    assert "MC_PWM_LIMIT" not in bench.errors()
    bench.command("COMMAND_CURRENT", sign * 300.0)
    bench.run(ms=2)
    assert bench.board.output.duty == sign * 200
    assert bench.errors()["MC_PWM_LIMIT"] > 0


@pytest.mark.parametrize("offset", [0, 14])
def test_a_motor_that_is_shut_down_goes_on_with_both_patterns_until_the_watchdog_bites(offset):
    bench = Bench("MCH", Quirks(alternating_offset_counts=offset)).run(ms=5)
    bench.command("COMMAND_CURRENT", 1.0)
    bench.run(ms=3)
    bench.command("SHUTDOWN", 1)
    bench.run(ms=1)
    bench.pwm_log.clear()
    bench.pin_log.clear()
    bench.run(slots=8)
    # robot.md T4.3: 600 and 586, then 0 and 0 in turn; nobody feeds the watchdog meanwhile
    assert [log[1:] for log in bench.pwm_log[:4]] in (
        [(600, 600 - offset), (0, 0)] * 2, [(0, 0), (600, 600 - offset)] * 2,
    )  # fmt: skip
    assert len(bench.pwm_log) == 8
    assert [pin for _, pin, _ in bench.pin_log if pin == WATCHDOG] == []


@pytest.mark.parametrize(("quirks", "most"), [(Quirks.firmware_2016(), 0), (Quirks(), 2000)])
def test_the_duty_meets_its_clip_hardly_ever_without_a_proportional_gain(quirks, most):
    # robot.md T3: with the firmware's Kp of 0 the clip of the integral is that of the duty; with 4 a ramp meets it
    bench = Bench("MCH", quirks).run(ms=5)
    for step in range(100):
        bench.command("COMMAND_CURRENT", -4.0 + 0.08 * step)
        bench.run(ms=2)
    assert bench.errors()["MC_INTEG_SATUR"] > 100
    assert (bench.errors().get("MC_PWM_LIMIT", 0) > 100) is (most > 0)


def test_a_steering_loop_saturates_its_integral_in_every_slot_by_a_command_in_counts():
    # robot.md T3: 75 counts are 75 A to the loop of 2016, clipped to 0.25, which a motor at rest never shows
    bench = Bench("MCSI", Quirks.firmware_2016()).run(ms=4)
    bench.counts("motor_current", 25)
    bench.command("DAMPNESS", 0.0)
    bench.command("STIFFNESS", 0.0)
    bench.run(ms=1)
    bench.command("COMMAND_CURRENT", 75.0)
    bench.run(ms=50)
    before = bench.errors()["MC_INTEG_SATUR"]
    bench.run(slots=40)
    assert bench.errors()["MC_INTEG_SATUR"] - before == 40


@pytest.mark.parametrize(("counts", "duty"), [(4803 + 150, 60), (4803 + 260, 0)])
def test_the_steering_limit_check_blocks_when_it_is_switched_on(counts, duty):
    bench = Bench("MCSI", Quirks(steering_limit_check=True))
    bench.counts("steering_sensor", counts)
    bench.counts("motor_current", 25)
    bench.run(ms=4)
    bench.command("COMMAND_CURRENT", 60.0)
    bench.run(ms=4)
    assert bench.board.output.duty == duty


def test_the_first_two_samples_only_feed_the_watchdog():
    bench = Bench("MCH")
    control = bench.board.current_control
    bench.run(ms=0.4)
    bench.command("COMMAND_CURRENT", 2.0)
    bench.run(ms=1.05)
    assert control.calls == 2
    assert control.integral == 0 and bench.pwm == (0, 0)
    bench.run(slots=2)
    assert control.integral > 0


def test_slots_are_never_missed_while_the_loop_runs():
    bench, _ = step_response("MCFO", 3.0)
    assert bench.board.scheduler.overruns == 0
    assert bench.board.scheduler.slot_count == (bench.now - 500_000 + SLOT_NS - 1) // SLOT_NS


@pytest.fixture
def loop_at_rest():
    """The hip's current loop, fed and switched on, with how often its integral saturated since."""
    board = Bench("MCH").run(ms=4).board
    control = board.current_control
    control.integral, control.block_positive, control.block_negative = 0, False, False
    assert not board.output.off
    before = board.errors.totals[codes.MC_INTEG_SATUR]
    return control, lambda: board.errors.totals[codes.MC_INTEG_SATUR] - before


@pytest.mark.parametrize("sign", [1, -1])
def test_the_integral_is_clipped_beyond_its_limit_to_either_side_and_reported(loop_at_rest, sign):
    control, saturated = loop_at_rest
    control.integral = sign * (control.integral_limit - 1)
    control.update(sign, 0)
    assert control.integral == sign * control.integral_limit and saturated() == 0
    control.update(sign, 0)
    assert control.integral == sign * control.integral_limit and saturated() == 1
    control.update(-sign, 0)
    assert control.integral == sign * (control.integral_limit - 1) and saturated() == 1


@pytest.mark.parametrize(("positive", "negative"), [(False, False), (True, False), (False, True), (True, True)])
def test_a_closed_direction_takes_no_target_however_small_and_the_other_one_every_target(
    loop_at_rest, positive, negative
):
    control, _ = loop_at_rest
    control.block_positive, control.block_negative = positive, negative
    control.update(1, 0)
    assert control.integral == (0 if positive else 1)
    control.integral = 0
    control.update(-1, 0)
    assert control.integral == (0 if negative else -1)
