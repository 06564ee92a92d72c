"""`ranger-sim new DIR --drive cia402` or `odrive`: joints' boards in C that a robot's unchanged driver can talk to.

The object dictionary of the CANopen drive is one table here, from which the board's objects.h and EDS file are made.
"""

from __future__ import annotations

import math
import pathlib
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from ranger_sim.tools.new.from_dbc import filled, timing_register
from ranger_sim.tools.new.words import single

HERE = pathlib.Path(__file__).resolve().parent / "drive"
PROTOCOLS = ("cia402", "odrive")
BIT_RATE = 1_000_000
MOST_A, V_PER_A, LINES = 10.0, 0.08, 1000
TYPES = {
    "I8": (2, "int8_t"), "I16": (3, "int16_t"), "I32": (4, "int32_t"),
    "U8": (5, "uint8_t"), "U16": (6, "uint16_t"), "U32": (7, "uint32_t"), "TEXT": (9, "char"),
}  # fmt: skip
ACCESS = {"ro": "READ", "const": "READ", "rw": "READ | WRITE", "wo": "WRITE"}
LOWEST, HIGHEST = -(2**31), 2**31 - 1


class Object(NamedTuple):
    """A variable of the object dictionary. place: in C.

    default: of C and EDS; "node+0x180" adds the node's number. pdo: "r" mappable in what the drive receives, "t" in
    what it sends.
    """

    index: int  # type: ignore[assignment]  # a tuple's method of this name is not used
    sub: int
    name: str
    type: str
    access: str
    place: str
    default: int | str = 0
    low: int | None = None
    high: int | None = None
    pdo: str = ""


# Indexes with several variables: {index: (name, object type of CiA 306: 8 array, 9 record)}
SEVERAL = {
    0x1003: ("Pre-defined error field", 8),
    0x1016: ("Consumer heartbeat time", 8),
    0x1018: ("Identity object", 9),
    0x1200: ("SDO server parameter", 9),
    0x607D: ("Software position limit", 8),
    0x608F: ("Position encoder resolution", 8),
    0x60C2: ("Interpolation time period", 9),
}
# What each PDO has at power-up: (transmission type, inhibit time in 100 us, event timer in ms, objects)
RECEIVED = ((255, 0, 0, (0x6040, 0x6060)), (1, 0, 0, (0x607A,)), (1, 0, 0, (0x60FF,)), (1, 0, 0, (0x6071,)))
SENT = ((255, 10, 100, (0x6041, 0x6061)), (1, 0, 0, (0x6064, 0x606C)), (1, 0, 0, (0x6077, 0x60F4)), (255, 0, 0, ()))


def counted(number: int) -> str:
    """The place of a number of entries that does not change."""
    return f"numbers[{number}]"


def dictionary(version: str) -> list[Object]:
    """All variables, in order."""
    found = [
        Object(0x1000, 0, "Device type", "U32", "const", "device_type", 0x00020192),
        Object(0x1001, 0, "Error register", "U8", "ro", "error_register", pdo="t"),
        Object(0x1003, 0, "Number of errors", "U8", "rw", "history_count"),
        *(Object(0x1003, k, f"Standard error field {k}", "U32", "ro", f"history[{k - 1}]") for k in range(1, 5)),
        Object(0x1005, 0, "COB-ID SYNC message", "U32", "rw", "sync_cob_id", 0x80, 1, 0x7FF),
        Object(0x1008, 0, "Manufacturer device name", "TEXT", "const", "name", "ranger-sim joint drive"),
        Object(0x1009, 0, "Manufacturer hardware version", "TEXT", "const", "hardware", "LPC2194"),
        Object(0x100A, 0, "Manufacturer software version", "TEXT", "const", "software", version),
        Object(0x1014, 0, "COB-ID EMCY", "U32", "rw", "emcy_cob_id", "node+0x80", 1, 0xFFFFFFFF),
        Object(0x1016, 0, "Number of entries", "U8", "const", counted(1), 1),
        Object(0x1016, 1, "Consumer heartbeat time 1", "U32", "rw", "consumer_heartbeat", 0, 0, 0x7FFFFF),
        Object(0x1017, 0, "Producer heartbeat time", "U16", "rw", "producer_heartbeat_ms"),
        Object(0x1018, 0, "Number of entries", "U8", "const", counted(4), 4),
        Object(0x1018, 1, "Vendor-ID", "U32", "const", "zero", 0),
        Object(0x1018, 2, "Product code", "U32", "const", "product", 402),
        Object(0x1018, 3, "Revision number", "U32", "const", "revision", 1),
        Object(0x1018, 4, "Serial number", "U32", "const", "serial", "node+0"),
        Object(0x1200, 0, "Number of entries", "U8", "const", counted(2), 2),
        Object(0x1200, 1, "COB-ID client to server", "U32", "const", "sdo_request_id", "node+0x600"),
        Object(0x1200, 2, "COB-ID server to client", "U32", "const", "sdo_reply_id", "node+0x580"),
        Object(0x6007, 0, "Abort connection option code", "I16", "rw", "abort_option", 1, 0, 3),
        Object(0x603F, 0, "Error code", "U16", "ro", "error_code", pdo="t"),
        Object(0x6040, 0, "Controlword", "U16", "rw", "controlword", pdo="r"),
        Object(0x6041, 0, "Statusword", "U16", "ro", "statusword", pdo="t"),
        Object(0x605A, 0, "Quick stop option code", "I16", "rw", "quick_stop_option", 2, 0, 6),
        Object(0x6060, 0, "Modes of operation", "I8", "rw", "mode", 0, 0, 10, "r"),
        Object(0x6061, 0, "Modes of operation display", "I8", "ro", "mode_shown", pdo="t"),
        Object(0x6062, 0, "Position demand value", "I32", "ro", "position_demand", pdo="t"),
        Object(0x6064, 0, "Position actual value", "I32", "ro", "position", pdo="t"),
        Object(0x6065, 0, "Following error window", "U32", "rw", "following_window", "FOLLOWING_COUNTS"),
        Object(0x6066, 0, "Following error time out", "U16", "rw", "following_ms", 50),
        Object(0x6067, 0, "Position window", "U32", "rw", "position_window", 20),
        Object(0x6068, 0, "Position window time", "U16", "rw", "position_ms", 5),
        Object(0x606B, 0, "Velocity demand value", "I32", "ro", "velocity_demand", pdo="t"),
        Object(0x606C, 0, "Velocity actual value", "I32", "ro", "velocity", pdo="t"),
        Object(0x6071, 0, "Target torque", "I16", "rw", "target_torque", pdo="r"),
        Object(0x6072, 0, "Max torque", "U16", "rw", "max_torque", 1000, 0, 1000, "r"),
        Object(0x6074, 0, "Torque demand", "I16", "ro", "torque_demand", pdo="t"),
        Object(0x6075, 0, "Motor rated current", "U32", "ro", "rated_mA", round(MOST_A * 1000)),
        Object(0x6076, 0, "Motor rated torque", "U32", "ro", "rated_torque", "RATED_TORQUE"),
        Object(0x6077, 0, "Torque actual value", "I16", "ro", "torque", pdo="t"),
        Object(0x6078, 0, "Current actual value", "I16", "ro", "current", pdo="t"),
        Object(0x6079, 0, "DC link circuit voltage", "U32", "ro", "link_mV", 24000, pdo="t"),
        Object(0x607A, 0, "Target position", "I32", "rw", "target_position", pdo="r"),
        Object(0x607C, 0, "Home offset", "I32", "rw", "home_offset"),
        Object(0x607D, 0, "Number of entries", "U8", "const", counted(2), 2),
        Object(0x607D, 1, "Min position limit", "I32", "rw", "lowest", LOWEST),
        Object(0x607D, 2, "Max position limit", "I32", "rw", "highest", HIGHEST),
        Object(0x607F, 0, "Max profile velocity", "U32", "rw", "max_velocity", "MOST_COUNTS_PER_S", 1),
        Object(0x6081, 0, "Profile velocity", "U32", "rw", "profile_velocity", "COUNTS_PER_UNIT", 1, pdo="r"),
        Object(0x6083, 0, "Profile acceleration", "U32", "rw", "acceleration", "4 * COUNTS_PER_UNIT", 1, pdo="r"),
        Object(0x6084, 0, "Profile deceleration", "U32", "rw", "deceleration", "4 * COUNTS_PER_UNIT", 1, pdo="r"),
        Object(0x6085, 0, "Quick stop deceleration", "U32", "rw", "quick_deceleration", "20 * COUNTS_PER_UNIT", 1),
        Object(0x608F, 0, "Number of entries", "U8", "const", counted(2), 2),
        Object(0x608F, 1, "Encoder increments", "U32", "ro", "encoder_counts", "COUNTS_PER_TURN"),
        Object(0x608F, 2, "Motor revolutions", "U32", "ro", "one", 1),
        Object(0x6098, 0, "Homing method", "I8", "rw", "homing_method", 37),
        Object(0x60B1, 0, "Velocity offset", "I32", "rw", "velocity_offset", pdo="r"),
        Object(0x60B2, 0, "Torque offset", "I16", "rw", "torque_offset", pdo="r"),
        Object(0x60C2, 0, "Number of entries", "U8", "const", counted(2), 2),
        Object(0x60C2, 1, "Interpolation time period value", "U8", "rw", "interpolation_time", 10, 1, 255),
        Object(0x60C2, 2, "Interpolation time index", "I8", "rw", "interpolation_exponent", -3, -6, 0),
        Object(0x60F4, 0, "Following error actual value", "I32", "ro", "following_error", pdo="t"),
        Object(0x60FF, 0, "Target velocity", "I32", "rw", "target_velocity", pdo="r"),
        Object(0x6502, 0, "Supported drive modes", "U32", "const", "supported", 0x3A5),
    ]
    bits = {each.index: 8 * size_of(each) for each in found}
    for first, base, table, word in ((0x1400, 0x200, RECEIVED, "rpdo"), (0x1800, 0x180, SENT, "tpdo")):
        for k, (kind, inhibit, event, mapped) in enumerate(table):
            place = f"{word}[{k}]"
            valid = "" if mapped else " | 0x80000000"
            entries = [index << 16 | bits[index] for index in mapped] + [0] * (8 - len(mapped))
            found += [
                Object(first + k, 0, "Highest sub-index", "U8", "const", counted(5), 5),
                Object(first + k, 1, "COB-ID", "U32", "rw", f"{place}.cob_id", f"node+{base + 0x100 * k:#x}{valid}"),
                Object(first + k, 2, "Transmission type", "U8", "rw", f"{place}.type", kind),
                Object(first + k, 3, "Inhibit time", "U16", "rw", f"{place}.inhibit_100us", inhibit),
                Object(first + k, 5, "Event timer", "U16", "rw", f"{place}.event_ms", event),
                Object(first + 0x200 + k, 0, "Number of objects", "U8", "rw", f"{place}.count", len(mapped), 0, 8),
                *(
                    Object(first + 0x200 + k, n + 1, f"Object {n + 1}", "U32", "rw", f"{place}.map[{n}]", entry)
                    for n, entry in enumerate(entries)
                ),
            ]
    return sorted(found)


def size_of(each: Object) -> int:
    """Bytes of a variable; 0 of a text."""
    return 0 if each.type == "TEXT" else int(each.type[1:]) // 8


def several() -> dict[int, tuple[str, int]]:
    """SEVERAL, with those of the PDOs."""
    found = dict(SEVERAL)
    for first, word in ((0x1400, "Receive"), (0x1800, "Transmit")):
        for k in range(4):
            found[first + k] = (f"{word} PDO {k + 1} parameter", 9)
            found[first + 0x200 + k] = (f"{word} PDO {k + 1} mapping", 9)
    return found


def range_of(each: Object) -> tuple[int, int]:
    """The values that an object takes."""
    if each.type == "TEXT":
        return 0, 0
    bits = 8 * size_of(each)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if each.type[0] == "I" else (0, (1 << bits) - 1)
    return low if each.low is None else each.low, high if each.high is None else each.high


def objects_h(version: str) -> str:
    """The dictionary in C: its variables, their table, and their values at power-up."""
    found = dictionary(version)
    members: dict[str, str] = {}
    for each in found:
        if each.type == "TEXT" or each.place.startswith(("numbers[", "rpdo[", "tpdo[")):
            continue
        name, bracket, _ = each.place.partition("[")
        members[f"{name}[HISTORY]" if bracket else name] = TYPES[each.type][1]
    lines = [
        "/* The object dictionary: variables, table, values at power-up. The EDS file is from the same source. */",
        "",
        "static struct dictionary {",
        "    pdo_objects rpdo[PDOS], tpdo[PDOS];",
        *(f"    {kind} {name};" for name, kind in members.items()),
        "} od;",
        "",
        "static const uint8_t numbers[] = {0, 1, 2, 3, 4, 5};",
        *(f'static const char text_{each.index:04X}[] = "{each.default}";' for each in found if each.type == "TEXT"),
        "",
        "/* index, sub-index, type, access, place, lowest, highest; sorted */",
        "static const object objects[] = {",
    ]
    for each in found:
        low, high = range_of(each)
        access = ACCESS[each.access] + (" | RECEIVED" if each.pdo == "r" else " | SENT" if each.pdo == "t" else "")
        if each.type == "TEXT":
            place = f"(void *)text_{each.index:04X}"
        elif each.place.startswith("numbers["):
            place = f"(void *)&{each.place}"
        else:
            place = f"&od.{each.place}"
        lines.append(
            f"    {{0x{each.index:04X}, {each.sub}, {each.type}, {access}, {place}, {low}LL, {high}LL}}, "
            f"/* {each.name} */"
        )
    lines += ["};", "enum { OBJECT_COUNT = sizeof objects / sizeof objects[0] };"]
    for name, first, last in (("communication", 0x1000, 0x1FFF), ("application", 0x6000, 0x9FFF)):
        lines += ["", f"static void load_{name}(void)", "{"]
        for each in found:
            if first <= each.index <= last and each.type != "TEXT" and not each.place.startswith("numbers["):
                lines.append(f"    od.{each.place} = {value_in_c(each)};")
        lines.append("}")
    return "\n".join(lines) + "\n"


def value_in_c(each: Object) -> str:
    """The value at power-up, as C has it."""
    value = each.default
    if isinstance(value, str):
        if "node+" in value:
            parts = [part.strip().replace("node+", "NODE_ID + ") for part in value.split("|")]
            return " | ".join([f"({parts[0]})", *(f"{part}u" for part in parts[1:])]) if parts[1:] else parts[0]
        return f"({TYPES[each.type][1]})({value})"
    if value == LOWEST:
        return "INT32_MIN"
    return f"0x{value:X}u" if value > HIGHEST or each.type == "U32" else str(value)


def eds(version: str, numbers: dict[str, int], name: str) -> str:
    """The EDS file (CiA 306). numbers: of the joint, by their names in C."""
    found = dictionary(version)
    indexes = sorted({each.index for each in found})
    several_ = several()
    groups: dict[str, list[int]] = {
        "MandatoryObjects": [index for index in (0x1000, 0x1001, 0x1018) if index in indexes],
        "OptionalObjects": [index for index in indexes if index not in (0x1000, 0x1001, 0x1018)],
        "ManufacturerObjects": [],
    }
    lines = [
        "[FileInfo]", f"FileName={name}.eds", "FileVersion=1", "FileRevision=0", "EDSVersion=4.0",
        "Description=joint drive, CiA 402", "",
        "[DeviceInfo]", "VendorName=ranger-sim", "VendorNumber=0x0", "ProductName=ranger-sim joint drive",
        "ProductNumber=402", "RevisionNumber=1", "BaudRate_10=0", "BaudRate_20=0", "BaudRate_50=0", "BaudRate_125=0",
        "BaudRate_250=0", "BaudRate_500=0", "BaudRate_800=0", "BaudRate_1000=1", "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1", "Granularity=8", "DynamicChannelsSupported=0", "GroupMessaging=0", "NrOfRXPDO=4",
        "NrOfTXPDO=4", "LSS_Supported=0", "",
        "[DummyUsage]", *(f"Dummy{k:04d}=0" for k in range(1, 5)), *(f"Dummy{k:04d}=1" for k in range(5, 8)), "",
    ]  # fmt: skip
    for group, members in groups.items():
        lines += [f"[{group}]", f"SupportedObjects={len(members)}"]
        lines += [f"{k}=0x{index:04X}" for k, index in enumerate(members, 1)] + [""]
    for index in indexes:
        own = [each for each in found if each.index == index]
        if index in several_:
            text, kind = several_[index]
            lines += [f"[{index:04X}]", f"ParameterName={text}", f"ObjectType=0x{kind:X}", f"SubNumber={len(own)}", ""]
        for each in own:
            section = f"{index:04X}sub{each.sub:X}" if index in several_ else f"{index:04X}"
            lines += [f"[{section}]", *entry_of(each, numbers), ""]
    return "\r\n".join(lines)


def entry_of(each: Object, numbers: dict[str, int]) -> Iterable[str]:
    """Lines of a variable's section."""
    default = each.default
    if isinstance(default, str) and each.type != "TEXT":
        if default.startswith("node+"):
            offset = sum(int(part, 0) for part in default.removeprefix("node+").split("|"))
            default = f"$NODEID+0x{offset:X}"
        else:
            factor, _, word = default.rpartition("*")
            default = int(factor or 1) * numbers[word.strip()]
    yield f"ParameterName={each.name}"
    yield "ObjectType=0x7"
    yield f"DataType=0x{TYPES[each.type][0]:04X}"
    yield f"AccessType={each.access}"
    yield f"DefaultValue={default}"
    low, high = range_of(each)
    if each.low is not None or each.high is not None:
        yield f"LowLimit={low}"
        yield f"HighLimit={high}"
    yield f"PDOMapping={1 if each.pdo else 0}"


# --- the project's files --------------------------------------------------------------------------------------------


class Axis(NamedTuple):
    """A joint with a drive. Gains in A per unit of the joint; per_A: force or torque at the joint per ampere."""

    board: str
    folder: str
    actuator: str
    joint: str
    quantity: str
    unit: str
    start: float
    most: float
    per_A: float
    gear: float
    stiffness: float
    damping: float
    integral: float
    source: str


FASTEST = {"rad": 20.0, "m": 2.0}  # per s; and the following error that is a fault
BEHIND = {"rad": 0.5, "m": 0.1}
LINK = {"inertia": 0.02, "weight": 1.0, "damping_Nms": 0.05, "per_A": 0.5}  # of the project without a model
LOOP_RAD_PER_S, LOOP_DAMPING = 20.0, 0.8  # as of the boards for a MuJoCo model
NODES = {"cia402": 1, "odrive": 0}  # the first one; an ODrive's own number is 0 at first
PROTOCOL_NAMES = {"cia402": "CiA 402 over CANopen", "odrive": "ODrive's CAN protocol"}
SOURCES = {"cia402": ("motor.h", "canopen.h", "cia402.h"), "odrive": ("motor.h", "odrive.h")}
COMMON = ("machine.py", "serve.py", "conftest.py", "campaign.toml")
OF_PROTOCOL = ("README.md", "driver.py", "test_machine.py")
FRAMES = {
    "cia402": {
        0x80: "EMCY", 0x180: "STATUS", 0x280: "POSITION", 0x380: "TORQUE", 0x200: "CONTROL", 0x300: "TARGET_POSITION",
        0x400: "TARGET_VELOCITY", 0x500: "TARGET_TORQUE", 0x580: "SDO_REPLY", 0x600: "SDO_REQUEST", 0x700: "HEARTBEAT",
    },
    "odrive": {
        0x01: "HEARTBEAT", 0x02: "ESTOP", 0x03: "ERROR", 0x07: "STATE", 0x09: "ENCODER", 0x0B: "MODE",
        0x0C: "INPUT_POS", 0x0D: "INPUT_VEL", 0x0E: "INPUT_TORQUE", 0x14: "IQ", 0x17: "BUS", 0x18: "CLEAR",
    },
}  # fmt: skip


def links(names: Sequence[str] = ("shoulder", "elbow")) -> list[Axis]:
    """The joints of the project without a model: links that hang on geared motors."""
    stiffness = LINK["inertia"] * LOOP_RAD_PER_S**2
    damping = 2.0 * LOOP_DAMPING * math.sqrt(stiffness * LINK["inertia"])
    return [
        Axis(
            name.upper(), name, f"{name}_motor", name, f"{name}_rad", "rad", 0.0, LINK["per_A"] * MOST_A,
            LINK["per_A"], 16.0, stiffness / LINK["per_A"], damping / LINK["per_A"], 4.0 * stiffness / LINK["per_A"],
            f"{LOOP_RAD_PER_S:g} rad/s with the link's inertia",
        )
        for name in names
    ]  # fmt: skip


def numbers_of(axis: Axis) -> dict[str, int]:
    """The joint's numbers by their names in C."""
    counts = 2.0 * LINES * axis.gear / (2.0 * math.pi)  # both edges of channel A
    return {
        "COUNTS_PER_UNIT": round(counts),
        "COUNTS_PER_TURN": round(counts * 2.0 * math.pi) if axis.unit == "rad" else round(counts),
        "RATED_TORQUE": round(abs(axis.per_A) * MOST_A * 1000),
        "FOLLOWING_COUNTS": round(BEHIND[axis.unit] * counts),
        "MOST_COUNTS_PER_S": round(FASTEST[axis.unit] * counts),
    }


def board_words(axis: Axis, node: int, protocol: str) -> dict[str, str]:
    """The words of a board's own file."""
    counts = 2.0 * LINES * axis.gear / (2.0 * math.pi)
    own = numbers_of(axis)
    return {
        "board": axis.board, "joint": axis.joint, "node": str(node), "source": axis.source, "unit": axis.unit,
        "protocol": protocol, "turn": str(own["COUNTS_PER_TURN"]), "counts": str(own["COUNTS_PER_UNIT"]),
        "start": str(math.floor(axis.start * counts)), "rated": str(own["RATED_TORQUE"]),
        "following": str(own["FOLLOWING_COUNTS"]), "fastest": str(own["MOST_COUNTS_PER_S"]),
        "stiffness": single(axis.stiffness / counts), "damping": single(axis.damping / counts),
        "integral": single(axis.integral / counts), "most_A": f"{MOST_A}",
        "per_A": single(abs(axis.per_A)), "sign": "1.0" if axis.per_A > 0.0 else "-1.0",
    }  # fmt: skip


def files(axes: Sequence[Axis], protocol: str, name: str, version: str, model: str = "") -> dict[str, str]:
    """The project's files, {path: text}. model: name of the MuJoCo model; empty: links of body.py."""
    first = NODES[protocol]
    words = {
        "name": name,
        "protocol": protocol,
        "protocol_name": PROTOCOL_NAMES[protocol],
        "btr": f"0x{timing_register(BIT_RATE):08X}u",
        "most_A": f"{MOST_A}",
        "V_per_A": f"{V_PER_A}",
        "channel": "drives",
        "boards": ", ".join(each.board for each in axes),
        "folder": axes[0].folder,
        "first_quantity": axes[0].quantity,
        "joints": "".join(
            f'    "{each.board}": Joint({first + k}, "{each.folder}", {each.actuator!r}, {each.joint!r}, '
            f'"{each.quantity}", {each.most:.6g}, {LINES}, {each.gear}, '
            f"{LINES * each.gear / math.pi:.9g}, {each.start:.9g}),\n"
            for k, each in enumerate(axes)
        ),
        "frames": ", ".join(f'0x{code:03X}: "{word}"' for code, word in FRAMES[protocol].items()),
        "identifier": "code + each.node" if protocol == "cia402" else "code | each.node << 5",
        "places": ", ".join(f'"{each.board}.encoder"' for each in axes),
        "rows": "".join(
            f"| {first + k} | {each.board} | {each.joint} | {each.most_at_joint} |\n"
            for k, each in enumerate(map(Shown, axes))
        ),
        "body_import": "" if model else "from body import Links\n",
        "mujoco_import": ("from ranger_sim.harness.bodies.mujoco_body import MujocoBody\n" if model else ""),
        "numbers_argument": "" if model else ", **numbers: float",
        "body": f"MujocoBody(HERE / {model!r}, body, seed)" if model else "Links(body, seed, **numbers)",
        "body_file": f"`{model}`, the robot" if model else "`body.py`, the links",
        **{key: f"{value}" for key, value in LINK.items()},
    }
    texts = {path: filled(HERE / f"{path}.j2", words) for path in COMMON}
    texts |= {path: filled(HERE / f"{protocol}_{path}.j2", words) for path in OF_PROTOCOL}
    texts |= {path: filled(HERE / f"{path}.j2", words) for path in SOURCES[protocol]}
    if not model:
        texts["body.py"] = filled(HERE / "body.py.j2", words)
    if protocol == "cia402":
        texts["objects.h"] = objects_h(version)
    for k, each in enumerate(axes):
        texts[f"{each.folder}/firmware.toml"] = f'[firmware]\nname = "{each.folder}"\n'
        texts[f"{each.folder}/{each.folder}.c"] = filled(
            HERE / "board.c.j2", words | board_words(each, first + k, protocol)
        )
        if protocol == "cia402":
            texts[f"{each.folder}/{each.folder}.eds"] = eds(version, numbers_of(each), each.folder)
    return texts


class Shown:
    """A joint as a README shows it."""

    def __init__(self, axis: Axis) -> None:
        self.board, self.joint = axis.board, axis.joint
        self.most_at_joint = f"{abs(axis.per_A) * MOST_A:.4g} {'N m' if axis.unit == 'rad' else 'N'}"
