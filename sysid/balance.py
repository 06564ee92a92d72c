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
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import signals, units
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.machine import PARAMETER, Columns, Effect, Equation, Known, Quantity, Recording, Values

AT_REST = 0.01  # of the fastest rate: about it the sign of the rate turns
SHARPER = 4.0  # times; the base mixes the two signs
CLOSE = 1.0 - 1e-12  # of a sign that is not infinitely far from its middle
SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.4)  # of the fastest rate
PERIODS = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0)  # per turn of the joint, or of the way that it travels
LIMITS = (0.2, 0.35, 0.5, 0.7, 0.85, 0.95)  # of the largest input: where it may saturate
ZONES = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4)  # of the largest input: where nothing may come of it
RADIAN = units.Unit(("rad",))
SLOPE_S = 0.002  # Gaussian of a rate that is not measured
SAME_WAY = 0.99  # correlation of a rate's integral with a channel, straight lines taken off: it is that channel's rate

Shape = Mapping[str, float]
Signals = Mapping[str, Array]
Made = Callable[[Signals, Shape], Sequence[Array]]  # the columns, (n,), of an effect at a shape


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
        s["direction"] = np.tanh(s["rate"] / (AT_REST * _top(s["rate"])))

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """The joint's signals, or all channels but the response."""
        joint: list[str] = [name for name in ("angle", "rate", "acceleration") if name in recording.signals]
        names = joint or [each.name for each in self.quantities if each.name not in ("", self.response)]
        return {self.response: {name: recording.signals[name] for name in (*names, "t") if name in recording.signals}}

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """Candidates of the response's sensor, of every input, of the joint, and this machine's own."""
        found = [
            self._effect("sensor_offset", self.response, ("offset",), lambda s, _: [np.ones_like(s["t"])]),
            self._effect("sensor_drift", self.response, ("per_s",), lambda s, _: [s["t"]]),
            self._lag(),
        ]
        for each in self.quantities:
            if each.is_input and each.name != self.response:
                found += self._of_input(each.name, max(float(np.max(np.abs(r.signals[each.name]))) for r in recordings))
        if self.angle or self.rate:
            found += self._of_joint(recordings)
        found += self._of_parameters(recordings)
        own = self.more(recordings[0].signals)
        for cause, columns in own.items():
            names = tuple(f"size_{number}" for number in range(1, 1 + len(columns))) if len(columns) > 1 else ("size",)
            found.append(self._effect(cause, self.name, names, self._of_machine(cause)))
        return found

    def _of_machine(self, cause: str) -> Made:
        return lambda s, _: self.more(s)[cause]

    def _effect(
        self,
        cause: str,
        at: str,
        names: tuple[str, ...],
        make: Made,
        shapes: Sequence[Shape] = ({},),
        form: str = "",
        forms: int = 1,
        scale: str | None = None,
    ) -> Effect:
        def columns(recording: Recording, shape: Shape, _: Values) -> Columns:
            return {self.response: np.column_stack(make(recording.signals, shape))}

        part = "sensor" if cause.startswith("sensor_") else PARAMETER if cause == "parameter_drift" else "mechanical"
        return Effect(cause, at, part, names, list(shapes), columns, form=form, forms=forms, scale=scale)

    def _lag(self) -> Effect:
        def columns(recording: Recording, _: Shape, values: Values) -> Columns:
            made = recording.equations[self.response].columns
            shown = sum(
                (values.get(name, 0.0) * column for name, column in made.items()), np.zeros(len(recording.table))
            )
            step_s = recording.table.step_s
            slope = signals.per_run(recording.table, lambda part: np.gradient(part, step_s), shown)
            return {self.response: -slope[:, None]}

        return Effect("sensor_lag", self.response, "sensor", ("lag_s",), [{}], columns)

    def _load_friction(self, joint: str) -> Effect:
        """Friction in proportion to the load: to inertia, gravity and what else of the machine is not a friction.

        It is of a fit with gravity and friction, whether or not the machine has them; a load that is measured would
        explain the response by itself.
        """

        def columns(recording: Recording, _: Shape, __: Values) -> Columns:
            s, equation = recording.signals, recording.equations[self.response]
            columns = [s["rate"], s["direction"], np.ones_like(s["t"]), np.cos(s["angle"]), np.sin(s["angle"])]
            columns += equation.columns.values()
            both, valid = np.column_stack(columns), equation.valid
            size = np.linalg.lstsq(both[valid], equation.response[valid], rcond=None)[0]
            loads = [k for k, each in enumerate(columns) if np.ptp(each) > 0.0 and np.any(each * s["direction"] < 0.0)]
            return {self.response: (s["direction"] * np.abs(both[:, loads] @ size[loads]))[:, None]}

        return Effect("load_friction", joint, "mechanical", ("share",), [{}], columns)

    def _of_input(self, name: str, top: float) -> list[Effect]:
        def saturated(s: Signals, p: Shape) -> list[Array]:
            return [-np.sign(s[name]) * np.maximum(np.abs(s[name]) - p["limit"], 0.0)]

        def dead(s: Signals, p: Shape) -> list[Array]:
            return [-np.clip(s[name], -p["zone"], p["zone"])]

        limits, zones = [{"limit": share * top} for share in LIMITS], [{"zone": share * top} for share in ZONES]
        return [
            self._effect("saturation", name, ("share",), saturated, limits, scale="limit"),
            self._effect("dead_zone", name, ("share",), dead, zones, scale="zone"),
        ]

    def _of_parameters(self, recordings: Sequence[Recording]) -> list[Effect]:
        """Drifts of the parameters; one whose column is a constant drifts as the response's sensor does."""
        first = recordings[0].equations[self.response].columns
        names = [each.name for each in self.parameters if each.name in first and np.ptp(first[each.name]) > 0.0]
        return [self._effect("parameter_drift", name, ("per_s",), self._ramp(name)) for name in names]

    def _ramp(self, name: str) -> Made:
        return lambda s, _: [self.columns(s)[name] * s["t"]]

    def _of_joint(self, recordings: Sequence[Recording]) -> list[Effect]:
        top = max(_top(each.signals["rate"]) for each in recordings)
        reach = max(float(np.ptp(each.signals["angle"])) for each in recordings)
        angle_unit = next((units.unit_of(each.unit) for each in self.quantities if each.name == self.angle), RADIAN)
        turns = angle_unit is not None and angle_unit.same_kind(RADIAN)
        rad = angle_unit.factor if angle_unit is not None else 1.0  # of one unit of the angle
        cycle = 2.0 * np.pi / rad if turns else max(reach, 1e-9)

        def waves(s: Signals, p: Shape) -> list[Array]:
            angle = 2.0 * np.pi * p["periods"] * s["angle"] / cycle
            return [np.cos(angle), np.sin(angle)]

        def slow(s: Signals, p: Shape) -> list[Array]:
            return [s["direction"] * np.exp(-((s["rate"] / p["speed"]) ** 2))]

        joint = self.angle or self.rate
        found = [
            self._effect("viscous_friction", joint, ("size",), lambda s, _: [s["rate"]]),
            self._effect("coulomb_friction", joint, ("size",), lambda s, _: [s["direction"]]),
            self._effect(
                "drag", joint, ("size",), lambda s, _: [s["rate"] * np.abs(s["rate"])], form="square", forms=3
            ),
            self._effect("drag", joint, ("size",), lambda s, _: [s["rate"] ** 3], form="cube", forms=3),
            self._effect(
                "drag",
                joint,
                ("size",),
                lambda s, _: [s["direction"] * np.sqrt(np.abs(s["rate"]))],
                form="root",
                forms=3,
            ),
            self._effect("stribeck", joint, ("excess",), slow, [{"speed": share * top} for share in SPEEDS]),
            self._effect("direction_friction", joint, ("size",), lambda s, _: [np.abs(s["rate"])]),
            self._load_friction(joint),
            self._effect("spring", joint, ("size",), lambda s, _: [s["angle"]]),
            self._effect("once_per_turn", joint, ("cosine", "sine"), waves, [{"periods": n} for n in PERIODS]),
        ]
        if turns:
            found.append(
                self._effect(
                    "gravity",
                    joint,
                    ("cosine", "sine"),
                    lambda s, _: [np.cos(rad * s["angle"]), np.sin(rad * s["angle"])],
                )
            )
        return found


def _bent(table: Table, column: Array) -> Array:
    """What a straight line in time leaves of a column."""
    line = np.column_stack([np.ones(len(table)), table.time_s - table.time_s[0]])
    return np.asarray(column - line @ np.linalg.lstsq(line, column, rcond=None)[0])


def _alike(one: Array, other: Array) -> float:
    """Correlation of two columns without a mean, 0 where one of them is nothing."""
    sizes = math.sqrt(float(one @ one) * float(other @ other))
    return float(one @ other) / sizes if sizes > 0.0 else 0.0


def _top(rate: Array) -> float:
    return max(float(np.quantile(np.abs(rate), 0.98)), 1e-12)
