"""A MuJoCo model (MJCF or URDF) as the body of a machine.

    body = MujocoBody("arm.xml", Mapping(
        drives=[Drive("shoulder")],                           # bridge 0
        encoders=[Encoder("shoulder_joint", lines=1000)],     # encoder 0
        voltages=[Voltage("shoulder", V_per_unit=0.1)],       # its current, on analog input 0
        words=[Word("torso_gyro", axis, per_unit=1000) for axis in range(3)],
    ))

A driven actuator becomes a motor in the model, whatever law it had: the law is the firmware's.
"""

import contextlib
import math
import pathlib
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np

from ranger_sim.foundation.user_error import ModelError, unknown
from ranger_sim.harness.bodies.mapping import Drive, MappedBody, Mapping, component_of, substeps
from ranger_sim.harness.bodies.names import identifier

STEP_NS = 500_000  # a slot of fast motor boards
# of MuJoCo's sensors, by type (a slide joint's are m and m/s); others are numbers without a unit
UNITS = {
    "TOUCH": "N",
    "ACCELEROMETER": "m/s^2",
    "VELOCIMETER": "m/s",
    "GYRO": "rad/s",
    "FORCE": "N",
    "TORQUE": "N m",
    "MAGNETOMETER": "T",
    "RANGEFINDER": "m",
    "JOINTPOS": "rad",
    "JOINTVEL": "rad/s",
    "FRAMEPOS": "m",
    "FRAMELINVEL": "m/s",
    "FRAMEANGVEL": "rad/s",
}
UNSTABLE = [getattr(mujoco.mjtWarning, f"mjWARN_BAD{what}") for what in ("QPOS", "QVEL", "QACC", "CTRL")]
FREE = int(mujoco.mjtJoint.mjJNT_FREE)
TURNS = (HINGE, SLIDE) = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


class MujocoBody(MappedBody):
    """The model in the file, at its first keyframe if it has one; a joint beyond its range starts at the end of it.
    `step_ns`: of the boards' view.

    MuJoCo's timestep is the largest divisor of step_ns that is not above the model's. Its sensors show the state one
    such timestep ago, as after `mj_step`; joints and encoders show the present one. locked: names of joints that stay
    where they start, by MuJoCo's equality constraints; the robot is then on a stand and touches nothing.

    ModelError for a file that MuJoCo refuses, and for a name that the model does not have. `model` and `data` are
    MuJoCo's own. An unstable simulation ends in `fell`.
    """

    def __init__(
        self,
        file: str | pathlib.Path,
        mapping: Mapping,
        seed: int = 0,
        step_ns: int = STEP_NS,
        locked: Sequence[str] = (),
    ) -> None:
        self.file = str(file)
        spec = read(file)
        drives: list[Any] = list(mapping.drives)  # `motor` refuses other kinds
        driven = [motor(spec, self.file, each) for each in drives]
        for name in locked:
            lock(spec, self.file, name)
        if locked:
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        inner = substeps(step_ns, spec.option.timestep)
        spec.option.timestep = step_ns * 1e-9 / inner
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self.model = model = compiled(spec, self.file)
        self.data = data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        limits = model.jnt_limited.astype(bool) & np.isin(model.jnt_type, TURNS)
        places = model.jnt_qposadr[limits]
        data.qpos[places] = np.clip(data.qpos[places], *model.jnt_range[limits].T)
        for name in locked:
            lock_at_start(model, data, name)
        self.inner = range(inner)
        self.inner_s = model.opt.timestep
        self.actuators = [model.actuator(name).id for name in driven]
        self.windings = [
            Winding(drive, most_force(model, self.file, number, drive), self.inner_s)
            for drive, number in zip(drives, self.actuators, strict=True)
        ]
        self.joints = [self._joint(each.joint) for each in mapping.encoders]
        self.sources = [self._source(wire, mapping) for wire in (*mapping.voltages, *mapping.words)]
        every = [model.joint(number) for number in range(model.njnt)]
        self.sampled = [(each.qposadr[0], each.dofadr[0]) for each in every if int(each.type[0]) in TURNS]
        super().__init__(self.file, step_ns, mapping, samples(model, mapping), seed)
        mujoco.mj_forward(model, data)
        self.begin()

    def _joint(self, name: str) -> tuple[int, int]:
        """Places of a joint's position and velocity."""
        known = [self.model.joint(number) for number in range(self.model.njnt)]
        known = [each for each in known if int(each.type[0]) in TURNS]
        for each in known:
            if each.name == name:
                return each.qposadr[0], each.dofadr[0]
        raise ModelError(f"{self.file}: {unknown('hinge or slide joint', name, [each.name for each in known])}")

    def _source(self, wire: Any, mapping: Mapping) -> tuple[int, int]:
        """(-1, number of a drive) or (place in the sensors' data, 0)."""
        drives = [each.actuator for each in mapping.drives if isinstance(each, Drive)]
        if wire.source in drives:
            component_of(self.file, wire, 1)
            return -1, drives.index(wire.source)
        sensors = [self.model.sensor(number) for number in range(self.model.nsensor)]
        for each in sensors:
            if each.name == wire.source:
                return int(each.adr[0]) + component_of(self.file, wire, int(each.dim[0])), 0
        known = [*drives, *(each.name for each in sensors)]
        raise ModelError(f"{self.file}: {unknown('drive or sensor', wire.source, known)}")

    def advance(self) -> None:
        """Bridges, windings and MuJoCo, in MuJoCo's timesteps."""
        model, data = self.model, self.data
        ctrl, velocity = data.ctrl, data.actuator_velocity
        for _ in self.inner:
            for winding, bridge, number in zip(self.windings, self.bridges, self.actuators, strict=True):
                rate = velocity[number] if winding.emf_Vs else 0.0
                ctrl[number] = winding.force(bridge.duty, rate)
            mujoco.mj_step(model, data)
        if any(data.warning[kind].number for kind in UNSTABLE):
            self.fell = True
            self.fall_cause = "MuJoCo's simulation became unstable"

    def angles(self) -> list[tuple[float, float]]:
        qpos, qvel = self.data.qpos.tolist(), self.data.qvel.tolist()
        return [(qpos[place], qvel[rate]) for place, rate in self.joints]

    def readings(self) -> list[float]:
        sensed = self.data.sensordata.tolist()
        return [self.windings[drive].current_A if place < 0 else sensed[place] for place, drive in self.sources]

    def fill_sample(self, row) -> None:  # type: ignore[no-untyped-def]
        data = self.data
        qpos, qvel = data.qpos.tolist(), data.qvel.tolist()
        values = [value for place, rate in self.sampled for value in (qpos[place], qvel[rate])]
        values += [each.current_A for each in self.windings]
        values += data.sensordata.tolist()
        row[: len(values)] = values


class Winding:
    """The current of a drive, and the force of it; `force` passes one of MuJoCo's timesteps."""

    def __init__(self, drive: Drive, most: float, step_s: float) -> None:
        self.supply_V, self.resistance_ohm, self.emf_Vs = drive.supply_V, drive.resistance_ohm, drive.emf_Vs
        self.most = most
        self.per_A = most / drive.most_A
        self.decay = math.exp(-step_s * drive.resistance_ohm / drive.inductance_H)
        self.mean = (1.0 - self.decay) * drive.inductance_H / drive.resistance_ohm / step_s
        self.follow = 1.0 - math.exp(-step_s / drive.lag_s) if drive.lag_s > 0.0 else 1.0
        self.behind = self.follow * drive.lag_s / step_s  # share of the step's first lagging force in its mean
        self.current_A = self.lagging = 0.0

    def force(self, duty: float, rate: float) -> float:
        """The mean force over the step; the current is then the one at its end."""
        final_A = (duty * self.supply_V - self.emf_Vs * rate) / self.resistance_ohm
        off_A = self.current_A - final_A
        self.current_A = final_A + off_A * self.decay
        wanted = self.per_A * (final_A + off_A * self.mean)
        off = self.lagging - wanted
        self.lagging += self.follow * (wanted - self.lagging)
        return min(self.most, max(-self.most, wanted + off * self.behind))


def read(file: str | pathlib.Path) -> Any:
    """The model in an MJCF or URDF file, as MuJoCo's reader has it, not yet compiled.

    A joint without a name is `joint_0` by its number; an actuator without one has the name of what it acts on.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(file))
    except (ValueError, OSError) as error:
        raise ModelError(f"{file}: MuJoCo cannot read it: {one_line(error)}") from None
    for number, joint in enumerate(spec.joints):
        joint.name = joint.name or f"joint_{number}"
    taken = {each.name for each in spec.actuators}
    for number, actuator in enumerate(spec.actuators):
        if not actuator.name:
            actuator.name = actuator.target if actuator.target not in taken else f"actuator_{number}"
            taken.add(actuator.name)
    return spec


@contextlib.contextmanager
def without_advice() -> Iterator[None]:
    """Without the warnings with which MuJoCo advises a model's author."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def compiled(spec: Any, file: str) -> Any:
    """The model, ready to simulate."""
    try:
        with without_advice():
            return spec.compile()
    except ValueError as error:
        raise ModelError(f"{file}: MuJoCo cannot compile it: {one_line(error)}") from None


def one_line(error: Exception) -> str:
    """The text of an error of MuJoCo, in one line."""
    return " ".join(str(error).split()).removeprefix("Error: ")


def motor(spec: Any, file: str, drive: Any) -> str:
    """Make the drive's actuator a motor without limits of its control; returns the actuator's name."""
    if not isinstance(drive, Drive):
        raise ModelError(f"{file}: {drive!r} is not a Drive")
    for value, word in (
        (drive.most_A, "most_A"),
        (drive.resistance_ohm, "resistance_ohm"),
        (drive.inductance_H, "inductance_H"),
    ):
        if not value > 0.0:
            raise ModelError(f"{file}: drive {drive.actuator}: {word} is {value:g}, and must be above 0")
    name = drive.actuator
    acting = [each for each in spec.actuators if each.name == name]
    if acting:
        actuator = acting[0]
        if actuator.forcelimited == 0 or (actuator.forcelimited == 2 and not actuator.forcerange.any()):
            most = gain_limit(actuator)
            if most is not None and drive.most_force is None:
                actuator.forcerange = (-most, most)
                actuator.forcelimited = 1
    else:
        joints = [each.name for each in spec.joints if int(each.type) in TURNS]
        free = [each for each in joints if each not in {actuator.target for actuator in spec.actuators}]
        if name not in free:
            known = [*(each.name for each in spec.actuators), *free]
            raise ModelError(f"{file}: {unknown('actuator, or joint without one,', name, known)}")
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_motor()
    actuator.ctrllimited = 0
    actuator.dynprm = [0.0] * len(actuator.dynprm)
    return name


def gain_limit(actuator: Any) -> float | None:
    """The largest force by the range of the actuator's control; None where its law has no such limit."""
    pure = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED and actuator.biastype == mujoco.mjtBias.mjBIAS_NONE
    limited = actuator.ctrllimited == 1 or (actuator.ctrllimited == 2 and actuator.ctrlrange.any())
    if not (pure and limited):
        return None
    most = float(abs(actuator.gainprm[0]) * max(abs(actuator.ctrlrange)))
    return most if most > 0.0 else None


def most_force(model: Any, file: str, number: int, drive: Drive) -> float:
    """The largest force of a drive: as given, of its actuator, or of its joint."""
    if drive.most_force is not None:
        if not drive.most_force > 0.0:
            raise ModelError(f"{file}: drive {drive.actuator}: most_force is {drive.most_force:g}, and must be above 0")
        return drive.most_force
    if model.actuator_forcelimited[number]:
        return float(max(abs(model.actuator_forcerange[number])))
    joint = model.actuator_trnid[number][0]
    if model.actuator_trntype[number] == mujoco.mjtTrn.mjTRN_JOINT and model.jnt_actfrclimited[joint]:
        return float(max(abs(model.jnt_actfrcrange[joint])) / abs(model.actuator_gear[number][0]))
    raise ModelError(f"{file}: actuator {drive.actuator} has no limit of its force; give Drive(most_force=...)")


def lock(spec: Any, file: str, name: str) -> None:
    """Add the constraint that keeps a joint in its place; `lock_at_start` says where."""
    joint = spec.joint(name)
    if joint is None:
        raise ModelError(f"{file}: {unknown('joint', name, [each.name for each in spec.joints])}")
    kind, objects = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
    first, second = name, ""
    if int(joint.type) not in TURNS:
        kind, objects = mujoco.mjtEq.mjEQ_WELD, mujoco.mjtObj.mjOBJ_BODY
        first, second = joint.parent.name, "world"
        if not first:
            joint.parent.name = first = f"{name} body"
    equality = spec.add_equality(name=f"{name} locked", type=kind, objtype=objects, name1=first, name2=second)
    equality.solref = (2.0 * STEP_NS * 1e-9, 1.0)  # as stiff as MuJoCo's solver takes it at such steps
    equality.solimp = (0.999, 0.9999, 0.001, 0.5, 2.0)


def lock_at_start(model: Any, data: Any, name: str) -> None:
    """Keep a hinge or slide joint at its angle in `data`, any other one at the model's reference pose."""
    joint = model.joint(name)
    place = joint.qposadr[0]
    if int(joint.type[0]) in TURNS:
        model.equality(f"{name} locked").data[0] = data.qpos[place] - model.qpos0[place]
    else:
        size = 7 if int(joint.type[0]) == FREE else 4
        data.qpos[place : place + size] = model.qpos0[place : place + size]


def samples(model: Any, mapping: Mapping) -> dict[str, str]:
    """{name: unit} of joints, drives' currents and sensors."""
    found: dict[str, str] = {}

    def add(name: str, unit: str) -> None:
        while name in found:
            name += "_"
        found[name] = unit

    for number in range(model.njnt):
        joint = model.joint(number)
        if int(joint.type[0]) in TURNS:
            unit = "rad" if int(joint.type[0]) == HINGE else "m"
            name = identifier(joint.name or f"joint_{number}")
            add(f"{name}_{unit}", unit)
            add(f"{name}_{unit}_per_s", f"{unit}/s")
    for drive in mapping.drives:
        if isinstance(drive, Drive):
            add(f"{identifier(drive.actuator)}_A", "A")
    for number in range(model.nsensor):
        sensor = model.sensor(number)
        kind = mujoco.mjtSensor(int(sensor.type[0])).name.removeprefix("mjSENS_")
        name = identifier(sensor.name or f"sensor_{number}")
        unit = UNITS.get(kind, "1")
        if kind in ("JOINTPOS", "JOINTVEL") and model.jnt_type[sensor.objid[0]] == SLIDE:
            unit = unit.replace("rad", "m")
        for axis in range(int(sensor.dim[0])):
            add(name if sensor.dim[0] == 1 else f"{name}_{axis}", unit)
    return found
