"""What a fault did, on a walking robot with its golden twin."""

import contextlib

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario


def test_a_gyro_that_lies_is_seen_on_its_bus_first_and_the_main_brain_reacts():
    with contextlib.closing(Ranger(Scenario())) as robot:
        robot.run_for(3.0)
        fault = robot.inject("UI.imu", "gyro_bias", at="step 6", proof=True, rate=0.4)
        assert fault.proof().first is None  # nothing yet
        robot.until("step 8", within="10 s")
        proof = fault.proof()
        assert fault.acted
        assert (proof.first.where, proof.first.name) == ("can2", "UI_ANG_RATE_X")
        # the unit's packet comes every ms, the board forwards it within its slots of 1 ms, the frame takes 40 us
        assert 0.0 < proof.after_ms(proof.first) < 8.0
        assert fault.reaction.state != fault.reaction.instead_of
        assert proof.after_ms(proof.first) < proof.reaction_ms < 1000.0


def test_a_fault_that_has_not_begun_differs_in_nothing_from_its_twin():
    with contextlib.closing(Ranger(Scenario(), log="window")) as robot:
        robot.run_for(1.0)
        fault = robot.inject("MCH.absolute_encoder", "stuck", at="step 30", proof=True)
        robot.run_for(1.2345)
        robot.run_for(0.5)
        proof = fault.proof()
        assert (proof.first, proof.reaction, proof.detected) == (None, None, None)
        assert not proof.acted
        digest = robot.trace_digest()
    with contextlib.closing(Ranger(Scenario())) as again:
        again.run_for(2.7345)
        assert again.trace_digest() == digest  # who listens changes nothing


def test_a_fault_without_a_golden_run_says_how_to_get_one():
    with contextlib.closing(Ranger(Scenario())) as robot:
        fault = robot.inject("MCH.absolute_encoder", "stuck")
        with pytest.raises(UserError, match=r"it has no golden run; Ranger\.inject\(\.\.\., proof=True\)"):
            fault.detected  # noqa: B018


def test_the_golden_runs_process_ends_with_the_robot():
    robot = Ranger(Scenario())
    fault = robot.inject("MCH.absolute_encoder", "stuck", at="step 2", proof=True)
    robot.close()
    with pytest.raises(UserError, match="the robot was closed before"):
        fault.proof()
    with pytest.raises(ChildProcessError):  # nobody left to wait for
        import os

        os.waitpid(fault.twin.process, 0)
