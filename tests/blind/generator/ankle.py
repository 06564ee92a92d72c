"""The hanging robot's ankle on a sine: the two logs that the real robot left, with a hidden effect.

`sine`, as in the tracking experiment: joint angle against target, and the law's numbers; the motor's angle, which the
board feeds back, is not logged. `foot`, as in the foot-inertia experiment: both angles, the joint's rate, and the
current about every 52 ms.

How strong an effect is: what of its trace in the logged channels the base parameters cannot take up, over the noise.
Traces are differences of two simulations, and so are those of the base parameters.

A hanging foot has little load: friction that goes with load, a cable's stiffening and its creep do not show in it at
amplitudes that a machine can have, and friction by direction is the spring's rest angle. They are not hidden here.
"""

import copy
import dataclasses
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from tests.blind.generator.experiment import SUBSYSTEM, TIE, WITH_ONE, Experiment, cosine
from tests.blind.generator.hanging_foot import DT_S, FINE, LAWS, ROW_S, TARGET, Drive, Lane, run
from tests.blind.generator.strength import UNIT

BATCH = 40  # cases simulated side by side, each with one lane for every base parameter and rival
BEFORE_S = 1.0  # not logged: the start dies away
# A logged target is that which the board had in force, in the middle of the time that it was.
TARGET_AGE_S = 1.5 * TARGET * DT_S
CURRENT_ROWS = 13  # one row in so many has the current: 19 Hz, as the logs
# Joint: absolute encoder of 13 bit; motor: 512 lines, four edges each, behind 34:1; current: robot.md C4, C3.1.
LSB = {"q": 2.0 * np.pi / 8192.0, "p": 2.0 * np.pi / (2048.0 * 34.0), "v": 1e-5, "I": 1.54e-3}
NUDGE = 0.01  # of a base parameter, for its trace
SECANTS = 5
TANGENT_RANK = 1e-6  # of the largest singular value: a trace below it is another's


@dataclasses.dataclass(frozen=True)
class Effect:
    """name: the catalogue's identifier, or None outside it. draw(rng, run): its shape; measure: what an instrument
    makes of the channels, where no law acts; start: an amplitude that shows and does not break the run.
    """

    name: str
    balance: str
    start: float
    draw: Callable = lambda rng, run: {}
    measure: Callable | None = None
    tell: Callable = lambda a, shape: {}
    sign: bool = False
    known: bool = True


@dataclasses.dataclass(frozen=True)
class Run:
    """One recording. kind: sine or foot."""

    name: str
    kind: str
    drive: Drive
    seconds: float

    @property
    def peak_rad_s(self):
        return self.drive.amplitude_rad * 2.0 * np.pi * self.drive.hertz


def _between(name, low, high):
    return lambda rng, run: {name: float(rng.uniform(low, high))}


def _of_peak(name, low, high):
    return lambda rng, run: {name: float(rng.uniform(low, high)) * run.peak_rad_s}


def _phases(rng, run):
    return {name: float(rng.uniform(0.0, 2.0 * np.pi)) for name in ("phase1", "phase2")}


def _three_phases(rng, run):
    periods = {"periods": float(rng.choice((1.0, 2.0, 3.0))), "phase3": float(rng.uniform(0.0, 2.0 * np.pi))}
    return periods | _phases(rng, run)


def _late(channels, a, shape, time_s):
    """A first-order lag that may be shorter than a row: the angle taken as straight lines between."""
    step_s = ROW_S / FINE
    q = np.interp(np.arange(len(time_s) * FINE) * step_s, time_s, channels["q"])
    keep = np.exp(-step_s / max(a, 1e-3 * step_s))
    return {"q": lfilter([1.0 - keep], [1.0, -keep], q, zi=[keep * q[0]])[0][::FINE]}


def _eccentric(channels, a, shape, time_s):
    q = channels["q"]
    return {"q": q + a * (np.sin(q + shape["phase1"]) + 0.35 * np.sin(2.0 * q + shape["phase2"]))}


def _drifting(channels, a, shape, time_s):
    return {"q": np.interp(time_s * (1.0 + a), time_s, channels["q"])}


def _ringing(channels, a, shape, time_s):
    """A loose connector: the joint's angle jumps for moments whenever the foot turns back."""
    turns = np.flatnonzero(np.diff(np.sign(channels["v"])) != 0)
    kicks = np.zeros_like(time_s)
    kicks[turns] = 1.0
    decay = np.exp(-np.arange(60) * ROW_S / 0.06) * np.sin(2.0 * np.pi * shape["hertz"] * np.arange(60) * ROW_S)
    return {"q": channels["q"] + a * np.convolve(kicks, decay)[: len(kicks)]}


_ALL = (
    Effect("return_spring", "M", 0.02, _between("knee_rad", 0.5, 0.9)),
    Effect("stribeck", "M", 0.03, _of_peak("speed_rad_s", 0.05, 0.2), tell=lambda a, h: {"excess_Nm": a}),
    Effect("presliding", "M", 0.01, _of_peak("speed_rad_s", 1.0, 1.0), tell=lambda a, h: {"deflection_rad": a}),
    Effect("friction_warm_up", "M", 0.03, tell=lambda a, h: {"cold_Nm": a}),
    Effect("drag", "M", 0.003, _between("power", 1.85, 2.15)),
    Effect(
        "cogging", "M", 0.02, _three_phases, tell=lambda a, h: {"amplitude_Nm": a, "periods_per_turn": h["periods"]}
    ),
    Effect("cable_backlash", "T", 0.005, tell=lambda a, h: {"gap_rad": 2.0 * a}),
    Effect("pulley_slip", "T", 0.01, lambda rng, run: {"at_s": float(rng.uniform(0.3, 0.6)) * run.seconds}, sign=True),
    Effect("lost_counts", "S", 0.003, _of_peak("limit_rad_s", 0.4, 0.7), tell=lambda a, h: {"fraction": a}),
    Effect("eccentricity", "S", 0.005, _phases, _eccentric, lambda a, h: {"once_rad": a, "twice_rad": 0.35 * a}),
    Effect("sensor_lag", "S", 0.004, measure=_late, tell=lambda a, h: {"time_constant_s": a}),
    Effect("clock_drift", "t", 0.001, measure=_drifting, tell=lambda a, h: {"drift": a}, sign=True),
    Effect("firmware_parameter", "C", 0.02, tell=lambda a, h: {"factor": 1.0 + a}, sign=True),
    # ---- outside the catalogue ----
    Effect("tight_arc_friction", "M", 0.04, _between("centre_rad", 0.6, 1.5), known=False),
    Effect("eddy_brake_saturating", "M", 0.02, _of_peak("peak_rad_s", 0.15, 0.4), known=False),
    Effect("loose_mass", "M", 3e-4, _between("hertz", 2.5, 6.0), known=False),
    Effect(
        "sway", "M", 0.01, lambda rng, run: {"hertz": float(rng.uniform(0.7, 1.1))} | _phases(rng, run), known=False
    ),
    Effect("rattling_disc", "S", 0.01, _between("hertz", 20.0, 60.0), _ringing, known=False),
)


class Ankle(Experiment):
    """Columns as `ranger-sim diagnose --experiment ankle` takes them."""

    NAME = "ankle"
    # Identified from the robot's own logs (docs/record-walk.md): foot, return spring, friction; cable and torque
    # constant of the appendix's tables. `zero`: motor against joint, as the logs have it (0.02 to 0.04 rad).
    NOMINAL = {
        "J_f": 0.0012,
        "k_r": 0.066,
        "q_0": 1.66,
        "k_s": 14.0,
        "C0": 0.05,
        "C1": 0.004,
        "mu": 0.1,
        "GK": 0.612,
        "zero": 0.025,
    }
    FIXED = {"J_m": 34.0**2 * 1.6e-6, "d": 0.003}
    # Of what is logged, with a memory of 0.3 to 0.6 from row to row, for most of it is counts, which have none: the
    # scatter of the robot's own logs, in which steps of time, a cable on its pulleys and a swaying body are besides.
    # Chosen by us.
    NOISE = {"q": 0.5e-3, "p": 0.2e-3, "v": 0.03, "I": 0.03}
    CHANNELS = {"sine": "q", "foot": "pqvI"}
    EFFECTS = {effect.name: effect for effect in _ALL}
    CAUSES = tuple(name for name, effect in EFFECTS.items() if effect.known)
    OUTSIDE = tuple(name for name, effect in EFFECTS.items() if not effect.known)
    CONFUSABLE = ()
    MIX = (("single", 0.50), ("null", 0.22), ("pair", 0.13), ("outside", 0.15))
    ONLY_IN = {
        "M": ("return_spring", "stribeck", "friction_warm_up"),
        "T": ("cable_backlash", "pulley_slip"),
        "S": ("eccentricity", "lost_counts"),
    }
    CHECK_AT_4 = 8
    CHECK_KINDS = (("single", 8), ("null", 10), ("pair", 6), ("outside", 10))
    ONLY_FOOT = ("firmware_parameter",)  # the other log has no angle of the motor: a gain of the target is a spring's
    SAMPLES = round(10.0 / ROW_S)

    def lasting(self, seconds):
        other = copy.copy(self)
        other.SAMPLES = round(seconds / ROW_S)
        return other

    def prepare(self, seed, case):
        """Base parameters, instruments and both runs of a case."""
        rng = generator(seed, f"case {case.number}")
        low, high = (0.20, 0.40) if case.variant == "parameters" else (0.05, 0.15)
        case.base = {
            name: value * (1.0 + rng.choice((-1.0, 1.0)) * rng.uniform(low, high))
            for name, value in self.NOMINAL.items()
        } | self.FIXED
        louder = rng.uniform(2.0, 3.5) if case.variant == "noise" else 1.0
        noise = {name: value * louder * float(rng.uniform(0.8, 1.3)) for name, value in self.NOISE.items()}
        case.instruments = {"noise": noise, "memory": float(rng.uniform(0.3, 0.6))}
        kind = str(rng.choice(("sine", "foot")))
        kind = "foot" if any(name in self.ONLY_FOOT for name, _ in case.effects) else kind
        case.runs = [self.asked(rng, kind, name) for name in "ab"]
        for name, _ in case.effects:
            effect = self.EFFECTS[name]
            case.shapes.append(effect.draw(generator(seed, f"case {case.number} {name}"), case.runs[0]))
            case.signs.append(float(rng.choice((-1.0, 1.0))) if effect.sign else 1.0)

    def asked(self, rng, kind, name):
        """A run: slow or fast, about another angle, with another stiffness."""
        low, high = (0.12, 1.5) if kind == "sine" else (0.5, 2.0)
        hertz = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        amplitude = float(rng.uniform(0.8, 1.05) if kind == "sine" else rng.uniform(0.7, 0.9))
        stiffness = float(rng.uniform(15.0, 25.0) if kind == "sine" else rng.uniform(10.0, 13.0))
        centre, phase = float(rng.uniform(1.25, 1.4)), float(rng.uniform(0.0, 2.0 * np.pi))
        damping = float(rng.uniform(1.5, 1.8))
        seconds = self.SAMPLES * ROW_S
        return Run(name, kind, Drive(centre, amplitude, hertz, phase, stiffness, damping), seconds)

    def simulate(self, wanted, counted=False):
        """Channels, {name: (samples,)}, of each (case, run, base, [(effect, amplitude, shape)])."""
        lanes = []
        for _, asked, base, acting in wanted:
            acts = {name: (amplitude, shape) for name, amplitude, shape in acting if name in LAWS}
            lanes.append(Lane(base, asked.drive, acts))
        out = run(lanes, self.SAMPLES, round(BEFORE_S / ROW_S), counted)
        time_s = np.arange(self.SAMPLES) * ROW_S
        found = []
        for i, (_, asked, _, acting) in enumerate(wanted):
            channels = {name: values[:, i].copy() for name, values in out.items()}
            for name, amplitude, shape in acting:
                if name == "lost_counts":
                    channels["p"] -= lost(channels["u"], amplitude, shape["limit_rad_s"])
                elif self.EFFECTS[name].measure is not None:
                    channels |= self.EFFECTS[name].measure(channels, amplitude, shape, time_s)
            found.append({name: channels[name] for name in self.CHANNELS[asked.kind]})
        return found

    def vector(self, case, channels):
        """Channels over their noise, one after the other, so weighted that all noises count as of one memory."""
        parts = []
        rho = case.instruments["memory"]
        for name, values in channels.items():
            deviation = np.sqrt(case.instruments["noise"][name] ** 2 + LSB[name] ** 2 / 12.0)
            if name == "I":  # far apart: without memory
                values, deviation = values[::CURRENT_ROWS], deviation * np.sqrt((1.0 - rho) / (1.0 + rho))
            parts.append(values / deviation)
        return np.concatenate(parts)

    def generate(self, seed, cases, data, tell=lambda text: None):
        """Writes data files of planned cases below `data`; yields (id, files, holdout, truth) of each."""
        for start in range(0, len(cases), BATCH):
            batch = cases[start : start + BATCH]
            for case in batch:
                self.prepare(seed, case)
            tangents = self.tangents(batch)
            self.calibrate_all(batch, tangents)
            cosines = self.all_rivals(seed, batch, tangents)
            tell(f"{len(batch)} cases calibrated")
            wanted = [(case, asked, case.base, self.acting(case)) for case in batch for asked in case.runs]
            channels = self.simulate(wanted, counted=True)
            for number, case in enumerate(batch):
                key = generator(seed, f"name of case {case.number}").bytes(6).hex()
                (data / key).mkdir(parents=True)
                for asked, seen in zip(case.runs, channels[2 * number : 2 * number + 2], strict=True):
                    columns = self.log(generator(seed, f"case {case.number} noise {asked.name}"), case, asked, seen)
                    write(data / key / f"{asked.name}.csv", columns)
                yield key, [f"{key}/a.csv"], [f"{key}/b.csv"], self.truth(case, tangents[number], cosines[number])

    def acting(self, case):
        """[(effect, amplitude, shape)] of a case."""
        return [(name, a, h) for (name, _), a, h in zip(case.effects, case.amplitudes, case.shapes, strict=True)]

    def tangents(self, batch):
        """For each case (vector without effects, orthonormal basis of what the base parameters change)."""
        wanted = []
        for case in batch:
            wanted.append((case, case.runs[0], case.base, []))
            for name in self.NOMINAL:
                wanted.append((case, case.runs[0], case.base | {name: case.base[name] * (1.0 + NUDGE)}, []))
        vectors = self.vectors(wanted)
        per = 1 + len(self.NOMINAL)
        found = []
        for i in range(0, len(vectors), per):
            plain, *nudged = vectors[i : i + per]
            columns = np.array([each - plain for each in nudged]).T
            columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
            u, sizes, _ = np.linalg.svd(columns, full_matrices=False)
            found.append((plain, u[:, sizes > TANGENT_RANK * sizes[0]]))
        return found

    def vectors(self, wanted):
        return [self.vector(each[0], channels) for each, channels in zip(wanted, self.simulate(wanted), strict=True)]

    def outside(self, vector, tangent):
        """What of a run's deviation the base parameters leave."""
        plain, basis = tangent
        apart = vector - plain
        return apart - basis @ (basis.T @ apart)

    def strength(self, case, vector, tangent):
        """(r, N_eff, strength) as generator/strength.py has them."""
        rho = case.instruments["memory"]
        n_eff = self.SAMPLES * (1.0 - rho) / (1.0 + rho)
        r = float(np.linalg.norm(self.outside(vector, tangent))) / np.sqrt(self.SAMPLES)
        return r, n_eff, r * np.sqrt(n_eff) / UNIT

    def calibrate_all(self, batch, tangents):
        """Amplitudes that give the wanted strengths, by secants; each effect alone.

        What comes out too far from it, for an ankle is not linear, counts as of strength 0, which no figure is about.
        """
        places = [(i, j) for i, case in enumerate(batch) for j in range(len(case.effects))]
        for case in batch:
            case.amplitudes = [
                sign * self.EFFECTS[name].start for (name, _), sign in zip(case.effects, case.signs, strict=True)
            ]
            case.reached = [None] * len(case.effects)
        for last in (False,) * SECANTS + (True,):
            wanted = [(batch[i], batch[i].runs[0], batch[i].base, [self.acting(batch[i])[j]]) for i, j in places]
            for (i, j), vector in zip(places, self.vectors(wanted) if wanted else (), strict=True):
                case = batch[i]
                case.reached[j] = self.strength(case, vector, tangents[i])
                ratio = case.effects[j][1] / max(case.reached[j][2], 1e-6)
                if last:
                    name, wanted_strength = case.effects[j]
                    case.effects[j] = (name, wanted_strength if 0.75 < ratio < 1.33 else 0.0)
                else:
                    case.amplitudes[j] *= float(np.clip(ratio, 0.2, 5.0))

    def all_rivals(self, seed, batch, tangents):
        """For each case {other cause: cosine} with its only effect."""
        wanted, owners = [], []
        for i, case in enumerate(batch):
            if case.kind not in WITH_ONE:
                continue
            wanted.append((case, case.runs[0], case.base, self.acting(case)))
            owners.append((i, None))
            ((own, _),), (shape,) = case.effects, case.shapes
            for other in self.CAUSES:
                if other == own:
                    continue
                effect = self.EFFECTS[other]
                drawn = effect.draw(generator(seed, f"case {case.number} {other}"), case.runs[0])
                drawn |= {key: shape[key] for key in drawn if key in shape}
                wanted.append((case, case.runs[0], case.base, [(other, effect.start, drawn)]))
                owners.append((i, other))
        found = [{} for _ in batch]
        mine = None
        for (i, other), vector in zip(owners, self.vectors(wanted) if wanted else (), strict=True):
            theirs = self.outside(vector, tangents[i])
            if other is None:
                mine = theirs
            else:
                found[i][other] = cosine(mine, theirs)
        return found

    def log(self, rng, case, asked, seen):
        """The columns of a run's file; NaN where nothing was logged."""
        time_s = np.arange(self.SAMPLES) * ROW_S
        memory, shown = case.instruments["memory"], {}
        for name, values in seen.items():
            rho = 0.0 if name == "I" else memory
            shocks = rng.standard_normal(self.SAMPLES) * np.sqrt(1.0 - rho**2)
            noise = lfilter([1.0], [1.0, -rho], shocks, zi=[rho * rng.standard_normal()])[0]
            value = values + case.instruments["noise"][name] * noise
            shown[name] = (np.floor if name in "qp" else np.round)(value / LSB[name]) * LSB[name]
        target, rate = asked.drive.target(time_s + ROW_S - TARGET_AGE_S + DT_S)  # rows are taken at their ends
        K, D = asked.drive.stiffness_A_per_rad, asked.drive.damping_As_per_rad
        if asked.kind == "sine":
            return {
                "t_s": time_s,
                "joint_angle_rad": shown["q"],
                "target_angle_rad": target,
                "target_rate_rad_per_s": rate,
                "command_current_A": K * target + D * rate,
                "command_stiffness_A_per_rad": np.full_like(time_s, K),
                "command_dampness_A_s_per_rad": np.full_like(time_s, D),
            }
        current = np.full_like(time_s, np.nan)
        current[::CURRENT_ROWS] = shown["I"][::CURRENT_ROWS]
        return {
            "t_s": time_s,
            "motor_angle_rad": shown["p"],
            "joint_angle_rad": shown["q"],
            "joint_rate_rad_per_s": shown["v"],
            "target_angle_rad": target,
            "target_rate_rad_per_s": rate,
            "command_stiffness_A_per_rad": np.full_like(time_s, K),
            "command_dampness_A_s_per_rad": np.full_like(time_s, D),
            "current_A": current,
        }

    def truth(self, case, tangent, cosines):
        """What only the scorer may know."""
        causes = []
        for (name, wanted), a, h, reached in zip(case.effects, case.amplitudes, case.shapes, case.reached, strict=True):
            effect = self.EFFECTS[name]
            r, n_eff, strength = reached
            causes.append(
                {
                    "name": name,
                    "in_catalogue": effect.known,
                    "balance": effect.balance,
                    "subsystem": SUBSYSTEM[effect.balance],
                    "strength": wanted,
                    "strength_reached": strength,
                    "r": r,
                    "n_eff": n_eff,
                    "share_by_balance": dict.fromkeys("EMTSCt", 0.0) | {effect.balance: 1.0},
                    "amplitude": a,
                    "shape": h,
                    "parameters": effect.tell(a, h),
                }
            )
        return {
            "experiment": self.NAME,
            "number": case.number,
            "kind": case.kind,
            "variant": case.variant,
            "log": case.runs[0].kind,
            "causes": causes,
            "ties": sorted(name for name, value in cosines.items() if value > TIE),
            "cosines": {name: round(value, 3) for name, value in sorted(cosines.items(), key=lambda item: -item[1])},
            "base": case.base,
            "noise": case.instruments["noise"],
            "memory": case.instruments["memory"],
        }


def lost(rate, share, limit_rad_s):
    """Angle that an encoder has lost, from the rate (samples,), as the board's law has it."""
    over = np.logaddexp(0.0, (np.abs(rate) - limit_rad_s) / 0.3) * 0.3
    return np.cumsum(share * np.sign(rate) * over) * ROW_S


def write(path, columns):
    """A text file of the columns; empty where a value is NaN."""
    row = ",".join("%.4f" if name == "t_s" else "%.6f" for name in columns) + "\n"
    table = np.column_stack(list(columns.values()))
    text = (row * len(table)) % tuple(table.ravel())
    path.write_text(",".join(columns) + "\n" + text.replace("nan", ""), encoding="ascii")


ANKLE = Ankle()
