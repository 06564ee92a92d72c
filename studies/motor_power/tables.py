"""The tables, as Markdown."""

import math
import pathlib
from collections.abc import Iterable, Sequence

import numpy as np

from ranger_sim.foundation.user_error import DataError
from ranger_sim.plant import body_files
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.machines import motor_stage
from ranger_sim.sysid.machines.motor_stage import MOTORS, Holds, Stage
from studies.motor_power.drives import Drive, drawn

# Board, current in A, battery in V, power in W: means over moments at which current and power did not change, from
# all logs of 2015 by another program than the diagnosis (docs/robot.md T5).
READINGS = (
    ("MCH", 0.0, 25.5, 0.117),
    ("MCFO", 0.0, 25.5, 0.147),
    ("MCFI", 0.0, 25.5, 0.085),
    ("MCFI", 0.16, 25.5, 0.208),
    ("MCFO", 0.23, 25.5, 0.301),
    ("MCH", 0.43, 22.6, 0.771),
    ("MCH", 2.09, 25.5, 7.16),
    ("MCFO", 0.69, 25.5, 0.851),
    ("MCFI", 0.71, 25.5, 0.836),
)
BEFORE_W, BEFORE_OHM, BEFORE_V = 0.3, 1.358, 0.7  # at 30 V: the emulator's law before these logs
ROWS = ("gates", "switching", "R", "V_c", "factor", "lag", "current_zero")
IN_THOUSANDTHS = ("gates", "lag", "current_zero")
MOVING_S = 20.0  # of an emulated drive


def opened(paths: Iterable[pathlib.Path]) -> list[Dataset]:
    """The logs. DataError for a table of another form."""
    found = []
    for path in paths:
        data = motor_stage.read_long(path)
        if data is None:
            raise DataError(f"{path}: not a table of t_ms, variable, value")
        found.append(data)
    return found


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def found_in(data: Sequence[Dataset], body: str, held: Sequence[Dataset] = ()) -> dict[str, Stage]:
    """The stages of these logs next to a body."""
    return motor_stage.diagnose(data, held, body_files.load(body)).stages


def boards(data: Sequence[Dataset]) -> str:
    """What is found of each board, next to the appendix."""
    stages = found_in(data, "appendix")
    rows = [["holds, with a current", *(f"{each.holds}, {each.holds_with_current}" for each in stages.values()), ""]]
    for name in ROWS:
        values = [each.values.get(name) for each in stages.values()]
        known = next((each for each in values if each is not None), None)
        if known is None:
            continue
        digits = 3 if name in IN_THOUSANDTHS else 2
        cells = [
            "" if each is None else f"{each.value:.{digits}f} ({each.low:.{digits}f} to {each.high:.{digits}f})"
            for each in values
        ]
        simulated = "" if known.simulated is None else f"{known.simulated:.{digits}f}"
        rows.append([f"{name}, {known.unit}", *cells, simulated])
    return table(["", *stages, "appendix"], rows)


def power(stage_values: dict[str, float], motor: MotorParameters | None, amps: float, volts: float) -> float:
    """Power of a stage that is held, W."""
    size, voltage = np.array([amps]), np.array([volts])
    hold = Holds(np.zeros(1), size, size**2, voltage, size > 0.0, size)
    return float(motor_stage.law(hold, stage_values, motor)[0])


def readings(data: Sequence[Dataset]) -> str:
    """The readings that are known otherwise, next to what is found, to the body and to the law before."""
    stages, body = found_in(data, "ranger"), body_files.load("ranger")
    rows = []
    for board, amps, volts, watts in READINGS:
        motor: MotorParameters = getattr(body.electrics, MOTORS[board])
        own = {name: each.value for name, each in stages[board].values.items()}
        now = power(own, motor, amps, volts)
        has = power(motor_stage.simulated_of(motor), motor, amps, volts)
        before = BEFORE_W * volts / 30.0 + BEFORE_OHM * amps**2 + BEFORE_V * amps
        rows.append([f"{board} {amps:.2f} A, {volts} V", *(f"{each:.3f}" for each in (watts, now, has, before))])
    return table(["board, current", "robot", "found", "body `ranger`", "before"], rows)


def predictions(data: Sequence[Dataset]) -> str:
    """Errors in W where every second log predicts the holds of the others."""
    some, others = data[::2], data[1::2]
    if not others:
        return "One log alone predicts nothing."
    by_body = found_in(some, "ranger", others)
    rows = [
        [name, str(each.held_out_holds), *map(watts, (each.held_out_after_W, each.held_out_before_W)),
         watts(by_body[name].held_out_before_W)]
        for name, each in found_in(some, "appendix", others).items()
    ]  # fmt: skip
    return table(["board", "held-out holds", "found", "appendix", "body `ranger`"], rows)


def watts(value: float) -> str:
    """A power; empty where it is not known."""
    return "" if math.isnan(value) else f"{value:.2f}"


def coverage(first: int, count: int) -> str:
    """How often the intervals of emulated drives hold what was drawn, and how often a sound one is called different."""
    held: dict[str, list[bool]] = {}
    alarms = 0
    for seed in range(first, first + count):
        motor = drawn(seed)
        sampled = motor_stage.samples(Drive(motor, seed).record(moving_s=MOVING_S), "MCFO")
        assert sampled is not None
        stage = motor_stage.stage("MCFO", [sampled], motor)
        truth = motor_stage.simulated_of(motor)
        for name, value in stage.values.items():
            if name in truth:
                held.setdefault(name, []).append(value.low <= truth[name] <= value.high)
        alarms += any(value.differs for value in stage.values.values())
    rows = [[name, f"{sum(each)} of {len(each)}", f"{np.mean(each):.1%}"] for name, each in held.items()]
    rows.append(["false alarms", f"{alarms} of {count}", f"{alarms / count:.1%}"])
    return table(["", "intervals that hold", ""], rows)
