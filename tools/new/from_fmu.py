"""`ranger-sim new DIR --plant fmu unit.fmu`: boards at the inputs and outputs of a user's FMI unit, and a main board.

The unit is run by itself first: what its outputs move by there scales their sensors.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib
from typing import Any

from ranger_sim.can_bus import bounds
from ranger_sim.foundation.user_error import ModelError, UserError
from ranger_sim.harness.bodies.mapping import Input, Mapping
from ranger_sim.harness.bodies.names import identifier
from ranger_sim.tools.new.from_dbc import filled, timing_register
from ranger_sim.tools.new.words import board_name, quoted, single

HERE = pathlib.Path(__file__).resolve().parent
BIT_RATE = 1_000_000
SLOT_US = 500
PERIODS_MS = (4, 5, 10, 20, 40, 80)
MOST_LOAD = 0.5  # of the bus by cyclic messages; the rest is for errors, and for what a user adds
MOST_BOARDS = 30  # CAN transceivers drive as many nodes at least (ISO 11898-2)
CHANNELS = 4  # of an LPC2194's converter
SECONDS = 5  # of the unit by itself
LONGEST_VALUE = 24  # of a variable's name, chosen by us
REALS = ("Real", "Float64", "Float32")
SHOWN = 0.25  # of 3.3 V: what an output moved by, so that a sensor shows four times as much
FREQUENCIES_HZ = (0.5, 3.1)
WORDS = {"MAIN", "ERROR", "RANGER", "CAN1"}  # taken by the project itself
FOLDERS = {"main", "table", "build", "runs", "machine", "common", "input", "sensor", "conftest"}
FIRST_TARGET, FIRST_ACTING, FIRST_VALUE = 64, 96, 128  # identifiers


@dataclasses.dataclass(frozen=True)
class Actuated:
    """An input and its board. low, high: its limits; most: the larger one's size."""

    board: str
    variable: str
    unit: str
    start: float
    low: float
    high: float
    most: float

    @property
    def reach(self) -> float:
        """How far the trajectory goes from the start: to the farther limit, at most half of `most`."""
        up, down = self.high - self.start, self.start - self.low
        return math.copysign(min(max(up, down), 0.5 * self.most), 1.0 if up >= down else -1.0)


@dataclasses.dataclass(frozen=True)
class Measured:
    """An output, the variable that carries it, and the board that measures it. span: what it moved by."""

    board: str
    name: str
    channel: int
    output: str
    unit: str
    middle: float
    span: float

    @property
    def V_per_unit(self) -> float:
        """Of its sensor."""
        return SHOWN * 3.3 / self.span


@dataclasses.dataclass(frozen=True)
class Unit:
    """What is used of a unit. left_out: a line for each variable without a board."""

    file: pathlib.Path
    inputs: tuple[Actuated, ...]
    outputs: tuple[Measured, ...]
    left_out: tuple[str, ...]

    @property
    def sensor_boards(self) -> list[str]:
        """Names of the boards that measure."""
        return list(dict.fromkeys(each.board for each in self.outputs))


def read(file: pathlib.Path) -> Unit:
    """Read a unit and run it by itself. UserError for one without a real input or output, or with too many."""
    import fmpy  # only here: what a project is made of is known without it

    try:
        description = fmpy.read_model_description(str(file))
    except Exception as error:  # FMPy raises Exception itself for what a description lacks
        raise ModelError(f"{file}: FMPy cannot read it: {' '.join(str(error).split())}") from None
    sides: dict[str, list[Any]] = {"input": [], "output": []}
    left_out = []
    for each in description.modelVariables:
        if each.causality in sides:
            if each.type in REALS and not each.dimensions:
                sides[each.causality].append(each)
            else:
                kind = f"an array of {each.type}" if each.dimensions else each.type
                left_out.append(f"{each.causality} {each.name}: {kind}, and a board has real numbers")
    if not sides["input"] and not sides["output"]:
        raise UserError(f"{file}: no input and no output that is a real number")
    taken = set(WORDS)
    inputs = [actuated(each, board_name(each.name, taken)) for each in sides["input"]]
    boards = len(inputs) + -(-len(sides["output"]) // CHANNELS) + 1
    if boards > MOST_BOARDS:
        raise UserError(
            f"{file}: {len(inputs)} inputs and {len(sides['output'])} outputs need {boards} boards, at most "
            f"{MOST_BOARDS} fit on one bus"
        )
    moved = ranges(file, inputs)
    outputs = []
    names = [board_name(f"SENSE{1 + n}", taken) for n in range(-(-len(sides["output"]) // CHANNELS))]
    for number, each in enumerate(sides["output"]):
        low, high = moved[identifier(each.name)]
        span = high - low if high - low > 1e-9 * max(abs(low), abs(high)) else max(abs(high), 1.0)
        variable, board = board_name(each.name, taken, LONGEST_VALUE), names[number // CHANNELS]
        middle, unit = 0.5 * (low + high), each.unit or "1"
        outputs.append(Measured(board, variable, number % CHANNELS, each.name, unit, middle, span))
    return Unit(file, tuple(inputs), tuple(outputs), tuple(left_out))


def actuated(variable: Any, board: str) -> Actuated:
    """An input within its limits, or between -1 and 1 nominal values where it has none."""
    nominal = abs(float(variable.nominal or 1.0))
    start = float(variable.start or 0.0)
    low = float(variable.min) if variable.min is not None else min(-nominal, start - nominal)
    high = float(variable.max) if variable.max is not None else max(nominal, start + nominal)
    most = max(abs(low), abs(high))
    if not (math.isfinite(most) and low < high):
        raise UserError(f"input {variable.name}: its limits are {low:g} and {high:g}")
    return Actuated(board, variable.name, variable.unit or "1", min(high, max(low, start)), low, high, most)


def ranges(file: pathlib.Path, inputs: list[Actuated]) -> dict[str, tuple[float, float]]:
    """(least, largest) of each output, by name as a quantity, while the inputs move as the main board moves them."""
    from ranger_sim.harness.bodies.fmu_body import STEP_NS, FmuBody

    body = FmuBody(file, Mapping([Input(each.variable, each.most, each.low, each.high) for each in inputs]))
    row = [0.0] * len(body.sample_names)
    low, high = [math.inf] * len(row), [-math.inf] * len(row)
    for step in range(SECONDS * 1_000_000_000 // STEP_NS):
        slow, fast = (math.cos(2.0 * math.pi * hz * step * STEP_NS * 1e-9) for hz in FREQUENCIES_HZ)
        share = 0.35 * (1.0 - slow) + 0.15 * (1.0 - fast)
        for each, bridge in zip(inputs, body.bridges, strict=True):
            bridge.duty = (each.start + each.reach * share) / each.most
        body.step()
        if body.fell:
            break
        body.fill_sample(row)
        low, high = (
            [min(pair) for pair in zip(low, row, strict=True)],
            [max(pair) for pair in zip(high, row, strict=True)],
        )
    found = {name: ends for name, *ends in zip(body.sample_names, low, high, strict=True)}
    wrong = [name for name, ends in found.items() if not all(math.isfinite(each) for each in ends)]
    if wrong:
        raise ModelError(f"{file}: the unit by itself: {body.fall_cause or f'output {wrong[0]} is not a number'}")
    return {name: (ends[0], ends[1]) for name, ends in found.items()}


# --- the project's files --------------------------------------------------------------------------------------------


def files(unit: Unit, name: str) -> dict[str, bytes]:
    """The project's files, {path: content}; `table/generated` is generated from them."""
    period_ms, responses_us, load = schedule(unit)
    boards, sensors = [each.board for each in unit.inputs], unit.sensor_boards
    frames = [f"{each}_TARGET" for each in boards] + [f"{each}_ACTING" for each in boards]
    frames += [each.name for each in unit.outputs]
    words = {
        "name": name,
        "unit": unit.file.name,
        "last_error": "BOARD_SILENT",
        "seconds": str(SECONDS),
        "load": f"{100 * load:.0f}",
        "load_limit": f"{load + 0.05:.2f}",
        "btr": f"0x{timing_register(BIT_RATE):08X}u",
        "period_ms": str(period_ms),
        "run_s": f"{max(0.2, 6 * period_ms * 1e-3):.2f}",
        "age_ms": str(period_ms + CHANNELS * SLOT_US // 1000 + 2),
        "left_out": "".join(f"Left out: {line}.\n\n" for line in unit.left_out),
        "rows": "".join(
            f"| {each.board} | input {each.variable} | {each.low:.6g} to {each.high:.6g} {each.unit} |\n"
            for each in unit.inputs
        )
        + "".join(
            f"| {each.board} | output {each.output} | {each.middle - each.span / 2:.6g} to "
            f"{each.middle + each.span / 2:.6g} {each.unit} |\n"
            for each in unit.outputs
        ),
        "inputs": "".join(
            f'    "{each.board}": Actuator("{folder(each.board)}", {quoted(each.variable)}, {each.most!r}, '
            f"{each.low!r}, {each.high!r}),\n"
            for each in unit.inputs
        ),
        "sensors": "".join(
            f'    "{each.name}": Sensor("{each.board}", {each.channel}, {quoted(each.output)}, '
            f"{quoted(identifier(each.output))}, {quoted(each.unit)}, {each.V_per_unit:.6g}, {each.middle:.6g}, "
            f"{each.span:.6g}),\n"
            for each in unit.outputs
        ),
        "measured": "".join(
            f'    ("{each.name}", {quoted(each.unit)}, {each.V_per_unit:.6g}, {each.middle:.6g}, {each.span:.6g}),\n'
            for each in unit.outputs
        ),
        "folders": ", ".join(f'"{each}": "{folder(each)}"' for each in sensors),
        "jitter": "".join(
            f'    "{frame}": {response + 200},\n' for frame, response in zip(frames, responses_us, strict=True)
        ),
        "band": "".join(f"{identifier(each.output)} = {0.1 * each.span:.6g}\n" for each in unit.outputs),
        "places": ", ".join(f'"{each.board}.{each.name.lower()}"' for each in unit.outputs),
    }
    texts = {each: filled(HERE / "fmu" / f"{each}.j2", words) for each in PLAIN if unit.outputs or each not in SENSING}
    texts["common.h"] = filled(HERE / "mujoco" / "common.h.j2", words)
    texts["conftest.py"] = filled(HERE / "mujoco" / "conftest.py.j2", words)
    texts["main/main.c"] = filled(HERE / "fmu" / "main.c.j2", words | main_words(unit))
    for each in unit.inputs:
        own = {"board": each.board, "folder": each.board.lower(), "variable": each.variable, "measure": each.unit,
               "most": single(each.most)}  # fmt: skip
        texts[f"{folder(each.board)}/{folder(each.board)}.c"] = filled(HERE / "fmu" / "input.c.j2", words | own)
    for board in sensors:
        texts[f"{folder(board)}/{folder(board)}.c"] = filled(
            HERE / "fmu" / "sensor.c.j2", words | sensor_words(unit, board, period_ms)
        )
    for board in ("MAIN", *boards, *sensors):
        place = "main" if board == "MAIN" else folder(board)
        texts[f"{place}/firmware.toml"] = (
            f'[firmware]\nname = "{place}"\ntables = ["{board.lower()}"]\nmaster = "../table"\n'
        )
    texts["table/boards.toml"] = boards_table(unit, name, period_ms)
    texts["table/variables.csv"] = variables_table(unit, period_ms)
    texts["table/errors.csv"] = errors_table(unit)
    return {path: text.encode("utf-8") for path, text in texts.items()} | {unit.file.name: unit.file.read_bytes()}


PLAIN = ("README.md", "input.h", "sensor.h", "machine.py", "sensor_faults.py", "test_machine.py", "campaign.toml")
SENSING = ("campaign.toml",)  # without a sensor there is none to fail


def folder(board: str) -> str:
    """The folder of a board's program."""
    return f"{board.lower()}_board" if board.lower() in FOLDERS else board.lower()


def schedule(unit: Unit) -> tuple[int, list[int], float]:
    """(period in ms, worst response of each frame in us by order of identifiers, load)."""
    count = 2 * len(unit.inputs) + len(unit.outputs)
    for period_ms in PERIODS_MS:
        streams = [bounds.message(str(n), n, period_ms * 1_000_000, 8) for n in range(1, count + 1)]
        load = float(bounds.utilisation(streams, BIT_RATE))
        if load <= MOST_LOAD and max(len(unit.inputs), CHANNELS) < period_ms * 1000 // SLOT_US:
            found = bounds.response_times(streams, BIT_RATE)
            return period_ms, [(each.response_ns or 0) // 1000 for each in found], load
    raise UserError(f"{unit.file}: {count} frames do not fit on a bus of {BIT_RATE} bit/s")


def main_words(unit: Unit) -> dict[str, str]:
    """What the main board's program has for its boards."""
    inputs, boards = unit.inputs, len(unit.inputs) + len(unit.sensor_boards)
    phases = [2.0 * math.pi * hz * SLOT_US * 1e-6 for hz in FREQUENCIES_HZ]
    firsts = [next(each.name for each in unit.outputs if each.board == board) for board in unit.sensor_boards]
    return {
        "boards": str(boards),
        "ids": ", ".join([f"{each.board}_ACTING" for each in inputs] + firsts),
        "senders": "".join(
            f"static int32_t send_{k}(void)\n{{\n    send({each.board}_TARGET, word_of({single(each.start)}f + "
            f"{single(each.reach)}f * share));\n    return 0;\n}}\n\n"
            for k, each in enumerate(inputs)
        ),
        "tasks": "\n".join(
            f'static const fw_task row{k}[] = {{{{send_{k}, "{each.board}_TARGET", 300, 450}}}};'
            for k, each in enumerate(inputs)
        ),
        "rows": "".join(f"    [{k}] = FW_TASKS(row{k}),\n" for k in range(len(inputs))) or "    {0},\n",
        "watch_cost": str(100 + 40 * boards),
        "watch_limit": str(150 + 60 * boards),
        "slow_hz": f"{FREQUENCIES_HZ[0]:g}",
        "fast_hz": f"{FREQUENCIES_HZ[1]:g}",
        "slow_cosine": single(math.cos(phases[0])),
        "slow_sine": single(math.sin(phases[0])),
        "fast_cosine": single(math.cos(phases[1])),
        "fast_sine": single(math.sin(phases[1])),
    }


def sensor_words(unit: Unit, board: str, period_ms: int) -> dict[str, str]:
    """What the program of a board with sensors has."""
    own = [each for each in unit.outputs if each.board == board]
    return {
        "board": board,
        "folder": board.lower(),
        "count": str(len(own)),
        "sensors": "".join(
            f"    {{{single(each.V_per_unit)}f, {single(each.middle)}f}}, /* {each.output}: V per unit, "
            f"{each.unit} */\n"
            for each in own
        ),
        "senders": "".join(
            f"static int32_t send_{each.channel}(void)\n{{\n    send({each.name}, word_of(values[{each.channel}]));\n"
            "    return 0;\n}\n\n"
            for each in own
        ),
        "tasks": "\n".join(
            f'static const fw_task row{each.channel}[] = {{{{send_{each.channel}, "{each.name}", 260, 400}}}};'
            for each in own
        ),
        "rows": "".join(f"    [{each.channel}] = FW_TASKS(row{each.channel}),\n" for each in own),
    }


def boards_table(unit: Unit, name: str, period_ms: int) -> str:
    """boards.toml."""
    count = period_ms * 1000 // SLOT_US
    lines = [
        f"# The boards of {name}, their bus, and what each board's schedule sends. All names are of variables.csv.",
        "",
        "[buses]",
        f"CAN1 = {{ channel = 1, bit_rate = {BIT_RATE:_} }}",
    ]

    def rows_of(sent: list[str]) -> list[list[str]]:
        return [[each] for each in sent] + [[] for _ in range(count - len(sent))]

    main = rows_of([f"{each.board}_TARGET" for each in unit.inputs])
    boards = [("MAIN", "main board: what each input is to be, and supervision", main)]
    boards += [(each.board, f"input {each.variable}", rows_of([f"{each.board}_ACTING"])) for each in unit.inputs]
    for board in unit.sensor_boards:
        own = [each for each in unit.outputs if each.board == board]
        boards.append(
            (board, "sensors of " + ", ".join(each.output for each in own), rows_of([each.name for each in own]))
        )
    for number, (board, description, rows) in enumerate(boards, 1):
        lines += [
            "",
            f"[boards.{board}]",
            f"number = {number}",
            f"description = {quoted(description)}",
            'processor = "LPC2194"',
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


def variables_table(unit: Unit, period_ms: int) -> str:
    """variables.csv: errors first, then what the inputs need, which then wins the bus over what is reported."""
    boards = [*(each.board for each in unit.inputs), *unit.sensor_boards]
    out = ["id,name,type,unit,initial,publisher,subscribers,bus,period_ms,minimum,maximum,description"]
    waiting = '"waiting error: code bits 0-15, board 16-21, count 22-31; sent only while one waits"'
    for number, board in enumerate(["MAIN", *boards], 1):
        others = ";".join(boards) if board == "MAIN" else "MAIN"
        out.append(f"{number},ERROR_{board},u32,,0,{board},{others},CAN1,{2 * period_ms},,,{waiting}")

    def row(number: int, name: str, unit_of: str, publisher: str, subscriber: str, about: str) -> str:
        text = about.replace('"', "'")
        return f'{number},{name},f32,"{unit_of}",0,{publisher},{subscriber},CAN1,{period_ms},,,"{text}"'

    for k, each in enumerate(unit.inputs):
        about = f"what input {each.variable} is to be"
        out.append(row(FIRST_TARGET + k, f"{each.board}_TARGET", each.unit, "MAIN", each.board, about))
    for k, each in enumerate(unit.inputs):
        about = f"what input {each.variable} is set to"
        out.append(row(FIRST_ACTING + k, f"{each.board}_ACTING", each.unit, each.board, "MAIN", about))
    for k, one in enumerate(unit.outputs):
        out.append(row(FIRST_VALUE + k, one.name, one.unit, one.board, "MAIN", f"output {one.output} as measured"))
    return "\n".join(out) + "\n"


def errors_table(unit: Unit) -> str:
    """errors.csv."""
    inputs, sensors = ";".join(each.board for each in unit.inputs), ";".join(unit.sensor_boards)
    every = ";".join(each for each in ("MAIN", inputs, sensors) if each)
    return (
        "id,name,boards,normal_per_s,normal_at_start,description\n"
        f"0,DEFAULT,{every},,,nothing wrong\n"
        f"1,TARGET_LOST,{inputs or 'MAIN'},,,no target for five periods: the input is 0 until one comes\n"
        f"2,SENSOR_OUT,{sensors or 'MAIN'},,,a sensor's voltage is within 50 mV of an end of the converter\n"
        "3,BOARD_SILENT,MAIN,,,no frame of a board for five periods\n"
    )
