"""A machine of one balance in twenty lines: what is measured equals a sum of known terms.

A subclass gives the channels, the parameters and `columns`. The candidates come with it: what sensors, inputs and a
joint with friction usually have, so that a user need not know the catalogue. `more` adds others. For example

    class Joint(Balance):
        name = "robot-joint"
        quantities = (Quantity("angle_rad", "rad", "of the joint"), Quantity("rate_rad_per_s", "rad/s", "of the joint"),
                      Quantity("current_A", "A", "of the motor", drives=False))
        parameters = (Known("inertia_As2_per_rad", "A s^2/rad", 0.1, 0.0, 100.0, "of the joint, in current"),
                      Known("viscous_As_per_rad", "A s/rad", 1.0, 0.0, 100.0, "friction"),
                      Known("coulomb_A", "A", 0.5, 0.0, 50.0, "friction"))
        response, angle, rate = "current_A", "angle_rad", "rate_rad_per_s"

        def columns(self, s):
            return {"inertia_As2_per_rad": s["acceleration"], "viscous_As_per_rad": s["rate"],
                    "coulomb_A": s["direction"]}
"""

import abc
import math
from collections.abc import Mapping, Sequence

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import balance_candidates, signals
from ranger_sim.sysid.balance_candidates import Signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.forms import Shape
from ranger_sim.sysid.machine import Effect, Equation, Known, Quantity, Recording

AT_REST = 0.01  # of the fastest rate: about it the sign of the rate turns
SHARPER = 4.0  # times; the base mixes the two signs
CLOSE = 1.0 - 1e-12  # of a sign that is not infinitely far from its middle
SLOPE_S = 0.002  # Gaussian of a rate that is not measured
SAME_WAY = 0.99  # correlation of a rate's integral with a channel, straight lines taken off: it is that channel's rate


class Balance(abc.ABC):
    """response: the channel that the sum gives; angle, rate: channels of the joint, "" where there is none.

    Signals: the channels, `t` in seconds from the start, and for a joint `angle`, `rate`, `acceleration` and
    `direction`, the sign of the rate, smooth about standstill. Rows at standstill do not count, nor those about a
    reversal or a jump of the response.
    """

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Known, ...]
    response: str
    angle: str = ""
    rate: str = ""

    @abc.abstractmethod
    def columns(self, s: Signals) -> Mapping[str, Array]:
        """By parameter its column, (n,), from the signals."""

    def more(self, s: Signals) -> Mapping[str, Sequence[Array]]:
        """Candidates of this machine alone: by cause the columns, (n,), of its coefficients."""
        return {}

    def prepare(self, table: Table) -> Recording:
        """Signals and the equation of one recording; UserError when a needed channel is missing."""
        missing = [each.name for each in self.quantities if each.needed and each.name not in table]
        if missing:
            there = ", ".join(table.columns)
            raise UserError(f"{table.name}: {self.name} needs {', '.join(missing)} (available: {there})")
        table = signals.uniform(table)
        s = {each.name: table[each.name] for each in self.quantities if each.name in table}
        s["t"] = table.elapsed_s
        valid = np.ones(len(table), dtype=bool)
        if self.angle or self.rate:
            self._add_joint(table, s)
            unsure = signals.near_jumps(table, table[self.response]) | signals.near_jumps(table, np.sign(s["rate"]))
            valid = ~signals.resting(table, s["rate"]) & ~unsure
        columns = dict(self.columns(s))
        unknown = [name for name in columns if name not in {each.name for each in self.parameters}]
        if unknown:
            raise UserError(f"{self.name}: columns of {', '.join(unknown)}, which are not among its parameters")
        if self.angle or self.rate:  # how abrupt a machine's sign is about standstill is never known: the base fits it
            sharper = np.tanh(SHARPER * np.arctanh(np.clip(s["direction"], -CLOSE, CLOSE)))
            columns["width of standstill@rate"] = sharper - s["direction"]
        unit = next(each.unit for each in self.quantities if each.name == self.response)
        made = Equation(
            self.response, "M", "mechanical", unit, table[self.response], columns, valid, self._stand_ins(table, s)
        )
        return Recording(table, s, {self.response: made})

    def _stand_ins(self, table: Table, s: dict[str, Array]) -> dict[str, Array]:
        """Columns that a measured rate has part in, by its angle instead, whose noise is another.

        A rate's noise, differentiated, is larger than the acceleration in it; against its own column an inertia would
        come out near zero, and what it should explain would be left to other terms. So the joint's, and every rate of
        which another channel is the integral.
        """
        width = SLOPE_S / table.step_s
        other = dict(s)
        for name, (angle, ratio) in self._integrals(table, s).items():
            other[name] = ratio * signals.derivative(table, s[angle], width)
        if self.angle and self.rate:
            rate = signals.derivative(table, s["angle"], width)
            acceleration = signals.per_run(table, lambda part: np.gradient(part, table.step_s), rate)
            other |= {"rate": rate, "acceleration": acceleration}
        if all(other[name] is s[name] for name in s):
            return {}
        there, instead = self.columns(s), self.columns(other)
        return {name: column for name, column in instead.items() if not np.array_equal(column, there[name])}

    def _integrals(self, table: Table, s: Signals) -> dict[str, tuple[str, float]]:
        """By rate the channel that is its integral, and how many of the rate's units one of that per second is."""
        names = [each.name for each in self.quantities if each.name in s and each.name != self.response]
        ways = {name: _bent(table, s[name]) for name in names}
        found = {}
        for name in names:
            integral = _bent(table, signals.integral(table, s[name]))
            alike = {other: _alike(integral, ways[other]) for other in names if other != name}
            angle = max(alike, key=lambda other: alike[other], default="")
            if angle and alike[angle] > SAME_WAY:
                found[name] = (angle, float(integral @ ways[angle]) / float(ways[angle] @ ways[angle]))
        return found

    def _add_joint(self, table: Table, s: dict[str, Array]) -> None:
        width = SLOPE_S / table.step_s
        s["rate"] = table[self.rate] if self.rate else signals.derivative(table, table[self.angle], width)
        s["angle"] = table[self.angle] if self.angle else signals.integral(table, s["rate"])
        s["acceleration"] = signals.per_run(table, lambda part: np.gradient(part, table.step_s), s["rate"])
        s["direction"] = np.tanh(s["rate"] / (AT_REST * balance_candidates.fastest(s["rate"])))

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """The joint's signals, or all channels but the response."""
        joint: list[str] = [name for name in ("angle", "rate", "acceleration") if name in recording.signals]
        names = joint or [each.name for each in self.quantities if each.name not in ("", self.response)]
        return {self.response: {name: recording.signals[name] for name in (*names, "t") if name in recording.signals}}

    def again(
        self, recording: Recording, effects: Sequence[tuple[Effect, Shape, Sequence[float]]], fixed: bool = False
    ) -> Recording:
        """The recording for another search, with these effects in what a late sensor measures; itself where none is
        late. Rows do not count where what it shows is of a time at which nothing is known: before a run, and at rest.
        """
        return balance_candidates.behind(self, recording, effects)

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """Candidates of the response's sensor, of every input, of the joint, of the parameters, and its own."""
        return balance_candidates.candidates(self, recordings)


def _bent(table: Table, column: Array) -> Array:
    """What a straight line in time leaves of a column."""
    line = np.column_stack([np.ones(len(table)), table.time_s - table.time_s[0]])
    return np.asarray(column - line @ np.linalg.lstsq(line, column, rcond=None)[0])


def _alike(one: Array, other: Array) -> float:
    """Correlation of two columns without a mean, 0 where one of them is nothing."""
    sizes = math.sqrt(float(one @ one) * float(other @ other))
    return float(one @ other) / sizes if sizes > 0.0 else 0.0
