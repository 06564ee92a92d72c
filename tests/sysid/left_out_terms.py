"""True terms left out of real recordings at graded shares: is each named, with which value, and what does it gain.

    python -m tests.sysid.left_out_terms
    python -m tests.sysid.left_out_terms --only "joint 4" --shares 0 0.2 1

The model lacks a term that the machine has. Of that term a share is left in the measured data; at 0 the data have
nothing of it, and it is not to be named. RANGER_SIM_DATA is the folder of the recordings; its folder `public` has
others, whose source and licence docs/diagnose-your-machine.md lists. What is missing is skipped with a line.

"seen from" is the smallest share that theory allows: sqrt(threshold + ln n) standard errors of the term, by generalised
least squares of the whole model under an autoregression of what it leaves; nothing of the diagnosis is used for it.

What is left of a term in a recording is its value there less what was taken out, and not the share of a value, which
is an estimate itself. So "its size" is the mean of a plain and of a whitened fit to the diagnosed part, with the other
frictions that were named in the model, less what was taken; its error has half of the difference of the two fits.
"""

import argparse
import dataclasses
import os
import pathlib
import sys
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter, savgol_filter

from ranger_sim.foundation.wallclock import process_cpu_s
from ranger_sim.sysid.balance import Balance
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.robot_joint import HeavyJoint, Joint

DATA = pathlib.Path(os.environ.get("RANGER_SIM_DATA", pathlib.Path(__file__).parents[3] / "shared" / "data"))
SHARES = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
HEAD = (
    "recording, term", "left in", "its size", "seen from", "verdict", "named", "value",
    "held-out error before, after, black box", "processor",
)  # fmt: skip
THRESHOLD, ORDER = 20.0, 20  # of a score, where it is not found by surrogates; of the autoregression


class Carriage(Balance):
    """EMPS, with its command's volts as the force."""

    name = "carriage"
    quantities = (
        Quantity("position_m", "m", "of the mass"),
        Quantity("voltage_V", "V", "of the command", drives=False),
    )
    parameters = (
        Known("mass_Vs2_per_m", "V s^2/m", 2.7, 0.0, 100.0, "of all that moves"),
        Known("viscous_Vs_per_m", "V s/m", 5.8, 0.0, 1000.0, "of the guide"),
        Known("coulomb_V", "V", 0.6, 0.0, 100.0, "of the guide"),
        Known("offset_V", "V", 0.0, -10.0, 10.0, "of drive and guide"),
    )
    response, angle = "voltage_V", "position_m"

    def columns(self, s):
        found = {"mass_Vs2_per_m": s["acceleration"], "viscous_Vs_per_m": s["rate"], "coulomb_V": s["direction"]}
        return found | {"offset_V": np.ones_like(s["t"])}


class Pendulum(Balance):
    """A pendulum on a motor that measures its torque."""

    name = "pendulum"
    quantities = (
        Quantity("position_rad", "rad", "from hanging"),
        Quantity("velocity_rad_per_s", "rad/s", "of the pendulum"),
        Quantity("torque_Nm", "N m", "of the motor", drives=False),
    )
    parameters = (
        Known("inertia_kg_m2", "kg m^2", 0.1, 0.0, 10.0, "of the pendulum"),
        Known("viscous_Nms", "N m s", 0.05, 0.0, 10.0, "friction"),
        Known("coulomb_Nm", "N m", 0.2, 0.0, 10.0, "friction"),
        Known("offset_Nm", "N m", 0.0, -5.0, 5.0, "of the sensor"),
        Known("weight_Nm", "N m", 2.0, 0.0, 20.0, "at a right angle"),
    )
    response, angle, rate = "torque_Nm", "position_rad", "velocity_rad_per_s"

    def columns(self, s):
        found = {"inertia_kg_m2": s["acceleration"], "viscous_Nms": s["rate"], "coulomb_Nm": s["direction"]}
        return found | {"offset_Nm": np.ones_like(s["t"]), "weight_Nm": np.sin(s["angle"])}


@dataclasses.dataclass(frozen=True)
class Source:
    """A recording in two parts, and the whole model. columns: {channel: column of the files}."""

    files: tuple
    whole: type
    columns: dict
    cut: float = 0.0  # of one file: the part that comes first

    def there(self):
        return all((DATA / each).is_file() for each in self.files)

    def parts(self):
        """[(times, {channel: values})] of both parts."""
        found = []
        for each in self.files:
            path = DATA / each
            names = path.read_text(encoding="utf-8").split("\n", 1)[0].split(",")
            rows = np.loadtxt(path, delimiter=",", skiprows=1)
            times = np.linspace(rows[0, 0], rows[-1, 0], len(rows))
            at = {
                channel: np.interp(times, rows[:, 0], rows[:, names.index(one)])
                for channel, one in self.columns.items()
            }
            found.append((times, at))
        if not self.cut:
            return found
        ((times, at),) = found
        half = round(self.cut * len(times))
        return [
            (times[part], {name: one[part] for name, one in at.items()}) for part in (slice(0, half), slice(half, None))
        ]


def moved(times, values, whole):
    """Angle, rate, acceleration by parabolas over 30 ms, by code that the diagnosis does not have."""
    step_s = times[1] - times[0]
    window = max(5, 2 * round(0.03 / step_s) + 1)
    angle = values[whole.angle]
    rate = values[whole.rate] if whole.rate else savgol_filter(angle, window, 2, deriv=1, delta=step_s)
    return angle, rate, savgol_filter(rate, window, 2, deriv=1, delta=step_s)


@dataclasses.dataclass(frozen=True)
class Term:
    """A term of a source's whole model. parameter: that the model loses; column(angle, rate): what it is; names: causes
    that are right for it; coefficient: of theirs, which its value is compared with."""

    title: str
    source: Source
    parameters: tuple
    column: Callable
    names: tuple
    coefficient: str

    def machine(self):
        """The model without the term."""
        whole, lost = self.source.whole, self.parameters

        class Without(whole):
            parameters = tuple(each for each in whole.parameters if each.name not in lost)

            def columns(self, s):
                return {name: one for name, one in super().columns(s).items() if name not in lost}

        return Without()

    def fitted(self):
        """(value, standard error, rows) of the term in the whole model on both parts together."""
        whole, blocks = self.source.whole, []
        for times, values in self.source.parts():
            angle, rate, acceleration = moved(times, values, whole)
            s = {"t": times, "angle": angle, "rate": rate, "acceleration": acceleration, "direction": np.sign(rate)}
            s |= values
            columns = [one for name, one in whole().columns(s).items() if name not in self.parameters]
            if self.column is _cosine:  # of a weight at an unknown angle the other part is small
                columns.append(np.sin(angle))
            counts = np.abs(rate) > 0.02 * np.quantile(np.abs(rate), 0.98)
            blocks.append((np.column_stack([self.column(angle, rate), *columns]), values[whole.response], counts))
        matrix, response, counts = (np.concatenate(each) for each in zip(*blocks, strict=True))
        value = np.linalg.lstsq(matrix[counts], response[counts], rcond=None)[0]
        left = np.where(counts, response - matrix @ value, 0.0)
        past = np.column_stack([np.roll(left, lag) for lag in range(1, ORDER + 1)])[ORDER:]
        memory = np.linalg.lstsq(past, left[ORDER:], rcond=None)[0]
        white = lfilter(
            np.concatenate(([1.0], -memory)), [1.0], np.column_stack([matrix * counts[:, None], left]), axis=0
        )
        deviation = np.std(white[counts, -1])
        covariance = np.linalg.inv(white[counts, :-1].T @ white[counts, :-1]) * deviation**2
        return float(value[0]), float(np.sqrt(covariance[0, 0])), int(np.sum(counts))

    def left(self, share, value, others=()):
        """(what is left of the term in the part that is diagnosed, its standard error); others: causes in the model."""
        whole = self.source.whole
        times, values = self.source.parts()[0]
        angle, rate, acceleration = moved(times, values, whole)
        s = {"t": times, "angle": angle, "rate": rate, "acceleration": acceleration, "direction": np.sign(rate)}
        s |= values
        columns = [self.column(angle, rate)]
        columns += [one for name, one in whole().columns(s).items() if name not in self.parameters]
        if self.column is _cosine:
            columns.append(np.sin(angle))
        for name, form, speed in others:
            if name == "stribeck":
                columns.append(np.sign(rate) * np.exp(-((rate / speed) ** 2)))
            elif (name, form) in FRICTIONS:
                columns.append(FRICTIONS[name, form](angle, rate))
        counts = np.abs(rate) > 0.02 * np.quantile(np.abs(rate), 0.98)
        both = np.column_stack([*columns, values[whole.response]])
        plain = np.linalg.lstsq(both[counts, :-1], both[counts, -1], rcond=None)[0]
        rest = np.where(counts, both[:, -1] - both[:, :-1] @ plain, 0.0)
        past = np.column_stack([np.roll(rest, lag) for lag in range(1, ORDER + 1)])[ORDER:]
        memory = np.linalg.lstsq(past, rest[ORDER:], rcond=None)[0]
        white = lfilter(np.concatenate(([1.0], -memory)), [1.0], both, axis=0)
        unbroken = np.convolve(counts, np.ones(ORDER + 1))[: len(counts)] > ORDER + 0.5
        x, y = white[unbroken, :-1], white[unbroken, -1]
        whitened = np.linalg.lstsq(x, y, rcond=None)[0]
        error = np.sqrt(np.linalg.inv(x.T @ x)[0, 0]) * np.std(y - x @ whitened)
        there = 0.5 * (plain[0] + whitened[0])
        return float(there - (1.0 - share) * value), float(np.hypot(error, 0.5 * (plain[0] - whitened[0])))

    def tables(self, share, value):
        """Both parts with this share of the term left in them."""
        whole = self.source.whole
        for part, (times, values) in zip("ab", self.source.parts(), strict=True):
            angle, rate, _ = moved(times, values, whole)
            taken = (1.0 - share) * value * self.column(angle, rate)
            yield Table(
                times,
                values | {whole.response: values[whole.response] - taken},
                (slice(0, len(times)),),
                f"part {part}",
            )

    def diagnosed(self, share, value):
        run, other = self.tables(share, value)
        return diagnose(self.machine(), [run], [other]).result


def _joint(number):
    columns = {"angle_rad": "angle_rad", "rate_rad_per_s": "rate_rad_per_s", "current_A": "current_A"}
    return Source(
        (f"ur10e_joint{number}_a.csv", f"ur10e_joint{number}_b.csv"), HeavyJoint if number == 4 else Joint, columns
    )


def _cosine(angle, rate):
    return np.cos(angle)


def _sine(angle, rate):
    return np.sin(angle)


def _rate(angle, rate):
    return rate


def _sign(angle, rate):
    return np.sign(rate)


FRICTIONS = {  # of other causes that may be named: (cause, form)
    ("drag", "square"): lambda angle, rate: rate * np.abs(rate),
    ("drag", "cube"): lambda angle, rate: rate**3,
    ("drag", "root"): lambda angle, rate: np.sign(rate) * np.sqrt(np.abs(rate)),
    ("direction_friction", ""): lambda angle, rate: np.abs(rate),
    ("spring", ""): lambda angle, rate: angle,
}
EMPS = Source(
    ("emps_run1.csv", "emps_run2_pulses.csv"),
    Carriage,
    {"position_m": "position_measured_m", "voltage_V": "motor_voltage_command_V"},
)
TORQUE = {"position_rad": "position", "velocity_rad_per_s": "velocity", "torque_Nm": "torque"}
BY_HAND, SWING_UP = (
    Source((f"public/pendulum_{each}.csv",), Pendulum, TORQUE, 0.6) for each in ("by_hand", "swing_up")
)
COULOMB, VISCOUS = (("coulomb_friction",), "size"), (("viscous_friction",), "size")
TERMS = (
    Term("joint 4, gravity", _joint(4), ("cosine_A", "sine_A"), _cosine, ("gravity", "once_per_turn"), "cosine"),
    Term("joint 4, Coulomb friction", _joint(4), ("coulomb_A",), _sign, *COULOMB),
    Term("joint 4, viscous friction", _joint(4), ("viscous_As_per_rad",), _rate, *VISCOUS),
    Term("joint 1, Coulomb friction", _joint(1), ("coulomb_A",), _sign, *COULOMB),
    Term("joint 1, viscous friction", _joint(1), ("viscous_As_per_rad",), _rate, *VISCOUS),
    Term("EMPS, Coulomb friction", EMPS, ("coulomb_V",), _sign, *COULOMB),
    Term("EMPS, viscous friction", EMPS, ("viscous_Vs_per_m",), _rate, *VISCOUS),
    Term("pendulum by hand, gravity", BY_HAND, ("weight_Nm",), _sine, ("gravity",), "sine"),
    Term("pendulum swinging up, gravity", SWING_UP, ("weight_Nm",), _sine, ("gravity",), "sine"),
)


def row(term, share, fitted):
    """Cells of the table for one share."""
    value, error, rows = fitted
    seen = np.sqrt(THRESHOLD + np.log(rows)) * error / abs(value)
    before = process_cpu_s()
    result = term.diagnosed(share, value)
    took = process_cpu_s() - before
    named = " + ".join(each.name for each in result.causes) or ("abstains" if result.detected else "nothing")
    first = next(iter(result.causes), None)
    right = first is not None and first.name in term.names
    others = [
        (each.name, each.form or "", each.parameters["speed"].value if "speed" in each.parameters else 0.0)
        for each in result.causes
        if each is not first
    ]
    left, unsure = term.left(share, value, others)
    interval = ""
    if right and term.coefficient in first.parameters:
        found = first.parameters[term.coefficient]
        low, high = found.ci95
        holds = abs(found.value - left) <= np.hypot(0.5 * (high - low), 1.96 * unsure)
        interval = f"{found.value:.4g} ({low:.4g} to {high:.4g})" + ("" if holds else " **not**")
    errors = next(iter((result.evidence.held_out_errors or {}).values()), None)
    shown = f"{errors.before:.2%}, {errors.after:.2%}, {errors.black_box or 0.0:.2%}" if errors else ""
    if share == 0.0:
        verdict = "named" if right else "not named"
    else:
        verdict = "first" if right else ("missed" if share > seen else "too small")
    cells = (
        term.title,
        f"{share:.0%}",
        f"{left:.3g} ± {unsure:.2g}",
        f"{seen:.1%}",
        verdict,
        named,
        interval,
        shown,
        f"{took:.1f} s",
    )
    return f"| {' | '.join(cells)} |\n"


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--only", default="", help="terms whose title has this")
    options.add_argument("--shares", type=float, nargs="+", default=SHARES)
    given = options.parse_args()
    sys.stdout.write(f"| {' | '.join(HEAD)} |\n{'|---' * len(HEAD)}|\n")
    for term in TERMS:
        if given.only not in term.title:
            continue
        if not term.source.there():
            sys.stdout.write(f"{term.title}: skipped, {', '.join(term.source.files)} is not in RANGER_SIM_DATA\n")
            continue
        fitted = term.fitted()
        for share in given.shares:
            sys.stdout.write(row(term, share, fitted))
            sys.stdout.flush()


if __name__ == "__main__":
    main()
