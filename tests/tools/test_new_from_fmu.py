"""`ranger-sim new DIR --plant fmu unit.fmu`: boards for the inputs and outputs of a unit."""

import pytest

from ranger_sim.datatable import generate
from ranger_sim.datatable.loader import load_table
from ranger_sim.harness.firmware.native_firmware import build
from ranger_sim.tools import cli
from ranger_sim.tools.new import command, from_fmu
from ranger_sim.tools.new.from_fmu import Actuated, Measured, Unit
from tests.firmware_sim.native.support import COMPILER

# Inputs and outputs as units have them: names with points and brackets, limits on one side of 0, more than four outputs
VALVE = Actuated("VALVE", "valve.opening[1]", "1", 0.2, 0.0, 1.0, 1.0)
PUMP = Actuated("PUMP", "pump speed", "rad/s", 0.0, -50.0, 50.0, 50.0)
OUTPUTS = [
    Measured(f"SENSE{1 + n // 4}", f"LEVEL_{n}", n % 4, f"tank[{n}].level", "m", 0.5 * n, 0.2 + n) for n in range(5)
]

SPRING = '''
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64


class Spring(Fmi3Slave):
    """A mass of 2 kg on a spring of 50 N/m with damping, pushed by a force."""

    def __init__(self, **given):
        super().__init__(**given)
        self.time = self.force = self.place = self.rate = 0.0
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        )
        self.register_variable(Float64("force", causality=Fmi3Causality.input, variability=Fmi3Variability.continuous))
        for name in ("place", "rate"):
            self.register_variable(
                Float64(name, causality=Fmi3Causality.output, variability=Fmi3Variability.continuous)
            )

    def do_step(self, current_time, step_size):
        self.rate += step_size * (self.force - 50.0 * self.place - 2.0 * self.rate) / 2.0
        self.place += step_size * self.rate
        return True
'''


def project_of(folder, unit):
    """A project's files without a unit's own run, and its generated table."""
    (folder / "unit.fmu").write_bytes(b"a unit")
    command.write_files(folder, from_fmu.files(unit, "tanks"))
    command.generate_table(folder)
    return folder


@pytest.fixture
def tanks(tmp_path):
    file = tmp_path / "unit.fmu"
    return Unit(file, (VALVE, PUMP), tuple(OUTPUTS), ("input mode: Enumeration, and a board has real numbers",))


def test_every_template_is_filled_and_the_table_is_in_order(tmp_path, tanks):
    project = project_of(tmp_path, tanks)
    texts = {path: path.read_text() for path in project.rglob("*") if path.is_file()}
    assert not [path for path, text in texts.items() if "[%" in text]
    table = load_table(project / "table")
    assert generate.stale(table, project / "table" / "generated") == []
    assert {each.name for each in table.boards} == {"MAIN", "VALVE", "PUMP", "SENSE1", "SENSE2"}
    assert "Left out: input mode: Enumeration" in texts[project / "README.md"]


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
@pytest.mark.parametrize("board", ["main", "valve", "pump", "sense1", "sense2"])
def test_the_program_of_every_board_compiles(tmp_path, tanks, board):
    assert build(project_of(tmp_path, tanks) / board).library.is_file()


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_the_main_board_of_a_unit_without_inputs_compiles_too(tmp_path, tanks):
    alone = Unit(tanks.file, (), tanks.outputs, ())
    assert build(project_of(tmp_path, alone) / "main").library.is_file()


def test_a_trajectory_stays_within_an_inputs_limits():
    assert VALVE.reach == 0.5  # from 0.2 up: the farther limit is 0.8 away, at most half of full duty
    assert PUMP.reach == 25.0
    assert Actuated("HEATER", "heat", "W", 9.0, 0.0, 10.0, 10.0).reach == -5.0


def test_a_sensor_shows_four_times_as_much_as_the_output_moved_by():
    assert OUTPUTS[0].V_per_unit == pytest.approx(3.3 / 4 / 0.2)


def test_a_missing_library_and_an_unknown_kind_are_refused_by_name(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(command.importlib.util, "find_spec", lambda name: None)
    assert cli.main(["new", str(tmp_path / "a"), "--plant", "fmu", "unit.fmu"]) == 2
    assert "pip install fmpy" in capsys.readouterr().err
    assert cli.main(["new", str(tmp_path / "a"), "--plant", "gazebo", "unit.sdf"]) == 2
    assert "allowed are mujoco and fmu" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_text_instead_of_a_unit_is_refused_with_the_files_name(tmp_path, capsys):
    pytest.importorskip("fmpy")
    (tmp_path / "text.fmu").write_text("no unit")
    assert cli.main(["new", str(tmp_path / "a"), "--plant", "fmu", str(tmp_path / "text.fmu")]) == 2
    assert "text.fmu: FMPy cannot read it" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_the_tests_of_a_units_project_pass_at_once(tmp_path):
    pytest.importorskip("fmpy")
    builder = pytest.importorskip("pythonfmu3").FmuBuilder
    pytest.importorskip("mujoco")  # of the module that has the next name
    from tests.tools.test_new_from_mujoco import run_tests_of

    (tmp_path / "spring.py").write_text(SPRING)
    unit = builder.build_FMU(str(tmp_path / "spring.py"), dest=str(tmp_path))
    project = tmp_path / "spring"
    assert cli.main(["new", str(project), "--plant", "fmu", str(unit)]) == 0
    done = run_tests_of(project)
    assert done.returncode == 0 and "5 passed" in done.stdout, done.stdout
