"""The servo under test: it moves, keeps its time in slots and on the wire, and its faults are noticed."""

import pytest

PERIODS = {
    "DRIVE_ANGLE": "2 ms",
    "DRIVE_RATE": "4 ms",
    "DRIVE_CURRENT": "4 ms",
    "CONTROL_TARGET_ANGLE": "4 ms",
    "CONTROL_TARGET_RATE": "4 ms",
    "CONTROL_STATE": "4 ms",
}
# A frame waits for the one on the wire (8 bytes at 500 kbit/s: 270 us with all stuff bits) and for those before it; the
# crystals are 100 ppm apart at most.
JITTER = "300 us"


def test_the_arm_comes_to_its_first_target_and_stays(machine):
    machine.until("angle_rad > 1.49", within="1 s")
    machine.run_for(0.68 - machine.time_s)
    shown = machine.quantities()
    assert shown["angle_rad"] == pytest.approx(1.5, abs=0.01)  # an edge is 0.006 rad
    # m g l sin(1.5) / k, plus what friction holds
    assert shown["current_A"] == pytest.approx(0.0147 * 0.9975 / 0.0234, abs=0.002 / 0.0234 + 0.03)


@pytest.mark.machine(warmed_up="0.2 s")
@pytest.mark.parametrize("name", PERIODS)
def test_every_frame_keeps_its_period(machine, name):
    machine.run_for(0.5)
    machine.wire().assert_period(name, PERIODS[name], jitter=JITTER)


@pytest.mark.machine(warmed_up="0.2 s")
def test_slots_keep_their_limits_while_the_arm_moves(machine):
    drive, control = machine.slots("DRIVE"), machine.slots("CONTROL")
    machine.run_for(0.5)
    drive.assert_no_overrun()
    drive.assert_within("100 us")
    drive.assert_function("position_loop", at_most=1800)
    drive.assert_interrupt("on_edge", at_most=150)
    control.assert_no_overrun()
    assert len(drive) == pytest.approx(2000, abs=2) and drive.margin > 0.6


@pytest.mark.machine(warmed_up="0.2 s")
def test_the_boards_own_figure_of_their_longest_slot_is_what_was_recorded(machine):
    drive = machine.slots("DRIVE")
    machine.run_for(0.5)
    longest_s = machine.wire().assert_execution_time("DRIVE", at_most="100 us")
    # measure_slot is not in its own figure, nor what follows it
    assert drive.worst().taken_ns * 1e-9 - 20e-6 < longest_s <= drive.worst().taken_ns * 1e-9


@pytest.mark.machine(warmed_up="0.2 s")
def test_a_target_reaches_the_current_loop_within_its_time(machine):
    machine.run_for(0.3)
    machine.wire().assert_latency("CONTROL_TARGET_ANGLE", "DRIVE_CURRENT", at_most="5 ms")


@pytest.mark.expects_errors("DRIVE:ENCODER_DEAD", "CONTROL:DRIVE_FAULT")
def test_an_encoder_that_sticks_in_a_move_is_noticed_and_the_motor_gets_no_power(machine):
    fault = machine.inject("DRIVE.encoder", "stuck", at="angle_rad > 0.5", proof=True)
    machine.until("error ENCODER_DEAD from DRIVE", within="1 s")
    machine.run_for(0.05)
    assert fault.acted and (fault.detected.board, fault.detected.code) == ("DRIVE", "ENCODER_DEAD")
    assert 50 < fault.detection_ms < 150  # 50 ms without an edge, after the loop has run into its limit
    assert machine.quantities()["voltage_V"] == 0.0


@pytest.mark.expects_errors("CONTROL:FOLLOWING")
def test_a_lead_that_comes_off_is_seen_by_the_supervision(machine):
    fault = machine.inject("DRIVE.lead", "open", at="0.2 s", proof=True)
    machine.until("error FOLLOWING from CONTROL", within="1 s")
    assert fault.acted and fault.detected.code == "FOLLOWING"
    assert fault.proof().first_firmware.name == "DRIVE_CURRENT"


def test_an_amplifier_that_is_off_moves_the_arm_without_an_error(machine):
    fault = machine.inject("DRIVE.current", "offset", at="0.55 s", until="+50 ms", offset=0.2, proof=True)
    machine.run_for(0.7)
    assert fault.acted and fault.detected is None and fault.cleared_ns > fault.ended_ns > 0
    assert fault.proof().first_firmware.name in ("DRIVE_CURRENT", "DRIVE_ANGLE", "DRIVE_RATE")
