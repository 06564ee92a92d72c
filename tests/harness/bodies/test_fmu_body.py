"""A unit for co-simulation as the body: this project's own, whose numbers are those of the body without FMI."""

import pytest

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.harness.bodies.mapping import Drive, Encoder, Input, Mapping, Voltage, Word
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools import cli
from ranger_sim.tools.fmu.body import ExportedBody, given_of

pytest.importorskip("pythonfmu3")
pytest.importorskip("fmpy")
from ranger_sim.harness.bodies.fmu_body import FmuBody  # noqa: E402

START = {"held.now": False, "outer_ankle.watchdog": True}
WIRES = Mapping(
    [Input("outer_ankle.match_2", per_duty=600.0, low=0.0)],
    [Encoder("state.leg_outer_rad", rate="state.leg_outer_rad_s")],
    [Voltage("state.outer_A", V_per_unit=0.1)],
    [Word("state.leg_outer_rad", per_unit=1000.0)],
)


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    path = tmp_path_factory.mktemp("fmu") / "body.fmu"
    assert cli.main(["fmu", str(path), "--seed", "3"]) == 0
    return path


def sampled(body):
    row = [0.0] * len(body.sample_names)
    body.fill_sample(row)
    return row


def test_the_projects_own_unit_moves_as_its_body_without_fmi_bit_for_bit(unit):
    body = FmuBody(unit, WIRES, start=START)
    alone = ExportedBody(given_of(Scenario(seed=3)))
    for name, value in START.items():
        alone.set(name, value)
    alone.set("outer_ankle.match_2", 60)
    body.bridges[0].duty = 0.1
    for _ in range(300):
        body.step()
        assert alone.advance(4)
    shown = dict(zip(body.sample_names, sampled(body), strict=True))
    assert shown["state_outer_A"] == alone.get("state.outer_A") != 0.0
    assert body.encoder_rad(0) == alone.get("state.leg_outer_rad")
    assert body.analog_end[0] == pytest.approx(1.65 + 0.1 * shown["state_outer_A"])
    assert body.encoders[0].total > 0


def test_the_same_steps_give_the_same_samples(unit):
    first, second = FmuBody(unit, WIRES, start=START), FmuBody(unit, WIRES, start=START)
    for _ in range(50):
        first.step()
        second.step()
    assert sampled(first) == sampled(second)


def test_a_unit_that_refuses_a_step_ends_with_its_reason(unit):
    body = FmuBody(unit, WIRES, step_ns=100_000)
    body.step()
    assert body.fell and body.fall_cause.startswith("the unit ended: fmi3DoStep failed")


def test_a_robot_that_falls_ends_the_body(unit):
    body = FmuBody(unit, WIRES, start=START)
    while not body.fell and body.time_ns < 3_000_000_000:
        body.step()
    assert body.fell and body.fall_cause == "the unit asked for the end"


@pytest.mark.parametrize(
    ("mapping", "line"),
    [
        (Mapping([Input("outer_ankle.match_3")]), "unknown input 'outer_ankle.match_3'; did you mean"),
        (Mapping([Drive("motor")]), r"Drive\(.*\) is not an Input"),
        (Mapping([], [Encoder("state.leg_outer_rad")]), "encoder state.leg_outer_rad: name its derivative"),
        (Mapping([], [], [Voltage("no_such_thing")]), "unknown output 'no_such_thing'"),
        (Mapping([], [], [], [Word("state.outer_A", component=1)]), "state.outer_A component 1: it has 1"),
    ],
)
def test_a_variable_that_does_not_fit_is_refused_with_the_file(unit, mapping, line):
    with pytest.raises(ModelError, match=f"body.fmu: {line}") as refused:
        FmuBody(unit, mapping)
    assert len(str(refused.value).splitlines()) == 1


def test_an_unknown_start_value_and_a_file_that_is_not_a_unit_are_refused(unit, tmp_path):
    with pytest.raises(ModelError, match=r"body.fmu: unknown variable 'held.nov'"):
        FmuBody(unit, WIRES, start={"held.nov": 1.0})
    (tmp_path / "text.fmu").write_text("text")
    with pytest.raises(ModelError, match=r"text.fmu: FMPy cannot read it: "):
        FmuBody(tmp_path / "text.fmu", Mapping())
