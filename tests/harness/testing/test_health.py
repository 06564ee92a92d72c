"""What no healthy robot does is found, what a healthy walk does is not, and what a test expects must come."""

import contextlib

import pytest

from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.normal_errors import BURST_S
from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.harness.scenario import Scenario
from ranger_sim.harness.testing.health import Expected, Health, amount
from ranger_sim.harness.testing.robots import assert_healthy, new_robot
from ranger_sim.harness.wiring import ranger as wiring

NOTHING = lambda: None  # noqa: E731  (a function of a schedule that does nothing)


@pytest.fixture
def robot():
    with contextlib.closing(Ranger(Scenario(seed=2))) as made:
        yield made


@pytest.mark.parametrize("scenario", [{"seed": 1}, {"seed": 4, "floor_roughness_m": 0.001}, {"controller": "robust"}])
def test_a_walk_is_healthy_and_so_is_each_of_its_parts(scenario):
    robot = new_robot(**scenario)
    parts = Health(robot)
    for _ in range(4):
        robot.run_for(2.0)
        assert parts.faults() == []
    assert_healthy(robot)
    assert robot.steps >= 8


def test_the_normal_rates_are_those_of_the_master_table():
    assert error_table.NORMAL_PER_S[error_table.MC_TCURR_OOB]["MCH"] == 350
    assert error_table.NORMAL_AT_START[error_table.SSP_LOW_RATE] == {"CSR": 1}
    # every one has room above what was measured: docs/testing.md has the figures
    assert set(error_table.NORMAL_PER_S) < set(error_table.NAMES)


def test_an_error_is_told_when_it_is_more_than_normal_and_not_before(robot):
    robot.run_for(0.02)
    health = Health(robot)
    robot.run_for(0.01)
    allowed = int(error_table.NORMAL_PER_S[error_table.QDC_CH01_GLTCH]["MCH"] * (0.01 + BURST_S))
    for _ in range(allowed):
        robot.board("MCH").errors.report(error_table.QDC_CH01_GLTCH)
    assert health.faults() == []
    robot.run_for(0.01)
    for _ in range(allowed + 1):
        robot.board("MCH").errors.report(error_table.QDC_CH01_GLTCH)
    [fault] = health.faults()
    assert fault.startswith(f"MCH: {allowed + 1} x QDC_CH01_GLTCH (")
    assert fault.endswith("in 0.010 s, normal is up to 15 a second")
    robot.run_for(0.01)
    robot.board("MCH").errors.report(error_table.ADCI_BAD_CHAN)
    assert len(health.faults()) == 1 and health.faults() == []  # told once


def test_what_comes_once_after_power_up_is_normal_only_then(robot):
    robot.run_for(0.05)
    assert robot.board("CSR").errors.totals[error_table.SSP_LOW_RATE] == 1
    assert_healthy(robot)
    health = Health(robot)
    robot.run_for(0.01)
    robot.board("CSR").errors.report(error_table.SSP_LOW_RATE)
    assert "CSR: 1 x SSP_LOW_RATE" in health.faults()[0]


def test_an_overrun_is_told_and_may_be_expected_of_its_board(robot):
    robot.run_for(0.01)
    health = Health(robot)
    robot.replace("MCSI", "dn_update_pwm", NOTHING, cost=40_000)
    robot.run_for(0.01)
    faults = health.faults()
    assert any(line.startswith("slot overruns: MCSI ") for line in faults)
    assert any("MCSI: " in line and "ASCHED_DNF" in line for line in faults)
    robot.run_for(0.01)
    assert health.faults(Expected(overruns="MCSI")) == []
    robot.run_for(0.01)
    assert health.faults(Expected(overruns=True)) == []
    robot.run_for(0.01)
    told = health.faults(Expected(overruns="MCH"))
    assert "expected and not seen: slot overruns of MCH" in told
    assert any("MCSI" in line and "expected only of MCH" in line for line in told)


def test_bus_errors_and_bus_off_are_told_and_may_be_expected(robot):
    robot.run_for(0.01)
    health = Health(robot)
    node = next(node for node in robot.buses[0].nodes if node.name == "MCH")
    node.transmit_errors = 255  # the next error that it meets sends it off the bus
    robot.buses[0].set_bit_error_rate(2e-3)
    robot.run_for(0.02)
    robot.buses[0].set_bit_error_rate(0.0)
    told = health.faults()
    assert any(line.startswith("error frames: can1 ") for line in told)
    assert any(line.startswith("bus-off: ") and "MCH" in line for line in told)
    assert any("CAN1_BUS" in line or "CAN1_TX_BUSOFF" in line for line in told)


def test_error_frames_that_are_expected_bring_the_errors_of_their_controllers_along(robot):
    robot.run_for(0.01)
    health = Health(robot)
    robot.buses[0].set_bit_error_rate(1e-4)
    robot.run_for(0.02)
    robot.buses[0].set_bit_error_rate(0.0)
    assert robot.buses[0].counters.errors > 0
    assert health.faults(Expected(bus_errors="can1")) == []
    robot.run_for(0.01)
    assert health.faults(Expected(bus_errors=True)) == ["expected and not seen: error frames"]


def test_an_expected_error_must_come_and_on_its_board(robot):
    robot.run_for(0.01)
    health = Health(robot)
    robot.run_for(0.01)
    robot.board("MCFI").errors.report(error_table.AE_SPIKE)
    assert health.faults(Expected(("AE_SPIKE",))) == []
    robot.run_for(0.01)
    robot.board("MCFI").errors.report(error_table.AE_SPIKE)
    assert health.faults(Expected(("MCFO:AE_SPIKE",))) == ["expected and not seen: error MCFO:AE_SPIKE"]


def test_a_fall_is_told_once_and_may_be_expected():
    robot = new_robot(seed=1, warmed_up="step 2")
    health = Health(robot)
    robot.operator.press(2, robot.loop.time, 200_000_000)  # stops the controller
    robot.run_for(5.0)
    assert robot.ended
    [fault] = [line for line in health.faults() if "fell" in line]
    assert fault.startswith("the robot fell (")
    assert [line for line in health.faults() if "fell" in line] == []
    assert "expected and not seen: a fall" in Health(Ranger(Scenario())).faults(Expected(fall=True))


def test_an_injected_fault_that_did_not_act_is_told_unless_it_is_expected_or_called_off(robot):
    robot.run_for(0.01)
    health = Health(robot)
    robot.inject("MCH.absolute_encoder", "offset")
    assert health.faults() == ["injected faults that did not act: MCH.absolute_encoder:offset 1"]  # no time has passed
    robot.inject("UI.imu", "gyro_bias", at="step 3")
    robot.inject("UI.imu", "noise", at="step 4").stop()
    robot.run_for(0.01)
    assert robot.faults[0].acted
    jump = Expected(("MCH:AE_SPIKE",))  # the offset's own
    assert health.faults(jump) == ["injected faults that did not act: UI.imu:gyro_bias 1"]
    assert health.faults(Expected(idle_faults=True)) == ["expected and not seen: injected faults that did not act"]
    robot.inject("UI.imu", "gyro_bias", at="step 3")
    assert health.faults(Expected(idle_faults="UI.imu:gyro_bias")) == []
    with pytest.raises(AssertionError, match="did not act: UI.imu:gyro_bias 2"):
        assert_healthy(robot, errors=("MCH:AE_SPIKE",))


def test_amounts_are_held_exactly():
    assert amount("x", False, {"a": 0}) == []
    assert amount("x", False, {"a": 2, "b": 0}) == ["x: a 2"]
    assert amount("x", False, {"a": 2}, may_be=True) == []
    assert amount("x", True, {"a": 2}) == [] and amount("x", True, {"a": 0}) == ["expected and not seen: x"]
    assert amount("x", 2, {"a": 1, "b": 1}) == [] and amount("x", 3, {"a": 2}) == ["x: a 2, expected are 3"]
    assert amount("x", "a", {"a": 1}) == []
    assert amount("x", "a", {"a": 1, "b": 1}) == ["x: a 1, b 1, expected only of a"]


def test_an_error_that_the_table_has_not_cannot_be_expected():
    with pytest.raises(UserError, match="expected error 'AE_SPYKE': .*did you mean 'AE_SPIKE'"):
        Expected(("AE_SPYKE",)).check(RANGER, wiring.BOARDS)
    with pytest.raises(UserError, match="unknown board 'MCX' .available: MCH"):
        Expected(("MCX:AE_SPIKE",)).check(RANGER, wiring.BOARDS)
