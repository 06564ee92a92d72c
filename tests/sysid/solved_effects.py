"""Hidden effects of three machines that scipy solves, found by machines written from the documentation.

    python -m tests.sysid.solved_effects --out solved.json --seeds 10
    python -m tests.sysid.solved_effects --out solved.json

Each recording is a file, and is read as such. Sizes are 4 and 25 times the smallest visible one, which the truth's own
sensitivities give (`solved_machines.visible`). Answers are kept in the file one by one, and the same command goes on
where a run was interrupted; without --seeds it prints the table.
"""

import argparse
import collections
import dataclasses
import json
import pathlib
import statistics
import sys
import tempfile
from collections.abc import Mapping

from ranger_sim.foundation.user_error import UserError
from ranger_sim.foundation.wallclock import process_cpu_s
from ranger_sim.sysid.api import diagnose
from tests.sysid import solved_machines
from tests.sysid.machines_of_a_user import Battery, LoggedJoint, LoggedStand
from tests.sysid.matrix.__main__ import save

STRENGTHS = (4.0, 25.0)
PROGRAMS = {"thrust stand": LoggedStand, "battery": Battery, "elastic joint": LoggedJoint}


@dataclasses.dataclass(frozen=True)
class Name:
    """names: causes that are right, with their place; coefficient: whose true value is `per` times the hidden size."""

    names: tuple[tuple[str, str], ...]
    coefficient: str
    per: float


RIGHT: Mapping[tuple[str, str], Name] = {
    ("thrust stand", "heating"): Name((("resistance_heating", "winding"),), "ohm_per_A2", 0.01),
    ("thrust stand", "dry bearing"): Name((("coulomb_friction", "w"), ("direction_friction", "w")), "", 1.0),
    # the same line in time as a drift of the voltage
    ("battery", "leak"): Name((("input_offset", "i"), ("sensor_drift", "voltage_V")), "", 1.0),
    ("battery", "resistance grows"): Name((("resistance_growth", "cell"),), "ohm_per_s", 1.0),
    ("elastic joint", "gravity"): Name((("once_per_turn", "link_rate"),), "sine_torque", -1.0),
    ("elastic joint", "gear stiffens"): Name((("stiffening", "gear"),), "Nm_per_rad3", 1.0),
}


def true_value(machine, effect, seed, size):
    """The value that the diagnosis should find."""
    per = RIGHT[machine.name, effect].per
    base = machine.drawn((seed, "a"))[0]
    return per * size * (base["R"] if effect == "heating" else 1.0)


def answer(machine, effect, size, seed):
    """A record of one case."""
    with tempfile.TemporaryDirectory() as folder:
        runs = [machine.write(pathlib.Path(folder, f"{run}.csv"), seed, run, effect, size) for run in "ab"]
        before = process_cpu_s()
        try:
            found = diagnose(runs[0], PROGRAMS[machine.name](), holdout=[runs[1]])
        except UserError as error:
            return {"refused": str(error), "seconds": process_cpu_s() - before}
    record = {"seconds": process_cpu_s() - before, "detected": found.detected}
    record["causes"] = [f"{each.name} at {each.at}" for each in found.causes]
    errors = (found.evidence.held_out_errors or {}).values()
    together = lambda name: sum((getattr(each, name) or each.before) ** 2 for each in errors) ** 0.5  # noqa: E731
    record |= {name: together(name) for name in ("before", "after", "black_box")}
    right = RIGHT.get((machine.name, effect))
    first = found.causes[0] if found.causes else None
    record["right"] = right is not None and first is not None and (first.name, first.at) in right.names
    if record["right"]:
        coefficient = right.coefficient or next(iter(first.parameters))
        value = first.parameters[coefficient]
        record |= {"value": value.value, "ci95": value.ci95}
        if first.name != "sensor_drift":
            record["true"] = true_value(machine, effect, seed, size)
    return record


def wanted(first, seeds, only, sizes):
    """{key: arguments of `answer`}, the first seed of everything before any second."""
    found = {}
    for seed in range(first, first + seeds):
        for machine in solved_machines.ALL:
            cases = {f"{machine.name} | nothing": ("", 0.0)}
            for effect in machine.effects:
                for strength in STRENGTHS:
                    unit = sizes.get(f"{machine.name} | {effect}", 0.0)
                    cases[f"{machine.name} | {effect} | {strength:g}"] = (effect, strength * unit)
            for title, case in cases.items():
                if only in title:
                    found[f"{title} | {seed}"] = (machine, *case, seed)
    return found


def rows(answers):
    """Lines of the table, from the records by key."""
    groups = collections.defaultdict(list)
    for key, record in answers.items():
        groups[key.rpartition(" | ")[0]].append(record)
    yield "| machine | hidden | strength | named first | interval holds | error before, after, black box | seconds |"
    yield "|---" * 7 + "|"
    for title, records in sorted(groups.items()):
        machine, effect, *strength = title.split(" | ")
        answered = [each for each in records if "refused" not in each]
        if strength:
            named = f"{sum(each['right'] for each in answered)} of {len(records)}"
        else:
            named = f"{sum(each.get('detected', True) for each in records)} alarms in {len(records)}"
        held = [each["ci95"][0] <= each["true"] <= each["ci95"][1] for each in answered if "true" in each]
        errors = [
            f"{statistics.median(each[name] for each in answered):.2%}" for name in ("before", "after", "black_box")
        ] if answered and strength else []  # fmt: skip
        seconds = statistics.median(each["seconds"] for each in records)
        yield (
            f"| {machine} | {effect} | {''.join(strength)} | {named} | {f'{sum(held)} of {len(held)}' if held else ''} "
            f"| {', '.join(errors)} | {seconds:.1f} |"
        )


def main(arguments=None):
    options = argparse.ArgumentParser(
        prog="python -m tests.sysid.solved_effects",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    options.add_argument("--out", type=pathlib.Path, required=True, help="file of the answers")
    options.add_argument("--seeds", type=int, default=0, help="of each case")
    options.add_argument("--first", type=int, default=1, help="first seed")
    options.add_argument("--only", default="", help="cases with this in their title")
    given = options.parse_args(arguments)
    kept = {"sizes": {}, "answers": {}}
    if given.out.exists():
        kept = json.loads(given.out.read_text(encoding="utf-8"))
    for machine in solved_machines.ALL if given.seeds else ():
        for effect in machine.effects:
            key = f"{machine.name} | {effect}"
            if key not in kept["sizes"] and given.only in f"{key} | ":
                kept["sizes"][key] = machine.visible(effect)
                save(given.out, kept)
                sys.stdout.write(f"{key}: smallest visible {kept['sizes'][key]:.4g}\n")
    for key, case in wanted(given.first, given.seeds, given.only, kept["sizes"]).items():
        if key not in kept["answers"]:
            kept["answers"][key] = answer(*case)
            save(given.out, kept)
            found = kept["answers"][key]
            sys.stdout.write(f"{key}: {found.get('refused') or ' + '.join(found['causes']) or found['detected']}\n")
            sys.stdout.flush()
    sys.stdout.write("\n".join(rows(kept["answers"])) + "\n")


if __name__ == "__main__":
    main()
