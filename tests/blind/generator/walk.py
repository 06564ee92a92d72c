"""Whole walks of the emulated robot, as its own main brain logged them, with something wrong in the body or a sensor.

The robot is the emulator itself, run as a user runs it: `ranger-sim walk` with a body file, a model file, a seed and a
battery, in a separate process. From its record only what the main brain knew is taken (never the plant's own values):
filtered and rounded by the boards, delayed by the buses. That is logged as RoboDAQ does, every 6 ms the latest value of
each variable, with single rows and silences of 50 to 180 ms missing.

Nothing here knows how the body works: strength is measured, by what a walk with the effect does otherwise than the same
walk without it, and by what shifts of the base parameters do.
"""

import concurrent.futures
import dataclasses
import json
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Callable

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from tests.blind.generator.experiment import STRENGTHS, SUBSYSTEM, Experiment
from tests.blind.generator.strength import UNIT

ROW_S = 0.006  # of the real robot's log of August 2015
LOST_ROW, SILENCE_EVERY_S, SILENCE_S = 0.004, 3.7, (0.050, 0.180)  # its missing rows and silences
SETTLED = 4  # strides that are not counted for the strength: the start dies away
FEWEST_STRIDES = 6
SEEDS = 4  # sound walks, for how far walks are apart by themselves
JOBS = 2  # walks at once
TANGENT_RANK = 1e-3
# What the main brain has, by the names of the robot's table: (name, sign).
VARIABLES = {
    "hip_angle_rad": ("MCH_ANGLE", 1.0),
    "hip_rate_rad_per_s": ("MCH_ANG_RATE", 1.0),
    "hip_motor_angle_rad": ("MCH_MOTOR_POSITION", 1.0),
    "outer_ankle_angle_rad": ("MCFO_RIGHT_ANKLE_ANGLE", 1.0),
    "outer_ankle_rate_rad_per_s": ("MCFO_RIGHT_ANKLE_RATE", 1.0),
    "outer_motor_angle_rad": ("MCFO_MOTOR_POSITION", 1.0),
    "inner_ankle_angle_rad": ("MCFI_MID_ANKLE_ANGLE", 1.0),
    "inner_ankle_rate_rad_per_s": ("MCFI_ANKLE_RATE", 1.0),
    "inner_motor_angle_rad": ("MCFI_MOTOR_POSITION", 1.0),
    "outer_leg_rate_rad_per_s": ("UI_ANG_RATE_X", -1.0),
    "hip_current_A": ("MCH_MOTOR_CURRENT", 1.0),
    "outer_ankle_current_A": ("MCFO_MOTOR_CURRENT", 1.0),
    "inner_ankle_current_A": ("MCFI_MOTOR_CURRENT", 1.0),
    "battery_voltage_V": ("MCH_BATT_VOLTAGE", 1.0),
    "hip_battery_power_W": ("MCH_BATT_POWER", 1.0),
    "outer_ankle_battery_power_W": ("MCFO_BATT_POWER", 1.0),
    "inner_ankle_battery_power_W": ("MCFI_BATT_POWER", 1.0),
    "outer_contact": ("MCFO_LEFT_HS", 1.0),
    "inner_contact": ("MCFI_RIGHT_HS", 1.0),
    "walk_state": ("FSM_LEG", 1.0),
}
# Base parameters that nobody knows to a tenth, of the body `ranger`.
NOMINAL = {
    "outer_ankle_constant_friction_Nm": 0.05,
    "inner_ankle_constant_friction_Nm": 0.05,
    "outer_ankle_viscous_friction_Nms": 0.004,
    "inner_ankle_viscous_friction_Nms": 0.004,
    "ankle_return_Nm_per_rad": 0.066,
    "foot_inertia_kg_m2": 0.0012,
    "outer_rolling_friction_Nms": 0.05,
    "inner_rolling_friction_Nms": 0.05,
}
FOOT_M, MASS_KG_M, LEG_KG, SPRING, LEG_INERTIA = 0.146, 0.04, 4.955, 7.6, 0.55  # of `ranger`, appendix table 2


@dataclasses.dataclass
class Asked:
    """One walk: body parameters other than `ranger`'s, terms of a model file, options of the command."""

    seed: int
    battery: float
    body: dict
    terms: tuple = ()
    options: tuple = ()


@dataclasses.dataclass(frozen=True)
class Ruler:
    """between: (features,), variance of sound walks' means; tangent: (features, k), what base parameters do."""

    between: np.ndarray
    tangent: np.ndarray

    def strength(self, one, other):
        """Of what makes the strides of one walk (strides, features) other than those of another."""
        vector = apart(one, other, self.between)
        return float(np.linalg.norm(vector - self.tangent @ (self.tangent.T @ vector))) / UNIT


@dataclasses.dataclass(frozen=True)
class Effect:
    """name: the catalogue's identifier. smallest, largest: size at the ends of the ladder; places: where it may sit.

    put(asked, size, place) lets it act; `tell`: what it is called and how large it is.
    """

    name: str
    balance: str
    smallest: float
    largest: float
    put: Callable
    tell: Callable
    places: tuple = ("",)
    sign: bool = False
    known: bool = True


def _body(values):
    """values(size, place) -> body parameters."""
    return lambda asked, size, place: asked.body.update(values(size, place))


def _term(form, parameter, **more):
    def put(asked, size, place):
        asked.terms += ({"form": form, "at": place, parameter: size, **more},)

    return put


def _slope(asked, size, place):
    asked.options += (f"--slope={size:.6f}",)


def _both(name, value):
    return {f"outer_{name}": value, f"inner_{name}": value}


def _size(name, unit_of=lambda size: size):
    return lambda size, place: {name: unit_of(size)}


HIP, ANKLES = "hip_absolute", ("outer_ankle_absolute", "inner_ankle_absolute")
_ALL = (
    Effect("geometry", "M", 0.002, 0.014, _body(lambda d, _: _both("ankle_offset_m", FOOT_M + d)),
           _size("ankle_offset_m", lambda d: FOOT_M + d), ("foot_height",), True),
    Effect("inertia", "M", 0.0015, 0.008, _body(lambda d, _: _both("mass_offset_kg_m", MASS_KG_M + LEG_KG * d)),
           _size("mass_offset_m", lambda d: MASS_KG_M / LEG_KG + d), ("centre_of_mass",), True),
    Effect("spring_value", "M", 0.05, 0.35, _body(lambda d, _: {"hip_spring_Nm_per_rad": SPRING * (1.0 + d)}),
           _size("hip_spring_Nm_per_rad", lambda d: SPRING * (1.0 + d)), ("hip_joint",), True),
    Effect("leg_asymmetry", "M", 0.03, 0.15,
           _body(lambda d, _: {"outer_hip_inertia_kg_m2": LEG_INERTIA * (1.0 + d)}), _size("share"), ("outer_leg",),
           True),
    Effect("contact_loss", "M", 0.5, 3.0, _body(lambda d, _: _both("rolling_friction_Nms", 0.05 * (1.0 + d))),
           _size("rolling_friction_Nms", lambda d: 0.05 * (1.0 + d)), ("sole",)),
    Effect("floor", "M", 0.001, 0.008, _slope, _size("slope_rad"), ("floor",), True),
    Effect("coulomb_friction", "M", 0.03, 0.4, _term("coulomb_friction", "change_Nm"), _size("change_Nm"),
           ("hip_joint",)),
    Effect("return_spring", "M", 0.01, 0.08, _term("spring", "square_Nm_per_rad2", rest_rad=1.0),
           _size("square_Nm_per_rad2"), ("outer_ankle", "inner_ankle")),
    Effect("contact_drop_change", "E", 0.2, 1.5, _term("contact_drop_change", "change_V"), _size("change_V"),
           ("hip_motor", "outer_motor", "inner_motor")),
    Effect("sensor_offset", "S", 0.004, 0.03, _term("sensor_offset", "value"), _size("value"), (HIP, *ANKLES), True),
    Effect("sensor_scale", "S", 0.02, 0.15, lambda asked, size, place: _term("sensor_scale", "factor")(
        asked, 1.0 + size, place), _size("factor", lambda d: 1.0 + d), ("gyro",), True),
    Effect("sensor_lag", "S", 0.003, 0.02, _term("sensor_lag", "time_constant_s"), _size("time_constant_s"), ("gyro",)),
    # ---- outside the catalogue ----
    Effect("cable_slack", "T", 8.0, 14.0, _term("cable_slack", "stiffness_Nm_per_rad"), _size("size"),
           ("outer_cable", "inner_cable"), known=False),
    Effect("cable_damping", "T", 0.02, 0.15, _term("cable_damping", "damping_Nms"), _size("size"),
           ("outer_cable", "inner_cable"), known=False),
    Effect("disc_error", "S", 0.1, 0.35, _term("disc_error", "duty_edges"), _size("size"), ("hip_joint",), known=False),
)  # fmt: skip


class Walk(Experiment):
    """Columns as `ranger-sim diagnose --experiment walk` takes them."""

    NAME = "walk"
    EFFECTS = {effect.name: effect for effect in _ALL}
    CAUSES = tuple(name for name, effect in EFFECTS.items() if effect.known)
    OUTSIDE = tuple(name for name, effect in EFFECTS.items() if not effect.known)
    CONFUSABLE = ()
    MIX = (("single", 0.60), ("null", 0.25), ("outside", 0.15))
    ONLY_IN = {"M": ("geometry", "inertia", "spring_value"), "S": ("sensor_offset",)}
    CHECK_AT_4 = 8
    CHECK_KINDS = (("single", 8), ("null", 10), ("outside", 6))
    STEPS = 30
    START_S = 0.5  # what is before is set-up

    def lasting(self, seconds):
        raise ValueError("a walk is counted in steps, not in seconds")

    def prepare(self, seed, case):
        """Base parameters and both walks of a case; the held-out one has another battery and other crystals."""
        rng = generator(seed, f"case {case.number}")
        low, high = (0.20, 0.40) if case.variant == "parameters" else (0.05, 0.15)
        case.base = {
            name: value * (1.0 + rng.choice((-1.0, 1.0)) * rng.uniform(low, high)) for name, value in NOMINAL.items()
        }
        # more noise on a walk is a rougher floor
        rough = (f"--floor-roughness={rng.uniform(0.5, 1.5):.3f}mm",) if case.variant == "noise" else ()
        case.runs = [
            Asked(int(rng.integers(1, 1 << 31)), float(rng.uniform(0.4, 1.0)), dict(case.base), (), rough) for _ in "ab"
        ]
        for name, strength in case.effects:
            effect = self.EFFECTS[name]
            case.shapes.append({"at": str(rng.choice(effect.places))})
            share = STRENGTHS.index(strength) / (len(STRENGTHS) - 1.0)
            size = effect.smallest * (effect.largest / effect.smallest) ** share * rng.uniform(0.9, 1.1)
            case.amplitudes.append(float(size * (rng.choice((-1.0, 1.0)) if effect.sign else 1.0)))

    def walked(self, case, asked):
        """A walk with what acts in the case, smaller and with other crystals where the robot falls of it.

        {variable: (times, values)}; RuntimeError when it falls at an eighth of it.
        """
        for _ in range(4):
            tried = dataclasses.replace(asked, body=dict(asked.body))
            for (name, _), shape, size in zip(case.effects, case.shapes, case.amplitudes, strict=True):
                self.EFFECTS[name].put(tried, size, shape["at"])
            record = walk(tried, self.STEPS)
            if record is not None:
                return record
            case.amplitudes = [0.5 * size for size in case.amplitudes]
            asked.seed += 1
        raise RuntimeError(f"case {case.number}: the robot falls")

    def generate(self, seed, cases, data, tell=lambda text: None):
        """Writes data files of planned cases below `data`; yields (id, files, holdout, truth) of each."""
        for case in cases:
            self.prepare(seed, case)
        with concurrent.futures.ThreadPoolExecutor(JOBS) as pool:
            ruler = self.ruler(seed, pool) if any(case.effects for case in cases) else None
            tell("walks with shifted base parameters done")
            made = pool.map(lambda each: self.made(seed, each, ruler), cases)
            for case, (logs, truth) in zip(cases, made, strict=True):
                key = generator(seed, f"name of case {case.number}").bytes(6).hex()
                (data / key).mkdir(parents=True)
                for name, columns in zip("ab", logs, strict=True):
                    write(data / key / f"{name}.csv", columns)
                tell(f"case {case.number} walked")
                yield key, [f"{key}/a.csv"], [f"{key}/b.csv"], truth

    def made(self, seed, case, ruler):
        """(logs of both walks, truth) of a case."""
        first = self.walked(case, case.runs[0])
        second = self.walked(case, case.runs[1])
        strength = 0.0
        if case.effects:
            plain = walk(case.runs[0], self.STEPS)
            strength = ruler.strength(strides(first), strides(plain))
        logs = [log(generator(seed, f"case {case.number} log {i}"), each) for i, each in enumerate((first, second))]
        return logs, self.truth(case, strength)

    def ruler(self, seed, pool):
        """What strengths are measured by: walks of the base with other seeds, and with shifted base parameters."""
        rng = generator(seed, "ruler")
        plain = [Asked(int(rng.integers(1, 1 << 31)), 0.7, dict(NOMINAL)) for _ in range(SEEDS)]
        shifted = [dataclasses.replace(plain[0], body=NOMINAL | {name: 1.3 * value}) for name, value in NOMINAL.items()]
        shifted.append(dataclasses.replace(plain[0], battery=0.4))
        records = list(pool.map(lambda asked: walk(asked, self.STEPS), [*plain, *shifted]))
        sound = [strides(record) for record in records[:SEEDS]]
        between = np.var([np.mean(each, axis=0) for each in sound], axis=0, ddof=1)
        changes = [apart(strides(each), sound[0], between) for each in records[SEEDS:] if each is not None]
        return Ruler(between, basis(np.array(changes).T))

    def truth(self, case, strength):
        """What only the scorer may know. The strength counted is the largest of the ladder that is reached."""
        causes = []
        for (name, wanted), shape, size in zip(case.effects, case.shapes, case.amplitudes, strict=True):
            effect = self.EFFECTS[name]
            causes.append(
                {
                    "name": name,
                    "at": shape["at"],
                    "in_catalogue": effect.known,
                    "balance": effect.balance,
                    "subsystem": SUBSYSTEM[effect.balance],
                    "strength": max((each for each in STRENGTHS if each <= strength), default=0.0),
                    "strength_reached": strength,
                    "rung": wanted,
                    "share_by_balance": dict.fromkeys("EMTSCt", 0.0) | {effect.balance: 1.0},
                    "amplitude": size,
                    "shape": shape,
                    "parameters": effect.tell(size, shape["at"]),
                }
            )
        return {
            "experiment": self.NAME,
            "number": case.number,
            "kind": case.kind,
            "variant": case.variant,
            "causes": causes,
            "ties": [],
            "cosines": {},
            "base": case.base,
            "walks": [{"seed": each.seed, "battery": each.battery} for each in case.runs],
        }


def walk(asked, steps):
    """{variable: (times, values)} of what the main brain knew, or None when the robot fell."""
    from asammdf import MDF

    with tempfile.TemporaryDirectory(prefix="walk-") as name:
        folder = pathlib.Path(name)
        (folder / "body.toml").write_text(body_text(asked.body), encoding="utf-8")
        (folder / "model.toml").write_text(model_text(asked.terms), encoding="utf-8")
        command = [sys.executable, "-m", "ranger_sim", "walk", "--steps", str(steps), "--seed", str(asked.seed)]
        command += [f"--battery={asked.battery:.4f}", "--body", str(folder / "body.toml"), *asked.options]
        command += ["--model", str(folder / "model.toml")] if asked.terms else []
        done = subprocess.run([*command, "--log", "full", "--out", str(folder / "run")], capture_output=True, text=True)
        if not (folder / "run/summary.json").exists():
            raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()[-400:]}")
        if json.loads((folder / "run/summary.json").read_text(encoding="utf-8"))["fell"]:
            return None
        found = {}
        with MDF(folder / "run/variables.mf4") as record:
            for column, (variable, sign) in VARIABLES.items():
                signal = record.get(variable)
                found[column] = np.asarray(signal.timestamps, float), sign * np.asarray(signal.samples, float)
    return found


def body_text(parameters):
    """A body file: `ranger` with other numbers."""
    lines = ['title = "a robot"', 'description = "one of many"', 'base = "ranger"', "", "[parameters]"]
    lines += [f"{name} = {value:.9g}" for name, value in parameters.items()]
    lines += ["", "[sources]", *(f'{name} = "drawn"' for name in parameters)]
    return "\n".join(lines) + "\n"


def model_text(terms):
    """A model file."""
    lines = []
    for term in terms:
        lines.append("[[term]]")
        lines += [
            f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value:.9g}" for key, value in term.items()
        ]
    return "\n".join(lines) + "\n"


def latest(series, times):
    """The value that was last written at each of the times."""
    stamps, values = series
    return values[np.maximum(np.searchsorted(stamps, times, side="right") - 1, 0)]


def log(rng, record):
    """Columns as RoboDAQ would have them: rows every 6 ms, some lost."""
    end_s = min(stamps[-1] for stamps, _ in (record["hip_angle_rad"], record["outer_leg_rate_rad_per_s"]))
    times = np.arange(Walk.START_S, end_s, ROW_S)
    there = rng.random(len(times)) >= LOST_ROW
    at = times[0] + rng.exponential(SILENCE_EVERY_S)
    while at < end_s:
        long_s = rng.uniform(*SILENCE_S)
        there &= (times < at) | (times >= at + long_s)
        at += long_s + rng.exponential(SILENCE_EVERY_S)
    times = times[there]
    columns = {"t_s": np.round(times - times[0], 3)}
    return columns | {name: latest(series, times) for name, series in record.items()}


def strides(record):
    """Features of each settled stride, (strides, features): times, angles at the strikes, means of what is driven.

    ValueError with too few strides.
    """
    stamps, contact = record["inner_contact"]
    strikes = stamps[1:][np.diff(contact) > 0]
    rows = []
    for start, end in zip(strikes[SETTLED:-1], strikes[SETTLED + 1 :], strict=True):
        times = np.arange(start, end, ROW_S)
        value = {name: latest(series, times) for name, series in record.items()}
        middle = np.flatnonzero(np.diff(value["outer_contact"]) > 0)
        turn = int(middle[0]) if len(middle) else len(times) // 2
        rows.append(
            [
                end - start,
                times[turn] - start,
                value["hip_angle_rad"][0],
                value["hip_angle_rad"][turn],
                np.mean(value["hip_angle_rad"]),
                np.mean(value["outer_leg_rate_rad_per_s"]),
                np.std(value["outer_leg_rate_rad_per_s"]),
                np.mean(value["outer_ankle_angle_rad"]),
                np.mean(value["inner_ankle_angle_rad"]),
                *(np.std(value[f"{name}_current_A"]) for name in ("hip", "outer_ankle", "inner_ankle")),
                *(np.mean(value[f"{name}_battery_power_W"]) for name in ("hip", "outer_ankle", "inner_ankle")),
                np.mean(value["hip_current_A"]),
            ]
        )
    if len(rows) < FEWEST_STRIDES:
        raise ValueError(f"only {len(rows)} strides")
    return np.array(rows)


def apart(one, other, between):
    """Means of the features against each other, over the standard error of the difference; (features,).

    between: variance of the means of sound walks, which strides that go on from each other do not show.
    """
    error = np.var(one, axis=0, ddof=1) / len(one) + np.var(other, axis=0, ddof=1) / len(other)
    error = np.maximum(error, 2.0 * between)
    return (np.mean(one, axis=0) - np.mean(other, axis=0)) / np.sqrt(np.maximum(error, 1e-12))


def basis(columns):
    """Orthonormal basis of columns (features, k), of half as many dimensions as features at most.

    Shifts of nine parameters would else take up nearly anything that sixteen features can show.
    """
    u, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, : min(int(np.sum(sizes > TANGENT_RANK * sizes[0])), len(u) // 2)]


def write(path, columns):
    """A text file of the columns."""
    row = ",".join("%.3f" if name == "t_s" else "%.7g" for name in columns) + "\n"
    table = np.column_stack(list(columns.values()))
    path.write_text(",".join(columns) + "\n" + (row * len(table)) % tuple(table.ravel()), encoding="ascii")


WALK = Walk()
