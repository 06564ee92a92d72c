"""What the diagnosis answers to a case of the matrix."""

from ranger_sim.foundation.user_error import UserError
from ranger_sim.foundation.wallclock import process_cpu_s
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machines import made
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.matrix import belt_axis
from tests.sysid.matrix.bodies import HIDDEN
from tests.sysid.matrix.cases import recordings
from tests.sysid.matrix.cells import Cell

EXPERIMENTS = {"bench": "motor-bench", "leg": "leg-swing", "ankle": "ankle", "positioning": "positioning"}


def machine_of(cell):
    """As a user would take it; of the belt axis also that its input is held, where it is."""
    if cell.machine == "axis":
        return belt_axis.HeldBeltAxis() if cell.sampling == "held" else belt_axis.BeltAxis()
    return made(EXPERIMENTS[cell.machine])()


def table(columns, name):
    times = columns["t_s"]
    return Table(
        times, {each: values for each, values in columns.items() if each != "t_s"}, (slice(0, len(times)),), name
    )


def answer(levels, seed, name="", strength=0.0):
    """A plain record of one case. levels: of the cell, in their order."""
    cell = Cell(*levels)
    before = process_cpu_s()
    run, other, size, numbers = recordings(cell, seed, name, strength)
    generated = process_cpu_s()
    record = {"cell": cell.name, "seed": seed, "hidden": name, "strength": strength, "size": size, "refused": ""}
    try:
        result = diagnose(machine_of(cell), [table(run, "a")], [table(other, "b")]).result
    except UserError as error:
        record |= {"refused": str(error), "right": False, "tied": False}
        return record | {"detected": True, "causes": [], "bic": 0.0, "cpu_s": process_cpu_s() - generated}
    record |= {"detected": result.detected, "causes": [f"{each.name} at {each.at}" for each in result.causes]}
    seen = result.evidence
    record |= {"unexplained": bool(seen.above_noise_floor or seen.learnable or seen.impossible)}  # exit code 3
    floors = (seen.noise_floor or {}).values()
    record |= {"times_floor": max((each.left / each.channel for each in floors), default=0.0)}
    record |= {"bic": result.causes[0].evidence.bic if result.causes else 0.0}
    errors = result.evidence.held_out_errors or {}
    record |= {"errors": {each: [value.before, value.after, value.black_box] for each, value in errors.items()}}
    record |= {"generated_s": generated - before, "cpu_s": process_cpu_s() - generated}
    if name:
        hidden = HIDDEN[cell.machine][name]
        first = next(iter(result.causes), None)
        record["right"] = first is not None and first.name in hidden.names
        tied = first is not None and any(each.split(" at ")[0] in hidden.names for each in first.tied_with)
        record["tied"] = not record["right"] and tied
        if record["right"] and hidden.coefficient in first.parameters:
            value = first.parameters[hidden.coefficient]
            record |= {"value": value.value, "ci95": list(value.ci95)}
            record |= {"inside": value.ci95[0] <= hidden.factor(numbers) * size <= value.ci95[1]}
    return record
