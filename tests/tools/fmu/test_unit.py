"""The unit itself, by FMPy: what it declares, and the same trajectory as inside, bit for bit, through FMI."""

import pathlib
import subprocess
import sys
import zipfile

import numpy
import pytest

from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools import cli
from tests.tools.fmu.recording import recorded

pytest.importorskip("pythonfmu3")
fmpy = pytest.importorskip("fmpy")
DRIVE = pathlib.Path(__file__).with_name("drive.py")


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    path = tmp_path_factory.mktemp("fmu") / "body.fmu"
    assert cli.main(["fmu", str(path), "--seed", "3", "--floor-roughness", "1mm"]) == 0
    return path


def driven(unit, folder, inputs, outputs, at_once=1):
    names = list(inputs[0])
    rows = numpy.array([[row[name] for name in names] for row in inputs], dtype=float)
    numpy.savez(folder / "inputs.npz", names=names, outputs=outputs, rows=rows)
    done = subprocess.run(
        [sys.executable, DRIVE, unit, folder / "inputs.npz", folder / "outputs.npz", str(at_once)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    with numpy.load(folder / "outputs.npz") as file:
        return file["rows"]


def test_fmpy_finds_nothing_wrong_with_the_unit(unit):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(unit)) == []


def test_the_description_has_units_causality_variability_start_values_and_limits(unit):
    described = fmpy.read_model_description(str(unit))
    assert described.fmiVersion == "3.0" and described.modelExchange is None
    assert described.coSimulation.canHandleVariableCommunicationStepSize
    with zipfile.ZipFile(unit) as archive:
        assert b'canGetAndSetFMUState="false"' in archive.read("modelDescription.xml")
    assert described.defaultExperiment.stepSize == "0.00025"
    by_name = {each.name: each for each in described.modelVariables}
    mass = by_name["body.total_mass_kg"]
    assert (mass.causality, mass.variability, mass.start, mass.unit) == ("parameter", "fixed", "9.91", "kg")
    assert (float(mass.min), float(mass.max)) == (0.1, 1000.0) and "weighed" in mass.description
    lead = by_name["hip.match_2"]
    assert (lead.causality, lead.variability, lead.type, lead.start) == ("input", "discrete", "Int64", "0")
    assert (by_name["seed"].start, by_name["floor.roughness_m"].start) == ("3", "0.001")
    angle = by_name["state.hip_rad"]
    assert (angle.causality, angle.variability, angle.unit) == ("output", "continuous", "rad")
    units = {each.name: each.baseUnit for each in described.unitDefinitions}
    friction = units["N m s/rad"]
    assert (friction.kg, friction.m, friction.s, friction.rad) == (1, 2, -1, -1)
    assert all(each.description for each in described.modelVariables)
    assert {each.unit for each in described.modelVariables if each.unit} <= set(units)
    assert [each.name for each in described.modelVariables if each.causality == "independent"] == ["time"]


def test_driven_with_the_inputs_of_a_walk_it_shows_the_walk_bit_for_bit(unit, tmp_path):
    inputs, expected, steps = recorded(Scenario(seed=3, floor_roughness_m=0.001), 2.25)
    names = list(expected[0])
    found = driven(unit, tmp_path, inputs, names)
    wanted = numpy.array([[row[name] for name in names] for row in expected], dtype=float)
    assert steps >= 1 and found.shape == wanted.shape == (9000, 68)
    assert found.tobytes() == wanted.tobytes()


def test_coarser_steps_see_the_same_body_when_the_inputs_are_constant(unit, tmp_path):
    held = {"held.now": True, "hip.match_2": 200, "hip.watchdog": True}
    free = {"held.now": False, "hip.match_2": 0, "hip.watchdog": True}
    inputs = [held] * 400 + [free] * 400
    names = ["state.hip_rad", "state.hip_A", "sensor.hip_joint_edges", "time"]
    fine, coarse = (driven(unit, tmp_path, inputs, names, at_once) for at_once in (1, 8))
    assert numpy.array_equal(fine[7::8], coarse)
    assert coarse[49, 1] > 1.0 and coarse[-1, 0] != coarse[50, 0] and coarse[-1, 3] == 800 * 0.00025


def test_a_step_that_is_not_a_multiple_is_refused_with_its_reason(unit):
    program = "import sys, fmpy\nfmpy.simulate_fmu(sys.argv[1], stop_time=0.01, step_size=1e-4, output_interval=1e-4)\n"
    done = subprocess.run([sys.executable, "-c", program, unit], capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    assert done.returncode != 0 and "a communication step of 100 us: the body moves in steps of 250 us" in said


def called(unit, program):
    """A program that has the unit as `fmu`, instantiated, and its `variables` by name."""
    begin = (
        "import sys, fmpy\nfrom fmpy.fmi3 import FMU3Slave\n"
        "md = fmpy.read_model_description(sys.argv[1])\nvariables = {each.name: each for each in md.modelVariables}\n"
        "fmu = FMU3Slave(guid=md.guid, unzipDirectory=fmpy.extract(sys.argv[1]), modelIdentifier='RangerBody', "
        "instanceName='one')\nfmu.instantiate()\n"
    )
    return subprocess.run(
        [sys.executable, "-c", begin + program, unit], capture_output=True, text=True, check=False, timeout=120
    )


def test_a_number_beyond_its_limits_is_reported_and_the_importer_goes_on(unit):
    done = called(
        unit,
        "try:\n    fmu.setFloat64([variables['body.total_mass_kg'].valueReference], [0.0])\n"
        "except Exception:\n    print('refused')\n",
    )
    assert done.returncode == 0 and "refused" in done.stdout
    assert "body.total_mass_kg is 0.0, allowed are 0.1 to 1000 kg" in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("file", "before", "after", "reported"),
    [
        ("resources/given.json", b'"made_by": "', b'"made_by": "x', "other variables than those of ranger-sim"),
        ("resources/given.json", b"{", b"[", "Expecting"),
        (
            "resources/ranger_body.py",
            b"from ranger_sim.tools.fmu.interface import connect",
            b"import no_ranger_sim",
            "this unit needs ranger-sim installed for the Python in",
        ),
    ],
)
def test_a_unit_that_cannot_be_used_gives_the_reason_and_the_importer_goes_on(
    unit, tmp_path, file, before, after, reported
):
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(unit) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            target.writestr(name, data.replace(before, after, 1) if name == file else data)
    for call in ("fmu.setFloat64([1], [1.0])", "fmu.enterInitializationMode(startTime=0.0)"):
        # after a status `fatal` FMI allows no further call
        done = called(broken, f"try:\n    {call}\nexcept Exception as error:\n    print('refused', error)\n")
        assert done.returncode == 0 and "refused" in done.stdout and "fatal" in done.stdout, done.stderr
        assert (done.stdout + done.stderr).count(reported) == 1


def test_the_same_body_gives_the_same_bytes_and_no_more_than_it_needs(unit, tmp_path):
    again = tmp_path / "again.fmu"
    assert cli.main(["fmu", str(again), "--seed", "3", "--floor-roughness", "1mm"]) == 0
    assert again.read_bytes() == unit.read_bytes()
    with zipfile.ZipFile(unit) as archive:
        names = archive.namelist()
    assert [name for name in names if name.startswith("binaries/")] == ["binaries/x86_64-linux/RangerBody.so"]
    assert {name.split("/")[0] for name in names} == {"binaries", "documentation", "modelDescription.xml", "resources"}
