"""Records made by hand: two seconds of a walk with a step every 0.5 s, on which a test changes one thing."""

import numpy as np

from ranger_sim.datatable.generated import all_variables
from ranger_sim.harness.faults.error_rows import StateWord
from ranger_sim.harness.faults.evidence import Record
from ranger_sim.plant.ranger import SAMPLES
from ranger_sim.ranger.conditions import STATE_VARIABLES
from ranger_sim.ranger.names import RANGER

MS = 1_000_000
BOARDS = ["MCH", "MCFO", "MB"]
MACHINES = {
    machine: StateWord(all_variables.ID_OF[variable], {0: "wait", 1: "swing", 2: "hold"})
    for machine, variable in STATE_VARIABLES.items()
}
COLUMN = {name: place for place, name in enumerate(SAMPLES, start=1)}  # of `Record.samples`
STEP_MS = 500


def record(until_ms=2000):
    """A walk from 0 to `until_ms`: 0.35 m a step, 10 W in the hip, the hip's machine in turn in states 0 and 1."""
    times = np.arange(0, until_ms, 2)
    samples = np.zeros((len(times), 1 + len(COLUMN)))
    samples[:, 0] = times * 1e-3
    samples[:, COLUMN["steps"]] = times // STEP_MS
    samples[:, COLUMN["hip_x_m"]] = times / STEP_MS * 0.35
    samples[:, COLUMN["hip_W"]] = 10.0
    samples[:, COLUMN["battery_V"]] = 25.0
    words = np.zeros((len(times), 1 + all_variables.TABLE_SIZE), dtype=np.int64)
    words[:, 0] = times * MS
    words[:, word("hip")] = times // STEP_MS % 2
    return Record(
        begin_ns=0,
        end_ns=until_ms * MS,
        frames={"can1": frames(range(5, until_ms, 10)), "can2": frames(range(7, until_ms, 10))},
        samples=samples,
        words=words,
        errors=np.zeros((0, 4), dtype=np.int64),
        boards=BOARDS,
        names=RANGER,
        quantities=tuple(SAMPLES),
        machines=MACHINES,
        memory="MB",
    )


def word(machine):
    """The column of a machine's state."""
    return 1 + all_variables.ID_OF[STATE_VARIABLES[machine]]


def frames(times_ms, identifier=all_variables.ID_OF["MCH_ANGLE"], value=0):
    """Rows of a bus: one frame per time."""
    return np.array([[ms * MS, value << 12 | 8 << 4, identifier] for ms in times_ms], dtype=np.int64).reshape(-1, 3)


def errors(*rows):
    """Rows of errors: (ms, board, code, how many)."""
    listed = [[round(ms * MS), BOARDS.index(board), code, count] for ms, board, code, count in sorted(rows)]
    return np.array(listed, dtype=np.int64).reshape(-1, 4)
