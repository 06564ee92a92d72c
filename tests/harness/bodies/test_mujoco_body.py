"""A MuJoCo model as the body: its numbers, sensors, names, and the state in a forked branch."""

import math
import pathlib

import pytest

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.harness.bodies.mapping import Drive, Encoder, Input, Mapping, Voltage, Word
from ranger_sim.harness.branching import branch

mujoco = pytest.importorskip("mujoco")
from ranger_sim.harness.bodies.mujoco_body import MujocoBody  # noqa: E402

ROBOTS = pathlib.Path(__file__).parents[3] / "examples" / "robots"
PENDULUM = ROBOTS / "pendulum.xml"
URDF = """<robot name="swing"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 -0.2"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="5" velocity="3"/></joint></robot>"""
ON_A_FLOOR = """<mujoco><option timestep="0.0002"/><worldbody><geom type="plane" size="1 1 1"/>
<body name="trunk" pos="0 0 0.1"><freejoint name="root"/><geom type="box" size="0.1 0.1 0.1" mass="2"/>
<site name="centre" type="box" size="0.11 0.11 0.11"/></body></worldbody>
<sensor><accelerometer name="acceleration" site="centre"/><gyro name="rate" site="centre"/>
<touch name="contact" site="centre"/></sensor></mujoco>"""


def pendulum(seed=0, step_ns=500_000, locked=(), **drive):
    wires = Mapping([Drive("motor", **drive)], [Encoder("hinge")], [Voltage("motor", V_per_unit=0.1, noise_V=0.01)])
    return MujocoBody(PENDULUM, wires, seed, step_ns, locked)


def passed(body, steps, duty=0.05):
    body.bridges[0].duty = duty
    for _ in range(steps):
        body.step()
    return [*body.shown[0], body.analog_end[0], body.encoders[0].total]


def test_a_driven_pendulum_is_bit_for_bit_that_of_bare_mujoco_with_the_same_forces():
    body = pendulum(inductance_H=1e-30)  # the current follows at once
    model = mujoco.MjModel.from_xml_path(str(PENDULUM))
    model.opt.timestep = 500e-6
    data = mujoco.MjData(model)
    data.ctrl[0] = 4.0 / 10.0 * (0.05 * 24.0 / 1.2)  # 1 A
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert passed(body, 1000)[:2] == [data.qpos[0], data.qvel[0]]


def test_the_current_rises_with_the_windings_time_constant_and_the_force_ends_at_its_limit():
    body = pendulum(locked=("hinge",))
    passed(body, 1, duty=0.05)
    assert body.readings()[0] == pytest.approx(1.0 - math.exp(-1.0))  # a step is L / R
    passed(body, 20, duty=1.0)
    assert body.readings()[0] == pytest.approx(20.0)
    assert body.data.actuator_force[0] == 4.0


def test_a_lag_of_the_drive_delays_its_force_and_not_its_current():
    body = pendulum(locked=("hinge",), lag_s=0.02, inductance_H=1e-30)
    passed(body, 40, duty=0.05)
    assert body.readings()[0] == pytest.approx(1.0)
    # the mean of 1 - exp(-t / lag) from 19.5 to 20 ms
    missing = math.exp(-19.5 / 20.0) * (20.0 / 0.5) * (1.0 - math.exp(-0.5 / 20.0))
    assert body.data.actuator_force[0] == pytest.approx(0.4 * (1.0 - missing))


def test_the_encoders_edges_count_the_joints_angle():
    body = pendulum()
    angle, _, _, edges = passed(body, 300)
    assert edges == math.floor(angle * 1000 / math.pi)


def test_same_seed_same_bytes_and_another_seed_another_noise():
    assert passed(pendulum(3), 200) == passed(pendulum(3), 200)
    assert passed(pendulum(3), 200)[2] != passed(pendulum(4), 200)[2]


def test_a_forked_branch_goes_on_from_the_same_state_and_leaves_ours_alone():
    body = pendulum(3)
    passed(body, 100)
    there = branch(lambda: {"found": passed(body, 100)}, 30.0, 60.0)["found"]
    assert passed(body, 100) == there


def test_a_step_has_as_many_of_mujocos_timesteps_as_the_model_needs():
    body = pendulum(step_ns=5_000_000)
    assert (len(body.inner), body.model.opt.timestep) == (3, pytest.approx(5e-3 / 3))  # the model's is 2 ms
    body.step()
    assert body.data.time == pytest.approx(5e-3) and body.time_ns == 5_000_000


def test_an_inertial_unit_and_a_contact_show_a_box_at_rest_on_the_floor(tmp_path):
    (tmp_path / "box.xml").write_text(ON_A_FLOOR)
    words = [Word("acceleration", axis, per_unit=100) for axis in range(3)]
    words += [Word("rate", axis, per_unit=1000) for axis in range(3)] + [Word("contact", per_unit=1e6)]
    body = MujocoBody(tmp_path / "box.xml", Mapping(voltages=[Voltage("contact", V_per_unit=0.1)], words=words))
    for _ in range(2000):
        body.step()
    signed = [word - (1 << 16) if word >> 15 else word for word in body.words]
    assert signed == [0, 0, 981, 0, 0, 0, 0x7FFF]  # 9.81 m/s^2 upwards; the last word is saturated
    assert body.analog_end[0] == pytest.approx(1.65 + 0.1 * 2 * 9.81, abs=0.01) or body.analog_end[0] == 3.3
    row = [0.0] * len(body.sample_names)
    body.fill_sample(row)
    shown = dict(zip(body.sample_names, row, strict=True))
    assert shown["acceleration_2"] == pytest.approx(9.81, abs=0.01) and body.sample_names["rate_0"] == "rad/s"
    assert shown["contact"] == pytest.approx(2 * 9.81, rel=0.01) and body.sample_names["contact"] == "N"


def test_a_urdf_gets_a_motor_at_a_joint_with_the_effort_as_its_limit(tmp_path):
    (tmp_path / "swing.urdf").write_text(URDF)
    body = MujocoBody(tmp_path / "swing.urdf", Mapping([Drive("swing")], [Encoder("swing")]))
    assert body.windings[0].most == 5.0
    body.bridges[0].duty = 0.05  # 1 A of 10 A
    for _ in range(4000):
        body.step()
    assert abs(body.data.qfrc_actuator[0]) == pytest.approx(0.5)
    assert list(body.sample_names) == ["swing_rad", "swing_rad_per_s", "swing_A"]


def test_a_position_actuator_becomes_a_motor_of_its_force_range():
    wires = Mapping([Drive("elbow_motor")], [Encoder("elbow")])
    body = MujocoBody(ROBOTS / "arm.xml", wires, locked=("elbow",))
    body.bridges[0].duty = 0.05
    for _ in range(20):
        body.step()
    assert body.data.qfrc_actuator[2] == pytest.approx(1.5)  # 1 A of 10 A is a tenth of 15 N m


def test_a_robot_on_a_stand_keeps_its_trunk_and_its_locked_joints():
    wires = Mapping([Drive("front_left_hip")], [Encoder("front_left_hip"), Encoder("rear_left_knee")])
    body = MujocoBody(ROBOTS / "quadruped.xml", wires, locked=("root", "rear_left_knee"))
    body.bridges[0].duty = 0.02
    for _ in range(1000):
        body.step()
    assert abs(body.shown[0][0]) > 0.1 and abs(body.shown[1][0]) < 1e-3
    assert body.data.qpos[2] == pytest.approx(0.42, abs=1e-3)


@pytest.mark.parametrize(
    ("mapping", "line"),
    [
        (Mapping([Drive("moter")]), r"pendulum.xml: unknown actuator, or joint without one, 'moter' .available: motor"),
        (Mapping([Drive("hinge")]), r"unknown actuator, or joint without one, 'hinge' \(available: motor\)"),
        (Mapping([Input("motor")]), r"pendulum.xml: Input\(.*\) is not a Drive"),
        (Mapping([], [Encoder("knee")]), r"unknown hinge or slide joint 'knee' \(available: hinge\)"),
        (Mapping([], [], [Voltage("gyro")]), r"unknown drive or sensor 'gyro' \(available: none\)"),
        (Mapping([Drive("motor")], [], [Voltage("motor", 1)]), "motor component 1: it has 1, counted from 0"),
        (Mapping([Drive("motor", most_A=0.0)]), "drive motor: most_A is 0, and must be above 0"),
        (Mapping([Drive("motor", most_force=-1.0)]), "drive motor: most_force is -1, and must be above 0"),
        (Mapping([], [Encoder("hinge", lines=0)]), "encoder hinge: 0 lines, gear 1.0 are impossible"),
        (Mapping([Drive("motor")], [], [], [Word("motor", bits=64)]), "word motor: 64 bits; allowed are 2 to 32"),
    ],
)
def test_a_name_or_number_that_does_not_fit_is_refused_with_the_file_and_what_there_is(mapping, line):
    with pytest.raises(ModelError, match=line) as refused:
        MujocoBody(PENDULUM, mapping)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "line"),
    [("<mujoco><nonsense/></mujoco>", "cannot read it: .*nonsense"), (None, "cannot read it: .*model.xml")],
)
def test_a_file_that_mujoco_refuses_is_named_in_one_line(tmp_path, text, line):
    if text:
        (tmp_path / "model.xml").write_text(text)
    with pytest.raises(ModelError, match=f"model.xml: MuJoCo {line}") as refused:
        MujocoBody(tmp_path / "model.xml", Mapping())
    assert len(str(refused.value).splitlines()) == 1


def test_an_actuator_without_a_limit_needs_one(tmp_path):
    (tmp_path / "free.xml").write_text(PENDULUM.read_text().replace(' ctrlrange="-4 4"', ""))
    with pytest.raises(ModelError, match=r"actuator motor has no limit of its force; give Drive\(most_force="):
        MujocoBody(tmp_path / "free.xml", Mapping([Drive("motor")]))
    assert MujocoBody(tmp_path / "free.xml", Mapping([Drive("motor", most_force=2.0)])).windings[0].most == 2.0


def test_a_simulation_that_becomes_unstable_ends(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its own log there
    body = pendulum(most_force=1e300)
    for _ in range(2000):
        body.bridges[0].duty = 1.0
        body.step()
        if body.fell:
            break
    assert body.fell and body.fall_cause == "MuJoCo's simulation became unstable"


def test_a_joints_sensor_has_the_unit_of_its_joint(tmp_path):
    (tmp_path / "two.xml").write_text("""<mujoco><worldbody>
      <body><joint name="turn" type="hinge"/><geom size="0.1"/></body>
      <body pos="1 0 0"><joint name="way" type="slide"/><geom size="0.1"/></body></worldbody>
      <sensor><jointpos name="a" joint="turn"/><jointpos name="b" joint="way"/><jointvel name="c" joint="way"/></sensor>
    </mujoco>""")
    units = MujocoBody(tmp_path / "two.xml", Mapping()).sample_names
    assert (units["a"], units["b"], units["c"]) == ("rad", "m", "m/s")
