"""`ranger-sim new DIR --plant mujoco robot.xml`: boards for the actuators of a user's own robot model."""

import pathlib
import re
import subprocess
import sys

import pytest

from ranger_sim.datatable import generate
from ranger_sim.datatable.loader import load_table
from ranger_sim.tools import cli
from tests.firmware_sim.native.support import COMPILER
from tests.ranger.testing.project import environment, how_to_find_the_plugin

pytest.importorskip("mujoco")
from ranger_sim.tools.new import from_mujoco  # noqa: E402

ROBOTS = pathlib.Path(__file__).parents[2] / "examples" / "robots"
BARE = """<mujoco><worldbody>
<body name="cart"><joint name="rail" type="slide" axis="1 0 0"/><geom type="box" size="0.1 0.1 0.1" mass="1"/>
<body name="pole"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.02" mass="0.1"/></body>
</body>
</worldbody><actuator><motor joint="rail" gear="-10" ctrlrange="-1 1"/></actuator></mujoco>"""
URDF = """<robot name="swing"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 -0.2"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""


def written(folder, model, *options):
    assert cli.main(["new", str(folder), "--plant", "mujoco", str(model), *options]) == 0
    return folder


def run_tests_of(project):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *how_to_find_the_plugin(), "."]
    path = {"PYTHONPATH": str(pathlib.Path(__file__).resolve().parents[2])}
    return subprocess.run(command, cwd=project, env=environment() | path, capture_output=True, text=True, check=False)


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
@pytest.mark.parametrize(("robot", "passed"), [("pendulum", 5), ("arm", 7), ("quadruped", 12)])
def test_its_tests_pass_at_once(tmp_path, robot, passed):
    project = written(tmp_path / robot, ROBOTS / f"{robot}.xml")
    assert not [path for path in project.rglob("*") if path.is_file() and "[%" in path.read_text()]
    assert generate.stale(load_table(project / "table"), project / "table" / "generated") == []
    done = run_tests_of(project)
    assert done.returncode == 0 and f"{passed} passed" in done.stdout, done.stdout


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_its_boards_exchange_can_fd_frames_where_that_is_wanted(tmp_path):
    project = written(tmp_path / "arm", ROBOTS / "arm.xml", "--fd")
    assert not [path for path in project.rglob("*") if path.is_file() and "[%" in path.read_text()]
    assert "data_bit_rate = 5_000_000" in (project / "table" / "boards.toml").read_text()
    (project / "test_fd.py").write_text(
        "def test_every_frame_is_of_can_fd_at_both_rates(machine):\n"
        "    wire = machine.wire()\n"
        "    machine.run_for(0.1)\n"
        "    assert {frame.flags for frame in wire.frames()} == {256 | 512 | 8}\n"  # FD, BRS, eight bytes
        "    assert machine.buses[0].load.data_share() > 0.3\n"
    )
    done = run_tests_of(project)
    assert done.returncode == 0 and "8 passed" in done.stdout, done.stdout


def test_a_can_fd_bus_carries_more_joints_at_the_shortest_period():
    def joints(fd):
        return max(count for count in range(1, 30) if from_mujoco.schedule(count, fd)[0] == 4)

    assert joints(False) == 4 and joints(True) >= 7
    period_ms, _, load = from_mujoco.schedule(4, True)
    assert period_ms == 4 and load < from_mujoco.schedule(4)[2] / 2


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
@pytest.mark.parametrize(("text", "name"), [(BARE, "cart.xml"), (URDF, "swing.urdf")])
def test_a_model_without_names_or_actuators_or_with_a_negative_gear_passes_too(tmp_path, text, name):
    (tmp_path / name).write_text(text)
    done = run_tests_of(written(tmp_path / "project", tmp_path / name))
    assert done.returncode == 0 and "5 passed" in done.stdout, done.stdout


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_a_function_that_costs_too_much_fails_the_tests_of_the_project(tmp_path):
    project = written(tmp_path / "slow", ROBOTS / "pendulum.xml")
    source = project / "joint.h"
    source.write_text(re.sub(r'("current_loop", +)1100', r"\g<1>1600", source.read_text()))
    done = run_tests_of(project)
    assert done.returncode == 1 and "current_loop cost 1,600 cycles" in done.stdout, done.stdout


def test_every_actuator_has_a_board_and_gains_by_the_models_own_law_or_the_inertia():
    robot = from_mujoco.read(ROBOTS / "arm.xml")
    assert [(each.board, each.actuator, each.joint) for each in robot.joints] == [
        ("TURN", "turn_motor", "turn"),
        ("SHOULDER", "shoulder_motor", "shoulder"),
        ("ELBOW", "elbow_motor", "elbow"),
    ]
    turn, _, elbow = robot.joints
    assert turn.per_A == pytest.approx(0.3 * 50 / 10) and turn.most == 0.3
    assert turn.stiffness * turn.per_A == pytest.approx(400.0 * turn.inertia)
    assert elbow.per_A == 1.5 and elbow.stiffness * elbow.per_A == pytest.approx(60.0)
    assert elbow.damping * elbow.per_A == pytest.approx(4.0)


def one_joint(folder, mass, joint="", motor=100.0):
    """A point mass at the end of a level rod of half a metre, with a motor of so many N m; its only joint."""
    file = folder / "rod.xml"
    file.write_text(
        f"""<mujoco><worldbody><body name="rod"><joint name="hinge" axis="0 1 0" {joint}/>
        <inertial mass="{mass}" pos="0.5 0 0" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody>
        <actuator><motor name="motor" joint="hinge" ctrlrange="-{motor} {motor}"/></actuator></mujoco>"""
    )
    [found] = from_mujoco.read(file).joints
    return found


@pytest.mark.parametrize(
    ("mass", "joint", "stiffness", "source"),
    [
        # m g r = 4.905 N m may bend it by 0.02 rad; its inertia of 0.25 kg m2 at 20 rad/s needs 100 N m/rad
        (1.0, "", 245.25, "weight"),
        (0.1, 'damping="3"', 120.0, "viscous"),  # 40 rad/s; the weight needs 24.5, the inertia 10
        (0.1, 'stiffness="7"', 24.525 + 35.0, "weight"),  # five springs of its own in addition
    ],
)
def test_a_joint_without_a_law_is_as_stiff_as_what_it_carries_needs(tmp_path, mass, joint, stiffness, source):
    found = one_joint(tmp_path, mass, joint)
    assert found.stiffness * found.per_A == pytest.approx(stiffness, rel=1e-6) and source in found.source
    critical = 2.0 * (stiffness * 0.25 * mass) ** 0.5
    assert found.damping * found.per_A == pytest.approx(0.8 * critical, rel=1e-6)
    assert found.integral * found.per_A == pytest.approx(4.0 * stiffness, rel=1e-6)
    assert found.reach == pytest.approx(0.2)  # 100 N m are plenty


@pytest.mark.parametrize(("motor", "reach"), [(12.0, 0.2), (9.0, 0.092440), (7.2, 0.0089458), (7.0, 0.004)])
def test_a_joint_moves_as_far_as_its_force_allows(tmp_path, motor, reach):
    """Two sines, 0.35 of the reach at 0.5 Hz and 0.15 at 3.1 Hz: at most 60.363 / s^2 of the reach, so 15.091 N m for
    1 rad; 0.7 of the motor's torque is for that, less the weight's 4.905 N m, but 0.004 rad it always moves."""
    assert one_joint(tmp_path, 1.0, motor=motor).reach == pytest.approx(reach, rel=1e-3)


def test_an_included_file_and_an_asset_come_along(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "tetra.obj").write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    )
    (tmp_path / "drive.xml").write_text(
        '<mujoco><actuator><motor name="m" joint="j" ctrlrange="-1 1"/></actuator></mujoco>'
    )
    (tmp_path / "robot.xml").write_text(
        '<mujoco><compiler meshdir="parts"/><asset><mesh name="tetra" file="tetra.obj"/></asset><worldbody>'
        '<body><joint name="j"/><geom type="mesh" mesh="tetra"/></body></worldbody><include file="drive.xml"/></mujoco>'
    )
    project = written(tmp_path / "project", tmp_path / "robot.xml")
    assert (project / "assets" / "0_tetra.obj").is_file() and not (project / "drive.xml").exists()
    copied = from_mujoco.read(project / "robot.xml")
    assert [each.actuator for each in copied.joints] == ["m"]


def test_actuators_that_do_not_act_on_a_joint_are_left_out_by_name(tmp_path, capsys):
    text = BARE.replace("</actuator>", '<motor name="pull" site="tip" ctrlrange="-1 1"/></actuator>')
    (tmp_path / "cart.xml").write_text(text.replace('<geom type="capsule"', '<site name="tip"/><geom type="capsule"'))
    written(tmp_path / "project", tmp_path / "cart.xml")
    assert "left out: actuator pull: acts on a site, not on a joint" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        (["mujoco", "none.xml"], r"none.xml: MuJoCo cannot read it: "),
        (["mojuco", "arm.xml"], r"new --plant mojuco: allowed are mujoco and fmu"),
        (["mujoco", "still.xml"], r"still.xml: no actuator at a hinge or slide joint, and no such joint to drive"),
        (["mujoco", "many.xml"], r"many.xml: 30 actuators, at most 29 boards fit on one bus"),
    ],
)
def test_what_cannot_be_a_project_is_refused_in_a_line_and_nothing_is_left(tmp_path, capsys, monkeypatch, asked, line):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "still.xml").write_text("<mujoco><worldbody/></mujoco>")
    bodies = "".join(f'<body><joint name="j{n}"/><geom size="0.1" mass="1"/></body>' for n in range(30))
    (tmp_path / "many.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    assert cli.main(["new", "project", "--plant", *asked]) == 2
    printed = capsys.readouterr().err
    assert re.search(line, printed) and len(printed.splitlines()) == 1
    assert not (tmp_path / "project").exists()
    assert cli.main(["new", "project", "--plant", "mujoco", "many.xml", "--from", "x.dbc"]) == 2
    assert "--plant and --from exclude each other" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "board"),
    [
        ("front_left_knee_motor", "FL_KNEE"), ("hip", "HIP"), ("3", "J3"), ("main", "MAIN2"),
        ("a_very_longish_actuator", "AV_LONGI"), ("", "J"),
    ],
)  # fmt: skip
def test_a_boards_name_has_eight_letters_at_most(name, board):
    assert from_mujoco.board_name(name, set(from_mujoco.WORDS)) == board
