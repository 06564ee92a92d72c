"""Sound recordings of every experiment, and ways to spoil them: `python -m tests.sysid.corruptions --log FILE.jsonl`.

What nobody should believe must end in a line, a finding or an abstention: never in a traceback, never in the name of a
cause. Each line of the log is one diagnosis; a log that is there is gone on with. The rules that this found are held by
test_plausibility.py and test_sanity.py; some hundred diagnoses are too many for the suite.
"""

import argparse
import collections
import io
import json
import math
import pathlib
import sys
import tempfile

import numpy as np

from ranger_sim import diagnose
from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.benches.ankle_sine import ankle_sine
from ranger_sim.sysid.benches.motor_run import motor_run
from ranger_sim.sysid.channels import named_for
from ranger_sim.tools.cli import main as command_line
from ranger_sim.tools.recordings import datasets

Columns = dict[str, np.ndarray]
# What each unit is mistaken for: (what the column is in, its number for 1 of ours)
OTHER_UNITS = {
    "_A": (("mA", 1e3), ("10 mA", 100.0)),
    "_V": (("mV", 1e3), ("share of 12 V", 1.0 / 12.0)),
    "_rad_per_s": (("rpm", 30.0 / math.pi), ("deg/s", 180.0 / math.pi), ("turns/s", 0.5 / math.pi)),
    "_Nm": (("lbf in", 8.8507), ("N cm", 100.0), ("ozf in", 141.61), ("kgf cm", 10.197), ("lbf ft", 0.73756)),
    "_rad": (("deg", 180.0 / math.pi), ("turns", 0.5 / math.pi)),
    "_m": (("mm", 1e3), ("cm", 100.0), ("inches", 39.37)),
}
EXPERIMENTS = ("motor-bench", "leg-swing", "positioning", "ankle", "walk")


def sound(experiment: str) -> Columns:
    """A recording without any effect, t_s first."""
    if experiment == "motor-bench":
        return _columns(motor_run(seed=1, seconds=5.0))
    if experiment == "ankle":
        data = named_for(ankle_sine(seed=3, seconds=3.0), "ankle")
        wanted = ("joint_angle_rad", "motor_angle_rad", "joint_rate_rad_per_s", "target_angle_rad",
                  "target_rate_rad_per_s")  # fmt: skip
        return _columns(data, [name for name in wanted if name in data])
    if experiment == "leg-swing":
        from tests.sysid.test_leg_swing_machine import swing

        table = swing(1)
        return {"t_s": table.time_s[:2500], **{name: each[:2500] for name, each in table.columns.items()}}
    if experiment == "positioning":
        return _carriage()
    return _walk()


def _columns(data, names=None) -> Columns:
    table = data.table(list(names or data.channels))
    return {"t_s": table.time_s, **table.columns}


def _carriage() -> Columns:
    """A mass with viscous and constant friction under a position controller, by steps of 0.1 ms."""
    step, every, count = 1e-4, 10, 6000
    x = v = 0.0
    rows = np.zeros((count, 3))
    noise = generator(1, "carriage").normal(size=(2, count))
    for number in range(count * every):
        t = number * step
        goal = 0.1 * math.sin(1.5 * t) + 0.02 * math.sin(5.0 * t)
        rate = 0.15 * math.cos(1.5 * t) + 0.1 * math.cos(5.0 * t)
        volts = 160.0 * (goal - x) + 20.0 * (rate - v)
        if number % every == 0:
            rows[number // every] = t, x, volts
        free = v + step / 95.1 * (35.15 * volts - 203.5 * v)
        v = math.copysign(max(abs(free) - step / 95.1 * 20.39, 0.0), free)
        x += step * v
    position = rows[:, 1] + 1e-6 * noise[0]
    return {"t_s": rows[:, 0], "position_m": position, "voltage_V": rows[:, 2] + 0.01 * noise[1]}


def _walk() -> Columns:
    """A short walk of the emulated robot, its channels on one time base of 4 ms."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "run"
        command_line(["walk", "--steps", "14", "--seed", "4", "--log", "full", "--out", str(out)])
        data = named_for(datasets.open_recording(out), "walk")
    wanted = [
        "hip_angle_rad",
        "hip_rate_rad_per_s",
        "outer_ankle_angle_rad",
        "inner_ankle_angle_rad",
        "outer_leg_rate_rad_per_s",
        "hip_current_A",
        "outer_contact",
        "inner_contact",
    ]
    there = [name for name in wanted if name in data]
    begin = max(float(data[name].time_s[0]) for name in there)
    end = min(float(data[name].time_s[-1]) for name in there)
    time_s = np.arange(begin, end, 0.004)
    made = {name: np.interp(time_s, data[name].time_s, data[name].value) for name in there}
    return {"t_s": time_s, **{name: np.round(each) if "contact" in name else each for name, each in made.items()}}


# --- what spoils ----------------------------------------------------------------------------------------------


def corruptions(good: Columns) -> dict[str, Columns]:
    """{name: a spoiled copy}: at least forty of every recording, all of what nobody should believe."""
    made: dict[str, Columns] = {}
    names = [name for name in good if name != "t_s"]
    size = len(good["t_s"])
    random = generator(7, "corruptions")

    def put(name: str, **changed: np.ndarray) -> None:
        made[name] = {**good, **changed}

    for name in names:
        ending = next((each for each in ("_rad_per_s", "_rad", "_Nm", "_A", "_V", "_m") if name.endswith(each)), "")
        for unit, factor in OTHER_UNITS.get(ending, ()):
            put(f"{name} in {unit}", **{name: factor * good[name]})
    for name in names:
        value = good[name]
        spread = float(np.std(value)) or 1.0
        put(f"{name} is white noise", **{name: spread * random.normal(size=size)})
        put(f"{name} wanders", **{name: spread * np.cumsum(random.normal(size=size)) / math.sqrt(size)})
        put(f"{name} backwards", **{name: value[::-1].copy()})
        put(f"{name} of another second", **{name: np.roll(value, size // 4)})
        put(f"{name} turned round", **{name: -value})
    for first, second in zip(names, names[1:], strict=False):
        put(f"{first} and {second} in each other's column", **{first: good[second], second: good[first]})
    for name in names[:3]:
        value = good[name]
        frozen = value.copy()
        frozen[size // 3 : 2 * size // 3] = frozen[size // 3]
        put(f"{name} stands still for a third", **{name: frozen})
        put(f"{name} without its sign", **{name: np.abs(value)})
        put(f"{name} in five steps", **{name: np.round(value / np.ptp(value) * 5.0) / 5.0 * np.ptp(value)})
        put(f"{name} far off zero", **{name: value + 1e6})
        put(f"{name} next to nothing", **{name: value * 1e-200})
        holes = value.copy()
        holes[random.random(size) < 0.3] = math.nan
        put(f"{name} with holes", **{name: holes})
        spoiled = value.copy()
        spoiled[::37] = 1e9
        put(f"{name} with spikes", **{name: spoiled})
    t = good["t_s"]
    put("stamps in ms", t_s=1e3 * t)
    put("stamps in minutes", t_s=t / 60.0)
    put("stamps in us", t_s=1e6 * t)
    put("stamps of chance", t_s=np.sort(t[0] + (t[-1] - t[0]) * random.random(size)))
    put("stamps to 20 ms", t_s=np.floor(t / 0.02) * 0.02)
    middle = t[size // 2]
    put("stamps twice as fast from the middle on", t_s=np.where(t < middle, t, middle + 0.5 * (t - middle)))
    made["rows in disorder"] = {name: each[random.permutation(size)] for name, each in good.items()}
    shuffled = random.permutation(size)
    made["values in disorder"] = {"t_s": t, **{name: good[name][shuffled] for name in names}}
    made["all noise"] = {"t_s": t, **{name: random.normal(size=size) for name in names}}
    made["all wander"] = {"t_s": t, **{name: np.cumsum(random.normal(size=size)) for name in names}}
    made["all the same"] = {"t_s": t, **{name: good[names[0]] for name in names}}
    kept = np.sort(random.permutation(size)[: size // 2])
    made["half of the rows lost"] = {name: each[kept] for name, each in good.items()}
    return made


# --- what comes of it -----------------------------------------------------------------------------------------


def diagnosed(columns: Columns, experiment: str, path: pathlib.Path) -> dict:
    """{"outcome", ...} of a file with these columns: refused, doubted, abstained, named, nothing; or traceback."""
    out = io.StringIO()
    np.savetxt(out, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="",
               fmt="%.9g")  # fmt: skip
    path.write_text(out.getvalue(), encoding="utf-8")
    try:
        answer = diagnose(path, experiment).to_dict()
    except UserError as error:
        return {"outcome": "refused", "text": str(error).replace(str(path), path.name)}
    except Exception as error:  # that is what is looked for
        return {"outcome": "traceback", "text": f"{type(error).__name__}: {error}"}
    json.dumps(answer, allow_nan=False)
    findings = [each for each in answer["data_findings"] if each["severity"] != "note"]
    told = "; ".join(f"{each['channel']}: {each['kind']}: {each['text']}" for each in findings)
    causes = [f"{each['name']} at {each['at']}" for each in answer["causes"]]
    if causes:
        outcome = "named, with a finding" if findings else "named"
    elif answer["detected"]:
        outcome = "abstained, with a finding" if findings else "abstained"
    else:
        outcome = "nothing, with a finding" if findings else "nothing"
    return {"outcome": outcome, "causes": causes, "text": told}


def main(arguments=None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.sysid.corruptions", description=__doc__.splitlines()[0])
    parser.add_argument("--log", type=pathlib.Path, required=True)
    parser.add_argument("--experiment", choices=EXPERIMENTS, action="append")
    parser.add_argument("--only", default="", help="corruptions with this in their name")
    options = parser.parse_args(arguments)
    lines = options.log.read_text(encoding="utf-8").splitlines() if options.log.exists() else []
    known = {(each["experiment"], each["corruption"]): each for each in map(json.loads, lines)}
    with tempfile.TemporaryDirectory() as folder:
        for experiment in options.experiment or EXPERIMENTS:
            good = sound(experiment)
            for name, columns in {"nothing": good, **corruptions(good)}.items():
                if (experiment, name) in known or options.only not in name:
                    continue
                found = diagnosed(columns, experiment, pathlib.Path(folder) / "spoiled.csv")
                known[experiment, name] = {"experiment": experiment, "corruption": name, **found}
                with options.log.open("a", encoding="utf-8") as log:
                    log.write(json.dumps(known[experiment, name]) + "\n")
    for experiment in EXPERIMENTS:
        count = collections.Counter(each["outcome"] for key, each in known.items() if key[0] == experiment)
        told = ", ".join(f"{each} {number}" for each, number in count.most_common())
        print(f"{experiment:12s} {sum(count.values()):4d}  {told}")


if __name__ == "__main__":
    sys.exit(main())
