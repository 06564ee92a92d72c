"""Faults at buses, controllers and serial lines of the whole robot: the firmware's reports of them, and their end."""

from contextlib import closing

import pytest

from ranger_sim.can_bus.node import OPERATING
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

START, END = "60 ms", "70 ms"
START_NS, END_NS = 60_000_000, 70_000_000


class Run:
    """A robot that is held for 150 ms, with one fault between 60 and 70 ms, and what its boards noted of it."""

    def __init__(self, place, mode, at=START, until=END, seconds=0.15, **parameters):
        with closing(Ranger(Scenario(seed=1))) as self.robot:
            self.fault = self.robot.inject(place, mode, at, until, **parameters)
            self.robot.run_for(0.06)
            self.before = {name: list(board.errors.totals) for name, board in self.robot.boards.items()}
            self.robot.run_for(seconds - 0.06)

    def noted(self, board, error):
        """How often a board noted an error since the fault began."""
        code = getattr(codes, error)
        return self.robot.boards[board].errors.totals[code] - self.before[board][code]


def test_a_missing_acknowledgement_is_reported_by_the_sender_and_the_frame_comes_all_the_same():
    run = Run("MCH.can1", "ACK", frame="MCH_ANGLE", count=2)
    assert run.fault.acted_count == 2 and START_NS <= run.fault.acted_ns < END_NS
    assert run.fault.seen == {("MCH", "ACK", "primary"): 2, ("CSR", "FORM", "secondary"): 2}
    assert run.noted("MCH", "CAN1_BUS_TX") >= 1 and run.noted("CSR", "CAN1_BUS_RX") >= 1
    assert run.robot.buses[0].counters.retries == 2 and run.robot.buses[0].counters.lost == 0
    assert run.fault.cleared_ns >= END_NS


@pytest.mark.parametrize(
    ("place", "error", "parameters", "reported"),
    [
        ("MCH.can1", "BIT", {}, ("MCH", "CAN1_BUS_TX")),
        ("MCH.can1", "BIT", {"sender": 0}, ("MCH", "CAN1_BUS_RX")),
        ("MCFI.can4", "BIT_STUFFING", {}, ("MCFI", "CAN2_BUS_RX")),
        ("MCFI.can4", "FORM", {}, ("MCSI", "CAN2_BUS_RX")),
        ("MCSI.can4", "CRC", {}, ("MCSI", "CAN2_BUS_RX")),
        ("CSR.can3", "BROKEN_ERROR_FRAME", {}, ("MCFO", "CAN1_BUS_RX")),
    ],
)
def test_every_error_of_the_bus_is_reported_by_the_firmware_and_its_counters_fall_again(
    place, error, parameters, reported
):
    run = Run(place, error, count=3, **parameters)
    assert run.fault.acted_count == 3
    assert run.noted(*reported) > 0
    assert run.fault.cleared_ns >= END_NS
    assert all(node.mode == OPERATING and not node.passive for bus in run.robot.buses for node in bus.nodes)


def test_a_sender_that_cannot_see_an_error_is_refused_before_anything_runs():
    with closing(Ranger(Scenario(seed=1))) as robot:
        with pytest.raises(UserError, match="does not check the CRC"):
            robot.inject("MCH.can1", "CRC", sender=1)
        with pytest.raises(UserError, match="no recessive stuff bit"):
            robot.inject("MCH.can1", "BIT_STUFFING", sender=1, frame="0x555")
        with pytest.raises(UserError, match="did you mean 'MCH_ANGLE'"):
            robot.inject("MCH.can1", "loss", frame="MCH_ANGEL")
        with pytest.raises(UserError, match="it needs"):
            robot.inject("can1", "ACK")


def test_a_lost_command_never_reaches_the_motor_board_and_is_not_reported():
    command = "MCH_COMMAND_CURRENT"
    run = Run("MCH.can1", "loss", frame=command)
    usual = Run("MCH.can1", "loss", frame=command, at="10 s", until="11 s")
    receiver = {name: run_.robot.board("MCH").can for name, run_ in (("lost", run), ("usual", usual))}
    number = all_variables.ID_OF[command]
    frames = {name: can.receivers[number].frames for name, can in receiver.items()}
    assert frames["usual"] - frames["lost"] == run.fault.acted_count > 0
    assert not usual.fault.acted
    assert run.noted("MCH", "CAN1_BUS_RX") == 0
    assert run.fault.cleared_ns > END_NS


def test_a_corrupted_and_a_late_frame_differ_where_they_are_received():
    run = Run("CSR.can1", "corruption", frame="MCH_ANGLE", bit=31)
    assert run.fault.acted_count in (4, 5) and run.fault.cleared_ns > END_NS  # one every 2 ms
    late = Run("CSR.can1", "delay", frame="MCH_ANGLE", late_us=3000)
    assert late.fault.acted_count == run.fault.acted_count and late.fault.largest_difference == 3000.0


def test_the_main_brain_shows_a_corrupted_angle_with_its_sign_changed():
    with closing(Ranger(Scenario(seed=1))) as robot:
        robot.run_for(0.06)
        right = robot.variable("MCH_ANGLE")
        robot.inject("CSR.can1", "corruption", frame="MCH_ANGLE", bit=31)
        robot.run_for(0.01)
        assert right != 0.0 and robot.variable("MCH_ANGLE") == pytest.approx(-right, rel=0.02)


def test_a_board_that_is_thrown_off_its_bus_restarts_and_is_back_after_128_sequences():
    with closing(Ranger(Scenario(seed=1))) as robot:
        fault = robot.inject("MCFI.can4", "bus_off", START)
        robot.until("error CAN2_TX_BUSOFF from MCFI", within="100 ms")
        thrown_ns = fault.acted_ns
        node = fault.controller_node
        while node.mode != OPERATING:
            robot.run_for(0.00025)
        # 128 sequences of 11 recessive bits are 469 us on an idle bus; this one carries two other boards' frames too
        assert 0.4e6 < robot.loop.time - thrown_ns < 20e6
        assert fault.acted_count == 1 and node.transmit_errors == 0
        totals = robot.board("MCSI").errors.totals
        assert totals[codes.CAN2_BUS_RX] > 0
        assert fault.active  # once is over, and nothing is done to it any more: ending it leaves the bus as it is
        errors = robot.buses[3].counters.errors
        fault.stop()
        robot.run_for(0.05)
        assert fault.cleared_ns > fault.ended_ns > 0 and robot.buses[3].counters.errors == errors


def test_a_babbling_node_starves_its_bus_and_every_other_one_goes_on():
    run = Run("can1", "babbling")
    # A frame of zeros takes 127 bits with its intermission, 42 1/3 us, so 236 fit; some of them meet the router's frame
    # of identifier 0, the time, which is the only one that it cannot beat, and both are repeated.
    assert run.fault.acted_count == pytest.approx(10_000 / 42.333, abs=5)
    frames = run.robot.buses[0].counters
    # what waited longest: the whole of it
    assert max(frames.response_max_ns[1:]) > END_NS - START_NS - 1_000_000
    assert max(run.robot.buses[1].counters.response_max_ns) < 2_000_000
    assert run.noted("MCH", "CAN_TX_QUEUE_FULL") > 0
    assert run.fault.cleared_ns >= END_NS


def test_a_babbling_node_with_a_period_keeps_it():
    run = Run("can2", "babbling", frame="0x7ff", period_us=500)
    assert run.fault.acted_count == pytest.approx(20, abs=1)
    assert run.robot.buses[1].counters.frames_by_identifier[0x7FF] == run.fault.acted_count


def test_a_second_sender_of_an_identifier_makes_both_passive_before_one_gives_way():
    run = Run("can1", "duplicate", frame="MCH_ANGLE", until="62 ms")
    assert run.fault.acted_count >= 1
    assert run.noted("MCH", "CAN1_ERR_PASS") >= 1 and run.noted("MCH", "CAN1_ERR_WARN") >= 1
    assert run.fault.cleared_ns > 0
    with pytest.raises(UserError, match="frame="):
        run.robot.inject("can1", "duplicate")


def test_noise_makes_error_frames_and_frames_are_repeated():
    run = Run("can3", "noise", rate=1e-3)
    bus = run.robot.buses[2]
    # about a thousandth of 30,000 bits
    assert run.fault.acted and 8 <= bus.counters.errors <= 60
    assert bus.disturbance.bit_error_rate == 0.0 and run.fault.cleared_ns > END_NS


def test_a_cut_cable_parts_a_board_from_its_bus_and_a_mended_one_brings_it_back():
    run = Run("MCFI.can4", "cut")
    bus, far = run.robot.buses[3], run.fault.far
    assert run.fault.acted and far.counters.errors > 100 and far.counters.frames == 0
    assert far.nodes[0].name == "MCFI"
    # alone it became error passive: its program was told
    assert run.noted("MCFI", "CAN2_ERR_PASS") >= 1
    assert run.noted("MCSI", "CAN2_ERR_PASS") == 0
    assert run.fault.cleared_ns > END_NS and far not in run.robot.loop.buses
    assert [node.mode for node in bus.nodes] == [OPERATING] * 3


def test_a_wrong_bit_rate_is_only_errors_until_it_is_set_right():
    run = Run("MCSI.can4", "bit_rate", until="62 ms")
    assert run.fault.acted and run.noted("MCSI", "CAN2_BUS_RX") > 0
    assert run.fault.cleared_ns > 62_000_000
    with closing(Ranger(Scenario(seed=1))) as robot, pytest.raises(UserError, match="synchronisation"):
        robot.inject("MCSI.can4", "bit_rate", rate=2.97e6)


def test_segments_with_a_wrong_checksum_are_dropped_by_either_end():
    to_brain = Run("MB.ssp", "checksum", every=5)
    assert to_brain.fault.acted_count == 10 and to_brain.fault.cleared_ns > END_NS
    assert to_brain.robot.board("MB").link.checksum_errors == 10 + 1  # the first one after power-up is out of step
    to_router = Run("CSR.ssp", "checksum", bit=20)
    # an empty segment begins with zero, and the router does not look at its checksum
    assert to_router.fault.acted_count == 50
    assert 0 < to_router.robot.board("CSR").link.checksum_errors <= 50


def test_an_exchange_that_is_missing_is_a_low_rate_to_the_router():
    run = Run("CSR.ssp", "missing")
    assert run.fault.acted_count == 50
    assert run.robot.board("CSR").link.low_rate in (50, 51)  # the first tick after power-up is one as well
    assert run.fault.cleared_ns > END_NS


def test_a_broken_line_to_the_inertial_unit_loses_its_bytes():
    run = Run("UI.serial", "drop_out")
    assert run.fault.acted_count == 10 and run.fault.largest_difference == 31  # a packet per ms
    assert run.fault.cleared_ns > END_NS
    with closing(Ranger(Scenario(seed=1))) as robot, pytest.raises(UserError, match="so its bytes cannot be missed"):
        robot.inject("MB.serial", "drop_out")


def test_the_same_fault_and_seed_give_the_same_bytes_however_time_is_cut():
    digests = set()
    for cuts in (1, 7):
        with closing(Ranger(Scenario(seed=3))) as robot:
            robot.inject("MCH.can1", "CRC", START, END, share=0.5)
            robot.inject("can4", "babbling", START, END)
            for n in range(cuts):
                robot.run_for((n + 1) * 0.1 / cuts - robot.time_s)
            digests.add(robot.trace_digest())
    assert len(digests) == 1


def test_a_fault_that_is_armed_and_does_not_begin_changes_no_byte():
    digests = set()
    for fault in (None, ("can1", "babbling"), ("MCH.can1", "bit_rate"), ("MCH.processor", "crystal")):
        with closing(Ranger(Scenario(seed=3))) as robot:
            if fault is not None:
                robot.inject(*fault, "10 s")
            robot.run_for(0.1)
            digests.add(robot.trace_digest())
    assert len(digests) == 1


def test_faults_are_typed_as_they_are_printed():
    fault = CATALOGUE.typed("MCH.can1:ACK,frame=MCH_ANGLE,every=3@60 ms..70 ms")
    assert fault.text() == "MCH.can1:ACK,frame=MCH_ANGLE,every=3@60 ms..70 ms"
