"""`ranger_sim.diagnose` and `ranger_sim.identify`: typed results, equal to what the commands write."""

import dataclasses
import json
import pathlib
import subprocess
import sys
import typing

import numpy as np
import pytest

import ranger_sim
from ranger_sim import sysid
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import results
from ranger_sim.sysid.reading import open_recording as read
from ranger_sim.tools.cli import main
from tests.sysid.test_diagnose import Cart, cart_file

DATA = pathlib.Path(__file__).parents[2].parent / "shared" / "data"
needs_data = pytest.mark.skipif(
    not (DATA / "sound_bench_train.csv").exists(), reason=f"no measured data in {DATA.name}/"
)


def typed(value, kind):
    """True where a value, with everything inside it, has the annotated type."""
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        return isinstance(value, kind) and all(typed(getattr(value, name), hints[name]) for name in hints)
    if origin is tuple and inner[-1] is ...:
        return isinstance(value, tuple) and all(typed(each, inner[0]) for each in value)
    if origin is tuple:
        return isinstance(value, tuple) and all(map(typed, value, inner)) and len(value) == len(inner)
    if origin is not None and isinstance(origin, type) and issubclass(origin, typing.Mapping):
        return isinstance(value, origin) and all(
            typed(name, inner[0]) and typed(each, inner[1]) for name, each in value.items()
        )
    if inner:  # a union
        return any(typed(value, each) for each in inner)
    return kind is typing.Any or isinstance(value, kind)


@pytest.fixture(scope="module")
def carts(tmp_path_factory):
    """Two recordings of a cart with a drag of 0.02 N s2/m2."""
    folder = tmp_path_factory.mktemp("carts")
    return [cart_file(folder / f"{seed}.csv", seed, drag=0.02) for seed in (1, 2)]


@pytest.fixture(scope="module")
def drag(carts):
    return ranger_sim.diagnose(carts[0], Cart(), holdout=carts[1:])


def test_a_drag_is_named_with_its_value_and_its_gain(drag):
    (cause,) = drag.causes
    assert (drag.detected, drag.abstained, drag.subsystem, cause.name, cause.at) == (
        True, False, "mechanical", "drag", "cart",
    )  # fmt: skip
    low, high = cause.parameters["quadratic"].ci95
    assert low < 0.02 < high and high - low < 0.01
    assert drag.gain.holdout == "2.csv" and drag.gain.fraction_of_achievable > 0.9
    assert 'cause = "drag"' in drag.extended_model


def test_a_result_has_the_types_that_it_declares_and_cannot_be_changed(drag):
    assert typed(drag, results.DiagnosisResult)
    assert not typed(dataclasses.replace(drag, causes=list(drag.causes)), results.DiagnosisResult)
    with pytest.raises(dataclasses.FrozenInstanceError):
        drag.detected = False


def test_to_dict_is_the_json_of_the_command(carts, drag, capsys):
    machine = "tests.sysid.test_diagnose:Cart"
    assert main(["diagnose", carts[0], "--holdout", carts[1], "--experiment", machine, "--json", "-"]) == 1
    assert json.loads(capsys.readouterr().out) == drag.to_dict()


def test_a_part_of_one_file_can_be_held_out_and_a_dataset_taken_for_a_file(carts):
    found = sysid.diagnose([read(carts[0])], Cart(), holdout_part=0.5)
    assert found.causes[0].name == "drag" and found.gain.holdout.startswith("1.csv from ")


@needs_data
def test_a_sound_motor_bench_of_another_simulation_raises_no_alarm():
    found = ranger_sim.diagnose(DATA / "sound_bench_train.csv", "motor-bench")
    assert (found.detected, found.causes, found.abstained, found.extended_model) == (False, (), False, "")
    assert typed(found, results.DiagnosisResult)
    low, high = found.evidence.parameters["resistance_ohm"].ci95
    assert 1.0 < low < high < 1.6  # 1.3 ohm, shifted by 5 to 15 %


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            {"files": "none.csv", "machine": "mars"},
            "unknown experiment 'mars' .available: motor-bench",
        ),
        ({"files": "none.csv", "machine": "walk", "gear": 3.0}, "--gear 3: only the motor bench has a gearbox"),
        ({"files": "none.csv", "machine": Cart(), "gear": 3.0}, "--gear 3: only the motor bench has a gearbox"),
        ({"files": "none.csv", "machine": object()}, "has no name, quantities, parameters, prepare, effects, generic"),
        ({"files": [], "machine": Cart()}, "files: none is given"),
        ({"files": "none.csv", "machine": Cart()}, "none.csv: there is no such file"),
        ({"files": "none.csv", "machine": Cart(), "holdout_part": 1.0}, "--holdout-part 1: allowed is"),
        ({"files": "a", "machine": Cart(), "holdout_part": 0.5, "holdout": ["b"]}, "--holdout-part 0.5: there are"),
        ({"files": "none.csv", "machine": Cart(), "accept_loss": 1.5}, "--accept-loss 1.5: allowed are 0 to 1"),
    ],
)
def test_a_mistake_raises_one_line(arguments, line):
    with pytest.raises(UserError, match=line) as caught:
        ranger_sim.diagnose(**arguments)
    assert "\n" not in str(caught.value)


def stall_file(path):
    """A held motor of 1.5 ohm whose contacts drop 0.6 V, read 10 mV too high and too low in turn."""
    current = np.concatenate([np.linspace(-4.0, -1.0, 12), np.linspace(1.0, 4.0, 12)])
    voltage = 1.5 * current + 0.6 * np.sign(current) + np.tile([0.01, -0.01], 12)
    rows = np.column_stack([np.arange(24.0), voltage, current])
    np.savetxt(path, rows, delimiter=",", header="t_s,voltage_V,current_A", comments="", fmt="%.9g")
    return path


def test_resistance_and_drop_of_a_held_motor_are_those_of_the_file(tmp_path, capsys):
    path = stall_file(tmp_path / "stall.csv")
    found = ranger_sim.identify("stall", path)
    (fit,) = found.fits
    assert fit.refused is None and typed(found, results.IdentificationResult)
    for name, value in (("R", 1.5), ("V_c", 0.6)):
        low, high = fit.parameters[name].ci95
        assert low < value < high and fit.parameters[name].value == pytest.approx(value, rel=0.01)
    assert (found.seed, found.truth, found.data) == (None, {}, str(path))
    assert main(["identify", "stall", "--data", str(path), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out) == found.to_dict()


def test_a_virtual_bench_has_its_truth_and_remarks_are_reported():
    lines = []
    found = sysid.identify("level", seed=3, report=lines.append)
    assert found.seed == 3 and found.data is None
    low, high = found.fits[0].parameters["outer_cm"].ci95
    assert low < found.truth["outer_cm"] < high
    assert any(line.startswith("level: ") for line in lines)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"bench": "moon"}, "bench 'moon'"),
        ({"bench": "stall", "gear": 0.0}, "--gear 0.0: it must be above 0"),
        ({"bench": "all", "known": {"R": (1.0, 0.1)}}, "--known belongs to a single bench"),
        ({"bench": "stall", "mapping": {"a": "b"}}, "--map names columns of a file"),
        ({"bench": "all", "data": "."}, "--data .: for all a folder is needed; stall.csv is not in it"),
        ({"bench": "stall", "data": "a.csv", "model": "m.toml"}, "--model is what a virtual bench has"),
    ],
)
def test_a_mistake_in_an_identification_raises_one_line(arguments, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=line):
        ranger_sim.identify(**arguments)


def test_an_import_of_the_package_loads_no_numpy():
    program = (
        "import sys, ranger_sim, ranger_sim.sysid\n"
        "print(sorted({'numpy', 'scipy', 'ranger_sim.sysid.api'} & set(sys.modules)), dir(ranger_sim.sysid))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("[] ") and "'diagnose', 'identify'" in done.stdout
