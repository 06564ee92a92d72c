"""Faults on the whole robot: what the firmware makes of them, converters, and that nothing depends on how it is run."""

import contextlib
import json
import math
import os
import subprocess
import sys

import pytest

from ranger_sim import Ranger, Scenario, UserError, loading
from ranger_sim.datatable.generated import errors as codes

RAD_PER_EDGE = math.pi / 2048.0


@pytest.fixture
def robot():
    """The robot in the operator's hands after 0.3 s, all boards running."""
    with contextlib.closing(Ranger(Scenario())) as robot:
        robot.run_for(0.3)
        yield robot


def noted(board, name):
    """How often a board has noted an error."""
    return board.errors.totals[{name: code for code, name in codes.NAMES.items()}[name]]


def test_an_offset_of_the_hips_edges_is_that_angle_in_the_firmware_and_goes_again(robot):
    joint, encoder = robot.board("MCH").joint, robot.plant.hip_joint
    robot.plant.body.lock_hip = False
    robot.run_for(0.1)  # the inner legs have swung: a capture is armed for rising edges, so a first falling one is lost
    robot.plant.body.lock_hip = True
    robot.plant.body.inner.rate = 0.0
    robot.run_for(0.002)
    fault = robot.inject("MCH.joint_encoder", "offset", until="412 ms", offset=-40)
    before = joint.count - encoder.cell
    angle = joint.position_rad() - encoder.cell * RAD_PER_EDGE
    robot.run_for(0.009)
    assert joint.count - encoder.cell - before == -40
    # the gain of the firmware's fixed point is truncated: 2e-5 of 40 edges; its angle is floored to 1/65536
    off = joint.position_rad() - encoder.cell * RAD_PER_EDGE - angle
    assert off == pytest.approx(-40 * RAD_PER_EDGE, abs=2 / 65536)
    robot.run_for(0.01)
    assert joint.count - encoder.cell == before
    assert fault.cleared_ns > fault.ended_ns > 0


def test_an_offset_of_the_absolute_encoder_is_reached_at_the_limiters_pace_and_reported(robot):
    robot.plant.hip_word.noise_counts = 0.0
    robot.run_for(0.001)
    board = robot.board("MCH")
    true = board.encoder.counts
    robot.inject("MCH.absolute_encoder", "offset", until="320 ms", offset=100)
    spikes = noted(board, "AE_SPIKE")
    robot.run_for(0.01)
    assert board.encoder.counts == true + 100
    assert noted(board, "AE_SPIKE") - spikes == 9  # 11 counts per slot: nine slots too far, the tenth has 1 left
    assert board.encoder.angle_rad() == pytest.approx((true + 100) * 2 * math.pi / 8192, rel=1e-4)
    robot.run_for(0.02)
    assert board.encoder.counts == true


def test_an_offset_of_the_motor_current_is_the_same_in_the_firmware_in_amperes(robot):
    board, motor = robot.board("MCH"), robot.plant.hip
    fault = robot.inject("MCH.motor_current", "offset", until="310 ms", offset=-0.5)
    differences = []
    for _ in range(15):
        robot.run_for(0.0005)
        differences.append(board.readings.motor_current() - motor.current_A)
    # the current moves within a slot: the mean of 15 readings, with noise of 5 mA and the sensor's PWM offset of 50 mA
    assert sum(differences) / len(differences) == pytest.approx(-0.5, abs=0.1)
    assert fault.largest_difference == pytest.approx(-0.5)


def test_a_contact_that_sticks_is_believed_after_eleven_samples_and_no_longer_after_eleven_more(robot):
    foot = robot.board("MCFI").left_foot
    assert foot.state == 0  # the inner feet hang in the air
    robot.inject("MCFI.left_foot", "contact_stuck", until="310 ms", closed=1)
    robot.run_for(0.005)
    assert foot.state == 0
    robot.run_for(0.0015)  # 5.5 ms, and up to a slot and a conversion until the first sample
    assert foot.state == 1
    robot.run_for(0.0085)
    assert foot.state == 1
    robot.run_for(0.0015)
    assert foot.state == 0


def test_a_bias_of_the_gyro_arrives_in_the_user_interface_board_in_packets_whose_sum_fits(robot):
    imu = robot.board("UI").imu
    usual, packets, bad = imu.rate_x, imu.packets, imu.bad_checksums
    robot.inject("UI.imu", "gyro_bias", until="310 ms", rate=0.3)
    robot.run_for(0.009)
    assert imu.rate_x - usual == pytest.approx(0.3, abs=8 * 0.004)  # noise of both packets, and the legs at rest
    assert imu.packets - packets >= 8
    assert imu.bad_checksums == bad
    robot.run_for(0.01)
    assert imu.rate_x == pytest.approx(usual, abs=8 * 0.004)


def test_levels_that_are_stuck_at_a_pin_raise_no_interrupt(robot):
    robot.plant.body.lock_hip = False
    board = robot.board("MCH")
    robot.inject("MCH.joint_encoder", "stuck")
    robot.run_for(0.001)
    count = board.joint.count
    moved = robot.plant.hip_joint.cell
    robot.run_for(0.1)
    assert board.joint.count == count
    assert abs(robot.plant.hip_joint.cell - moved) > 5


def test_what_the_hip_motors_count_has_missed_is_drawn_back_by_its_re_zeroing(robot):
    motor, encoder = robot.board("MCH").motor, robot.plant.hip_motor
    robot.plant.body.lock_hip = False
    fault = robot.inject("MCH.motor_encoder", "swapped_sign")
    robot.run_for(0.06)
    robot.plant.body.lock_hip = True
    robot.plant.body.inner.rate = 0.0
    fault.stop()
    robot.run_for(0.001)
    assert fault.cleared_ns > 0
    assert "5 % at 45 Hz" in fault.permanent
    off = []
    for _ in range(2):
        off.append(motor.position_rad() - robot.board("MCH").encoder.radians)
        robot.run_for(0.5)
    assert abs(fault.miscount) > 50
    assert off[0] == pytest.approx(fault.miscount * math.pi / (192 * 66), rel=0.35)  # it draws in the 60 ms as well
    # 45.45 calls a second: 22 or 23 of them leave 0.95^22.7 = 0.31; the joint's word has noise of 0.3 counts, 0.2 mrad
    assert off[1] / off[0] == pytest.approx(0.31, abs=0.03 + 0.001 / abs(off[0]))
    assert encoder.cell != 0


# --- converters -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("factor", "sign"), [(1.5, 1), (0.5, -1)])
def test_a_gain_of_the_external_converter_is_seen_in_its_results(robot, factor, sign):
    converter = robot.board("MCFO").adc_external
    foot = list(converter.results[:4])[2]
    assert foot > 5000  # the outer feet stand
    fault = robot.inject("MCFO.adc_external", "gain", until="310 ms", factor=factor)
    robot.run_for(0.008)
    # the feet's noise has a deviation of 10 counts
    assert list(converter.results[:4])[2] == pytest.approx(min(8191, factor * foot), abs=60 * factor)
    assert fault.unit == "counts"
    assert fault.largest_difference * sign > 500
    robot.run_for(0.004)
    assert list(converter.results[:4])[2] == pytest.approx(foot, abs=60)
    assert fault.cleared_ns == 310_250_000
    assert list(converter.gains) == [1, 2, 4, 5, 8, 10, 16, 20]


@pytest.mark.parametrize("offset", [300, -300])
@pytest.mark.parametrize("place", ["MCH.adc_internal", "CSR.adc_internal"])
def test_an_offset_of_an_internal_converter_is_its_number_of_counts(robot, place, offset):
    fault = robot.inject(place, "offset", until="310 ms", offset=offset)
    board = robot.board(place[: place.index(".")])
    before = board.adc_internal.result if place.startswith("MCH") else board.adc.DR(1)
    robot.run_for(0.008)
    now = board.adc_internal.result if place.startswith("MCH") else board.adc.DR(1)
    # 26 V are some 800 counts of 1023, at which it ends; noise of 30 mV is a count, the voltage moves by some more
    assert now == pytest.approx(min(1023, before + offset), abs=12)
    robot.run_for(0.004)
    assert fault.cleared_ns == 310_250_000
    # at the router's current, some 380 counts, and at the hip's voltage where it ends below the top
    assert abs(fault.largest_difference) in range(100, 301)


@pytest.mark.parametrize(("share", "factor"), [(0.2, 1.25), (-1.0, 0.5)])
def test_a_reference_that_sags_makes_every_voltage_read_higher(robot, share, factor):
    board = robot.board("MCH")
    before = board.adc_internal.result
    fault = robot.inject("MCH.adc_internal", "reference_sag", until="310 ms", share=share)
    robot.run_for(0.008)
    assert board.adc_internal.result == pytest.approx(min(1023, before * factor), abs=12)
    robot.run_for(0.004)
    assert board.adc_internal.result == pytest.approx(before, abs=12)
    assert fault.cleared_ns == 310_250_000


def reading(board, place):
    """A result of a converter at a voltage that hardly moves: battery, supply, or a standing foot."""
    if place == "MCFO.adc_external":
        return list(board.adc_external.results[:4])[2]
    return board.adc.DR(1) if place == "CSR.adc_internal" else board.adc_internal.result


# What the value is multiplied by, and what is added, at the converters that the tests above leave out.
TRANSFERS = [
    ("MCH.adc_internal", "gain", {"factor": 0.8}, 0.8, 0),
    ("CSR.adc_internal", "gain", {"factor": 0.7}, 0.7, 0),
    ("CSR.adc_internal", "gain", {"factor": 1.2}, 1.2, 0),
    ("CSR.adc_internal", "reference_sag", {"share": 0.2}, 1.25, 0),
    ("CSR.adc_internal", "reference_sag", {"share": -0.25}, 0.8, 0),
    ("MCFO.adc_external", "offset", {"offset": 400}, 1.0, 400),
    ("MCFO.adc_external", "offset", {"offset": -400}, 1.0, -400),
    ("MCFO.adc_external", "reference_sag", {"share": 0.1}, 1.0 / 0.9, 0),
    ("MCFO.adc_external", "reference_sag", {"share": -0.25}, 0.8, 0),
]


@pytest.mark.parametrize(("place", "mode", "parameters", "factor", "more"), TRANSFERS)
def test_a_transfer_that_is_wrong_is_seen_in_the_results_and_gone_after(robot, place, mode, parameters, factor, more):
    board = robot.board(place[: place.index(".")])
    top, noise = (8191, 60) if place == "MCFO.adc_external" else (1023, 12)  # counts; as in the tests above
    before = reading(board, place)
    fault = robot.inject(place, mode, until="310 ms", **parameters)
    robot.run_for(0.008)
    assert reading(board, place) == pytest.approx(min(top, factor * before + more), abs=noise * max(1.0, factor))
    robot.run_for(0.006)
    assert reading(board, place) == pytest.approx(before, abs=noise)
    assert fault.acted and fault.largest_difference * (factor - 1.0 or more) > 0.0
    assert fault.cleared_ns == 310_250_000


def test_a_late_conversion_of_the_internal_converter_is_reported_when_it_comes_after_its_slot(robot):
    board = robot.board("MCH")
    before = noted(board, "ADCI_DNF")
    fault = robot.inject("MCH.adc_internal", "late_conversion", until="310 ms", late_us=600)
    robot.run_for(0.009)
    reported = noted(board, "ADCI_DNF") - before
    assert reported >= 8  # of 18 slots: a conversion of more than a slot is still busy in every other one at least
    assert fault.acted and fault.largest_difference == 600
    robot.run_for(0.002)
    before = noted(board, "ADCI_DNF")
    robot.run_for(0.01)
    assert noted(board, "ADCI_DNF") == before
    assert fault.cleared_ns == 310_250_000


def test_a_conversion_that_never_ends_stops_a_motor_board_for_good_although_the_converter_works_again(robot):
    board = robot.board("MCH")
    fault = robot.inject("MCH.adc_external", "missing_conversion", until="305 ms")
    robot.run_for(0.001)
    assert fault.acted
    passes = board.scheduler.find("mc_compliant_control").calls
    robot.run_for(0.03)
    assert fault.cleared_ns == 305_250_000
    assert not board.adc_external.busy
    assert board.scheduler.find("mc_compliant_control").calls == passes  # it waits for what will not come
    assert not robot.plant.hip.drive.powered  # the watchdog starved
    assert "reset" in fault.permanent


def test_a_conversion_of_the_internal_converter_that_never_ends_is_reported_in_each_slot_and_forgotten_after(robot):
    board = robot.board("MCH")
    before = noted(board, "ADCI_DNF")
    fault = robot.inject("MCH.adc_internal", "missing_conversion", until="310 ms")
    robot.run_for(0.009)
    assert noted(board, "ADCI_DNF") - before == pytest.approx(17, abs=1)  # 18 slots, the first starts it
    robot.run_for(0.002)
    before = noted(board, "ADCI_DNF")
    robot.run_for(0.01)
    assert noted(board, "ADCI_DNF") == before
    assert fault.cleared_ns == 310_250_000
    assert fault.permanent == ""


def test_late_conversions_lengthen_the_slots_that_wait_for_them_and_end(robot):
    board = robot.board("MCH")
    task = board.scheduler.find("mc_compliant_control")
    fault = robot.inject("MCH.adc_external", "late_conversion", until="320 ms", late_us=300)
    calls = task.calls
    robot.run_for(0.019)
    assert task.calls - calls < 30  # of 38 slots: two conversions of 0.33 ms each do not fit one
    assert fault.largest_difference == 300
    robot.run_for(0.005)
    calls = task.calls
    robot.run_for(0.01)
    assert task.calls - calls == pytest.approx(20, abs=1)
    assert fault.cleared_ns == 320_250_000


def test_conversions_that_are_a_little_late_act_too(robot):
    fault = robot.inject("MCH.adc_external", "late_conversion", until="305 ms", late_us=5)
    robot.run_for(0.01)
    assert fault.acted
    assert fault.cleared_ns > 0


def test_a_late_conversion_without_a_waiting_program_is_refused(robot):
    with pytest.raises(UserError, match="burst mode"):
        robot.inject("CSR.adc_internal", "late_conversion")


# --- the same bytes -------------------------------------------------------------------------------------------

SEVERAL = (
    ("MCH.joint_encoder", "lost_edges", "50 ms", "90 ms", {"share": 0.5}),
    ("MCFO.motor_encoder", "noise", "50 ms", "90 ms", {}),
    ("MCH.absolute_encoder", "bit_flips", "40 ms", "80 ms", {"share": 0.3}),
    ("MCFI.motor_current", "noise", "40 ms", None, {}),
    ("UI.imu", "spike", "60 ms", None, {}),
    ("MCFO.left_foot", "contact_chatter", None, None, {}),
    ("MCFI.motor", "short", "70 ms", "100 ms", {}),
    ("MCFO.cable", "cable_slip", "70 ms", "100 ms", {}),
)


def digest(faults, seed=1):
    with contextlib.closing(Ranger(Scenario(seed=seed))) as robot:
        armed = [robot.inject(place, mode, at, until, **more) for place, mode, at, until, more in faults]
        robot.run_for(0.15)
        return robot.trace_digest(), [fault.summary() for fault in armed]


def test_the_same_faults_give_the_same_bytes_and_each_changes_them():
    trace, stamps = digest(SEVERAL)
    assert digest(SEVERAL) == (trace, stamps)
    assert trace != digest(())[0]
    assert digest(SEVERAL, seed=2)[0] != trace
    assert all(fault["acted"] for fault in stamps[1:])


@pytest.mark.skipif(not loading.RUNS_COMPILED, reason="nothing is compiled here: there is nothing to compare with")
def test_the_same_faults_give_the_same_bytes_interpreted():
    def reported(interpreted):
        arguments = [
            option
            for place, mode, at, until, more in SEVERAL
            for option in (
                "--fault",
                f"{place}:{mode}{''.join(f',{name}={value}' for name, value in more.items())}"
                f"@{at or '0 s'}{f'..{until}' if until else ''}",
            )
        ]
        done = subprocess.run(
            [sys.executable, "-m", "ranger_sim", "walk", "--time", "0.15s", "--json", "-", *arguments],
            env={**os.environ, "RANGER_SIM_INTERPRETED": "1" if interpreted else ""},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        summary = json.loads(done.stdout)
        return summary["compiled"], summary["trace_digest"], summary["faults"]

    compiled, interpreted = reported(interpreted=False), reported(interpreted=True)
    assert (compiled[0], interpreted[0]) == (True, False)
    assert compiled[1:] == interpreted[1:]
    assert sum(fault["acted"] for fault in compiled[2]) >= 7


def test_a_fault_that_never_begins_leaves_the_run_as_it_is():
    assert digest((("MCH.joint_encoder", "stuck", "1 h", None, {}),))[0] == digest(())[0]


def test_steps_in_which_a_run_is_cut_change_nothing():
    def cut(pieces):
        with contextlib.closing(Ranger(Scenario())) as robot:
            for place, mode, at, until, more in SEVERAL:
                robot.inject(place, mode, at, until, **more)
            for _ in range(pieces):
                robot.run_for(0.15 / pieces)
            return [fault.summary() for fault in robot.faults]

    assert cut(1) == cut(37)


def test_a_slippery_floor_lets_a_walking_robot_slide_where_the_usual_one_holds():
    def slip_s(faults):
        with contextlib.closing(Ranger(Scenario())) as robot:
            for place, mode, at, until, more in faults:
                robot.inject(place, mode, at, until, **more)
            robot.run_for(2.4)
            return robot.plant.body.seen.slip_s

    assert slip_s([("world.floor", "slippery", "step 1", None, {"friction": 0.05})]) > 10 * slip_s([]) + 0.01
