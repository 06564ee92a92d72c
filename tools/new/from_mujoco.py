"""`ranger-sim new DIR --plant mujoco robot.xml`: a board for each actuator of a user's robot, and a main board.

The model stays the one description of the robot: its names are in the project's table of wires, and the gains of a
joint's board follow from the model's own law or from the inertia at the joint.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib
from collections.abc import Iterable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from ranger_sim.can_bus import bounds
from ranger_sim.foundation.events import FLAG_BRS, FLAG_FD
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.bodies import mujoco_body
from ranger_sim.harness.bodies.mapping import Drive, Encoder, Mapping
from ranger_sim.harness.bodies.mujoco_body import HINGE, TURNS, MujocoBody
from ranger_sim.harness.bodies.names import identifier
from ranger_sim.tools.new import drives
from ranger_sim.tools.new.from_dbc import filled, timing_register
from ranger_sim.tools.new.words import board_name, quoted, single

HERE = pathlib.Path(__file__).resolve().parent / "mujoco"
BIT_RATE = 1_000_000
DATA_BIT_RATE = 5_000_000  # with --fd; chosen by us: what drives of robots with CAN FD mostly have
FD_FLAGS = FLAG_FD | FLAG_BRS | 8  # of every frame there: the same eight bytes
SLOT_US = 500
PERIODS_MS = (4, 5, 10, 20, 40, 80)
MOST_LOAD = 0.5  # of the bus by cyclic messages; the rest is for errors, and for what a user adds
MOST_JOINTS = 29  # CAN transceivers drive 30 nodes at least (ISO 11898-2); one is the main board
MOST_A, V_PER_A = 10.0, 0.08  # chosen by us: the current sensor then shows 20 A, what full duty gives
LINES = 1000
GEAR = {"rad": 16.0, "m": 160.0}  # of the encoder: an edge is 0.2 mrad, or 0.02 mm
REACH = {"rad": 0.2, "m": 0.05}  # of the trajectory, and at most a third of the joint's range
LOOP_RAD_PER_S, LOOP_DAMPING = 20.0, 0.8  # of a joint without a law in the model, chosen by us
LAG_RAD_PER_S = 40.0  # stiffness over viscous friction, at least: the trajectory's 1.6 rad/s then lags by a twentieth
SAG = {"rad": 0.02, "m": 0.005}  # of a joint under its weight before the integral part holds it, at most
SPRING_SHARE = 5.0  # in addition, in stiffnesses of the spring that the model has at the joint
NO_LIMIT_SHARE = 1.0  # a position actuator without a limit gets the force of this error, rad or m
FREQUENCIES_HZ = (0.5, 3.1)
SHARES = (0.35, 0.15)  # of the reach, by frequency
MOST_OF_FORCE = 0.7  # that the trajectory may need
LEAST_REACH = 0.02  # of REACH, where the force hardly holds the joint
WORDS = {"MAIN", "ERROR", "RANGER", "CAN1"}  # taken by the project itself
FOLDERS = {"main", "table", "build", "runs", "machine", "common", "joint", "record", "experiment", "conftest"}


@dataclasses.dataclass(frozen=True)
class Joint:
    """A driven joint. Gains in A per unit of the joint; reach signed; source: of the gains. most: before the
    gear. viscous, dry: the friction that the model has."""

    board: str
    folder: str
    actuator: str
    joint: str
    unit: str
    start: float
    reach: float
    most: float
    gear: float
    inertia: float
    viscous: float
    dry: float
    stiffness: float
    damping: float
    integral: float
    source: str

    @property
    def per_A(self) -> float:
        """Force or torque at the joint per ampere."""
        return self.most * self.gear / MOST_A


@dataclasses.dataclass(frozen=True)
class Robot:
    """What is used of a model. others: its other joints; left_out: a line for each actuator without a board."""

    file: pathlib.Path
    joints: tuple[Joint, ...]
    others: tuple[str, ...]
    left_out: tuple[str, ...]


def read(file: pathlib.Path) -> Robot:
    """Read a model. UserError for one without an actuator or joint that a board could drive."""
    spec = mujoco_body.read(file)
    wanted, left_out = driven(spec)
    if not wanted:
        reasons = f": {'; '.join(left_out[:3])}" if left_out else ""
        raise UserError(f"{file}: no actuator at a hinge or slide joint, and no such joint to drive{reasons}")
    if len(wanted) > MOST_JOINTS:
        raise UserError(f"{file}: {len(wanted)} actuators, at most {MOST_JOINTS} boards fit on one bus")
    laws = {name: law_of(spec, name) for name, _ in wanted}
    drives = [Drive(name, MOST_A, 1.0 if laws[name].limit is math.nan else laws[name].limit) for name, _ in wanted]
    body = MujocoBody(file, Mapping(drives, [Encoder(joint) for _, joint in wanted]))
    taken: set[str] = set(WORDS)
    joints = []
    for number, (name, joint) in enumerate(wanted):
        board = board_name(name, taken)
        joints.append(joint_of(body, number, board, name, joint, laws[name]))
    used = {joint for _, joint in wanted}
    others = tuple(each.name for each in spec.joints if each.name not in used)
    return Robot(file, tuple(joints), others, tuple(left_out))


def driven(spec: Any) -> tuple[list[tuple[str, str]], list[str]]:
    """[(actuator, joint)] that get a board, and a line for each that does not. Without actuators: every joint."""
    kinds = {each.name: int(each.type) for each in spec.joints}
    if not spec.actuators:
        return [(name, name) for name, kind in kinds.items() if kind in TURNS], []
    found, left_out, taken = [], [], set()
    for each in spec.actuators:
        kind = mujoco.mjtTrn(each.trntype)
        if kind not in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
            left_out.append(
                f"actuator {each.name}: acts on a {kind.name.removeprefix('mjTRN_').lower()}, not on a joint"
            )
        elif kinds[each.target] not in TURNS:
            left_out.append(f"actuator {each.name}: joint {each.target} is neither a hinge nor a slide")
        elif each.target in taken:
            left_out.append(f"actuator {each.name}: joint {each.target} has another one")
        else:
            taken.add(each.target)
            found.append((each.name, each.target))
    return found, left_out


class Law(NamedTuple):
    """An actuator's own position law, before its gear; 0: without one. limit: of its force, None: that of the model."""

    stiffness: float
    damping: float
    limit: float | None


def law_of(spec: Any, name: str) -> Law:
    """The law of an actuator, or of a joint without one; its limit is nan where only the inertia can give one."""
    acting = [each for each in spec.actuators if each.name == name]
    part = acting[0] if acting else next(each for each in spec.joints if each.name == name)
    joint = next(each for each in spec.joints if each.name == (part.target if acting else name))
    by_joint = joint.actfrclimited == 1 or (joint.actfrclimited == 2 and joint.actfrcrange.any())
    if not acting:
        return Law(0.0, 0.0, None if by_joint else math.nan)
    stiffness, damping = max(0.0, -part.biasprm[1]), max(0.0, -part.biasprm[2])
    limited = part.forcelimited == 1 or (part.forcelimited == 2 and part.forcerange.any())
    if limited or by_joint or mujoco_body.gain_limit(part) is not None:
        return Law(stiffness, damping, None)
    return Law(stiffness, damping, stiffness * NO_LIMIT_SHARE or math.nan)


def joint_of(body: MujocoBody, number: int, board: str, actuator: str, name: str, law: Law) -> Joint:
    """Numbers of a driven joint: start, reach, force, inertia with the other joints at rest, and gains."""
    model, data = body.model, body.data
    joint = model.joint(name)
    dof = int(joint.dofadr[0])
    unit = "rad" if int(joint.type[0]) == HINGE else "m"
    inertia = float(np.diag(mass_matrix(model, data))[dof])
    gear = float(model.actuator_gear[body.actuators[number]][0])
    if gear == 0.0:
        raise UserError(f"{body.file}: actuator {actuator}: its gear is 0")
    most = body.windings[number].most
    if law.limit is math.nan:
        most = (3.0 * abs(float(data.qfrc_bias[dof])) + 50.0 * inertia) / abs(gear)
    start = body.shown[number][0]
    low, high = (float(each) for each in joint.range) if first(joint.limited) else (-math.inf, math.inf)
    up, down = high - start, start - low
    weight, viscous, spring = abs(float(data.qfrc_bias[dof])), first(model.dof_damping[dof]), first(joint.stiffness)
    rate, change = (sum(share * (2.0 * math.pi * hz) ** power for share, hz in zip(SHARES, FREQUENCIES_HZ, strict=True))
                    for power in (1, 2))  # fmt: skip
    possible = (MOST_OF_FORCE * most * abs(gear) - weight) / (change * inertia + rate * viscous + spring)
    reach = min(REACH[unit], max(up, down) / 3.0, max(possible, LEAST_REACH * REACH[unit]))
    reach *= 1.0 if up >= down else -1.0
    stiffness, damping, source = law.stiffness * gear**2, law.damping * gear**2, "the model's own law"
    if stiffness <= 0.0:
        needs = {
            f"{LOOP_RAD_PER_S:g} rad/s with the model's inertia": inertia * LOOP_RAD_PER_S**2,
            "the model's viscous friction": LAG_RAD_PER_S * viscous,
            "the joint's weight": weight / SAG[unit],
        }
        source = max(needs, key=lambda each: needs[each])
        stiffness, damping = needs[source] + SPRING_SHARE * spring, 0.0
    if damping <= 0.0:
        damping = 2.0 * LOOP_DAMPING * math.sqrt(stiffness * inertia)
    per_A = most * gear / MOST_A
    return Joint(
        board=board,
        folder=f"{board.lower()}_board" if board.lower() in FOLDERS else board.lower(),
        actuator=actuator,
        joint=name,
        unit=unit,
        start=start,
        reach=reach,
        most=most,
        gear=gear,
        inertia=inertia,
        viscous=viscous,
        dry=first(model.dof_frictionloss[dof]),
        stiffness=stiffness / per_A,
        damping=damping / per_A,
        integral=4.0 * stiffness / per_A,
        source=source,
    )


def first(values: Any) -> float:
    """A number of a compiled part, or the first one where MuJoCo has several."""
    return float(np.ravel(values)[0])


def mass_matrix(model: Any, data: Any) -> np.ndarray:
    """The joint-space inertia, full."""
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full


def axes(robot: Robot) -> list[drives.Axis]:
    """The driven joints as drives have them."""
    return [
        drives.Axis(
            each.board, each.folder, each.actuator, each.joint, quantity(each), each.unit, each.start, each.most,
            each.per_A, GEAR[each.unit], each.stiffness, each.damping, each.integral, each.source,
        )
        for each in robot.joints
    ]  # fmt: skip


# --- the project's files --------------------------------------------------------------------------------------------


def files(robot: Robot, name: str, fd: bool = False) -> dict[str, bytes]:
    """The project's files, {path: content}; `table/generated` is generated from them. fd: with a CAN FD bus."""
    model, made = model_files(robot.file)
    count = len(robot.joints)
    period_ms, responses_us, load = schedule(count, fd)
    words = {
        "name": name,
        "model": model,
        "last_error": "JOINT_SILENT",
        "load": f"{100 * load:.0f}",
        "load_limit": f"{load + 0.05:.2f}",
        "bit_rate": str(BIT_RATE),
        "data_bit_rate": str(DATA_BIT_RATE),
        "btr": f"0x{timing_register(BIT_RATE):08X}u",
        "period_ms": str(period_ms),
        "age_s": f"{period_ms * 1e-3:g}",
        "run_s": f"{max(0.2, 6 * period_ms * 1e-3):.2f}",
        "most_A": f"{MOST_A}",
        "V_per_A": f"{V_PER_A}",
        "first": robot.joints[0].board,
        "left_out": "".join(f"Left out: {line}.\n\n" for line in robot.left_out),
        "rows": "".join(readme_row(each) for each in robot.joints),
        "joints": "".join(
            f'    "{each.board}": Joint("{each.folder}", {quoted(each.actuator)}, {quoted(each.joint)}, '
            f'"{quantity(each)}", {each.most:.6g}, {LINES}, {GEAR[each.unit]}),\n'
            for each in robot.joints
        ),
        "others": "".join(f"{quoted(each)}, " for each in robot.others).rstrip(" ") if robot.others else "",
        "jitter": "".join(f'    "{each}": {late_us},\n' for each, late_us in jitters(robot, responses_us)),
        "band": "".join(f"{quantity(each)} = {0.1 if each.unit == 'rad' else 0.02}\n" for each in robot.joints),
        "places": ", ".join(f'"{each.board}.encoder"' for each in robot.joints),
        "instances": "".join(
            f'{each.board} = Joint("{each.board.lower()}", "{quantity(each)}", "{each.unit}", {each.per_A:.6g}, '
            f"{each.inertia:.6g}, {each.viscous:.6g}, {each.dry:.6g})\n"
            for each in robot.joints
        ).rstrip("\n"),
    }
    texts = {path: filled(HERE / f"{pathlib.Path(path).name}.j2", words, fd) for path in PLAIN}
    texts["main/main.c"] = filled(HERE / "main.c.j2", words | main_words(robot, period_ms), fd)
    texts["table/boards.toml"] = boards_table(robot, name, period_ms, fd)
    texts["table/variables.csv"] = variables_table(robot, period_ms)
    texts["table/errors.csv"] = errors_table(robot)
    for folder in ("main", *(each.folder for each in robot.joints)):
        board = "main" if folder == "main" else next(each.board for each in robot.joints if each.folder == folder)
        texts[f"{folder}/firmware.toml"] = (
            f'[firmware]\nname = "{folder}"\ntables = ["{board.lower()}"]\nmaster = "../table"\n'
        )
    for each in robot.joints:
        own = {
            "board": each.board, "folder": each.board.lower(), "actuator": each.actuator, "joint": each.joint,
            "unit": each.unit, "source": each.source, "start": single(each.start),
            "unit_per_edge": single(math.pi / LINES / GEAR[each.unit]), "stiffness": single(each.stiffness),
            "damping": single(each.damping), "integral": single(each.integral),
        }  # fmt: skip
        texts[f"{each.folder}/{each.folder}.c"] = filled(HERE / "board.c.j2", words | own, fd)
    return made | {path: text.encode("utf-8") for path, text in texts.items()}


PLAIN = (
    "README.md", "common.h", "joint.h", "machine.py", "conftest.py", "test_machine.py", "campaign.toml", "record.py",
    "experiment.py",
)  # fmt: skip


def model_files(file: pathlib.Path) -> tuple[str, dict[str, bytes]]:
    """(name of the model in the project, its files): as it is, or with the files that it includes, and its assets."""
    content = file.read_bytes()
    spec = mujoco_body.read(file)
    parts = [each for each in (*spec.meshes, *spec.textures, *spec.hfields, *spec.skins) if getattr(each, "file", "")]
    if not parts and b"<include" not in content:
        return file.name, {file.name: content}
    made: dict[str, bytes] = {}
    for number, each in enumerate(parts):
        folder = spec.texturedir if isinstance(each, mujoco.MjsTexture) else spec.meshdir
        source = file.parent / folder / each.file
        each.file = f"{number}_{pathlib.Path(each.file).name}"
        made[f"assets/{each.file}"] = source.read_bytes()
    spec.meshdir = spec.texturedir = "assets"
    spec.modelfiledir = ""
    assets = {path.removeprefix("assets/"): content for path, content in made.items()}
    spec.assets = assets
    mujoco_body.compiled(spec, str(file))
    with mujoco_body.without_advice():
        text = spec.to_xml()
    return f"{file.stem}.xml", made | {f"{file.stem}.xml": text.encode("utf-8")}


def schedule(count: int, fd: bool = False) -> tuple[int, list[int], float]:
    """(period in ms, worst response of each frame in us by order of identifiers, load) for this many joints."""
    flags, data_bit_rate = (FD_FLAGS, DATA_BIT_RATE) if fd else (8, 0)
    for period_ms in PERIODS_MS:
        streams = [bounds.message(str(n), n, period_ms * 1_000_000, flags) for n in range(1, 3 * count + 1)]
        load = float(bounds.utilisation(streams, BIT_RATE, data_bit_rate))
        if load <= MOST_LOAD and count < period_ms * 1000 // SLOT_US:
            found = bounds.response_times(streams, BIT_RATE, data_bit_rate=data_bit_rate)
            return period_ms, [(each.response_ns or 0) // 1000 for each in found], load
    raise UserError(f"{count} joints: their frames do not fit on a bus of {BIT_RATE} bit/s")


def jitters(robot: Robot, responses_us: list[int]) -> Iterable[tuple[str, int]]:
    """(frame, how late it may be in us): a slot's tasks and interrupts, and the worst response."""
    names = [f"{each.board}_{word}" for word in ("TARGET", "POSITION", "CURRENT") for each in robot.joints]
    return [(name, response + 200) for name, response in zip(names, responses_us, strict=True)]


def quantity(joint: Joint) -> str:
    """The joint's position among the quantities of the body."""
    return f"{identifier(joint.joint)}_{joint.unit}"


def readme_row(joint: Joint) -> str:
    unit = "N m" if joint.unit == "rad" else "N"
    most = joint.most * abs(joint.gear)
    return f"| {joint.board} | {joint.actuator} | {joint.joint} | {most:.4g} {unit} |\n"


def main_words(robot: Robot, period_ms: int) -> dict[str, str]:
    """What the main board's program has for its joints."""
    joints = robot.joints
    phases = [2.0 * math.pi * hz * SLOT_US * 1e-6 for hz in FREQUENCIES_HZ]
    return {
        "joints": str(len(joints)),
        "table": "".join(
            f"    {{{each.board}_TARGET, {each.board}_POSITION, {single(each.start)}f, {single(each.reach)}f}},\n"
            for each in joints
        ),
        "senders": "".join(
            f"static int32_t send_{k}(void) {{ return send_target({k}); }}\n" for k in range(len(joints))
        ),
        "tasks": "\n".join(
            f'static const fw_task row{k}[] = {{{{send_{k}, "{each.board}_TARGET", 300, 450}}}};'
            for k, each in enumerate(joints)
        ),
        "rows": "".join(f"    [{k}] = FW_TASKS(row{k}),\n" for k in range(len(joints))),
        "watch_cost": str(100 + 40 * len(joints)),
        "watch_limit": str(150 + 60 * len(joints)),
        "slow_share": single(SHARES[0]),
        "fast_share": single(SHARES[1]),
        "slow_hz": f"{FREQUENCIES_HZ[0]:g}",
        "fast_hz": f"{FREQUENCIES_HZ[1]:g}",
        "slow_cosine": single(math.cos(phases[0])),
        "slow_sine": single(math.sin(phases[0])),
        "fast_cosine": single(math.cos(phases[1])),
        "fast_sine": single(math.sin(phases[1])),
    }


def boards_table(robot: Robot, name: str, period_ms: int, fd: bool = False) -> str:
    """boards.toml."""
    count = period_ms * 1000 // SLOT_US
    lines = [
        f"# The boards of {name}, their bus, and what each board's schedule sends. All names are of variables.csv.",
        "",
        "[buses]",
        f"CAN1 = {{ channel = 1, bit_rate = {BIT_RATE:_}{f', data_bit_rate = {DATA_BIT_RATE:_}' if fd else ''} }}",
    ]
    main: list[list[str]] = [[] for _ in range(count)]
    for k, each in enumerate(robot.joints):
        main[k] = [f"{each.board}_TARGET"]
    boards = [("MAIN", "main board: a trajectory for every joint, and their supervision", main)]
    for each in robot.joints:
        rows: list[list[str]] = [[] for _ in range(count)]
        rows[0], rows[count // 2] = [f"{each.board}_POSITION"], [f"{each.board}_CURRENT"]
        boards.append((each.board, f"board of joint {each.joint}: encoder, current, PWM", rows))
    for number, (board, description, rows) in enumerate(boards, 1):
        lines += [
            "",
            f"[boards.{board}]",
            f"number = {number}",
            f"description = {quoted(description)}",
            'can = "fd"' if fd else 'processor = "LPC2194"',
            "clock_hz = 60_000_000",
            "controller = 1",
            'buses = ["CAN1"]',
            "firmware = true",
            f"slot_us = {SLOT_US}",
            f"rows = [{', '.join('[' + ', '.join(quoted(each) for each in row) + ']' for row in rows)}]",
            f"occasional_row = {count - 1}",
            f'occasional = ["ERROR_{board}"]',
        ]
    return "\n".join(lines) + "\n"


def variables_table(robot: Robot, period_ms: int) -> str:
    """variables.csv: errors first, then what every joint needs, which then wins the bus over what it reports."""
    out = ["id,name,type,unit,initial,publisher,subscribers,bus,period_ms,minimum,maximum,description"]
    waiting = '"waiting error: code bits 0-15, board 16-21, count 22-31; sent only while one waits"'
    every = ";".join(each.board for each in robot.joints)
    out.append(f"1,ERROR_MAIN,u32,,0,MAIN,{every},CAN1,{2 * period_ms},,,{waiting}")
    for k, each in enumerate(robot.joints):
        out.append(f"{2 + k},ERROR_{each.board},u32,,0,{each.board},MAIN,CAN1,{2 * period_ms},,,{waiting}")
    for number, word, text in ((64, "TARGET", "where it is to be"), (96, "POSITION", "by its encoder")):
        for k, each in enumerate(robot.joints):
            publisher, subscriber = ("MAIN", each.board) if word == "TARGET" else (each.board, "MAIN")
            about = f"joint {each.joint}: {text}".replace('"', "'")
            wire = f"{publisher},{subscriber},CAN1,{period_ms}"
            out.append(f'{number + k},{each.board}_{word},f32,{each.unit},0,{wire},,,"{about}"')
    for k, each in enumerate(robot.joints):
        out.append(f"{128 + k},{each.board}_CURRENT,f32,A,0,{each.board},MAIN,CAN1,{period_ms},,,current as measured")
    return "\n".join(out) + "\n"


def errors_table(robot: Robot) -> str:
    """errors.csv."""
    joints = ";".join(each.board for each in robot.joints)
    return (
        "id,name,boards,normal_per_s,normal_at_start,description\n"
        f"0,DEFAULT,MAIN;{joints},,,nothing wrong\n"
        f"1,TARGET_LOST,{joints},,,no target for five periods: no power until one comes\n"
        f"2,ENCODER_DEAD,{joints},,,the largest current for 100 ms and no edge of the encoder: no power any more\n"
        "3,JOINT_SILENT,MAIN,,,no position of a joint for five periods\n"
    )
