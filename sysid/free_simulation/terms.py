"""What a machine given by its simulator declares: outputs, joints, places where something can enter, and terms."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Effect, Values

Shape = Mapping[str, float]
Ports = Mapping[str, Array]  # an effect's input by port, (n,) or (n, k)


@dataclasses.dataclass(frozen=True)
class Output:
    """A measured channel that the simulator predicts. letter, subsystem: of the balance that its misfit accuses."""

    channel: str
    letter: str
    subsystem: str
    unit: str


@dataclasses.dataclass(frozen=True)
class Joint:
    """A state that is the rate of a moving part, so that friction can be sought there.

    rate: the state. inertia: name of the parameter, or the number, by which a torque (a force) accelerates it. drive:
    name of the input that drives this joint, of a machine whose joints move each other; what is found then is a part of
    that input, and moves all joints as it does. With neither what is found is an acceleration. position: the state that
    is its position; "": nothing periodic is sought. turns: of the part that the periods belong to, per unit of position
    over 2 pi (a gear's ratio); periods: per turn. load: signal with the transmitted torque, for friction that grows
    with it. slow: rate about which a smoothed sign turns; 0: a hundredth of the usual rate. unit: of torque or force in
    the names of coefficients.
    """

    rate: str
    inertia: str | float | None = None
    position: str = ""
    turns: float = 1.0
    periods: Sequence[float] = (1.0, 2.0, 3.0, 4.0)
    load: str = ""
    slow: float = 0.0
    drive: str = ""

    def __post_init__(self) -> None:
        if self.drive and self.inertia is not None:
            raise ModelError(
                f"joint {self.rate}: it has the inertia {self.inertia} and the drive {self.drive}; one will do"
            )

    @property
    def unit(self) -> str:
        """Of what enters, in names of coefficients."""
        return "torque" if self.inertia is not None or self.drive else "acceleration"


@dataclasses.dataclass(frozen=True)
class Port:
    """A place where something that the simulator lacks can enter: an input that is 0 as long as nothing is wrong.

    where: name of a signal, 0 ... 1, that weights everything that enters; "": it enters at all times. A torque has no
    effect where dry friction holds.
    """

    name: str
    unit: str
    subsystem: str
    where: str = ""


def shown(channel: str) -> str:
    """Name of the port at an output, which the engine adds to what `observe` returns."""
    return f"shown {channel}"


def sensed(channel: str) -> str:
    """Name of the signal of an output as it reaches its sensor, before anything that enters at its port."""
    return f"sensed {channel}"


def into(name: str) -> str:
    """Name of the port at an input, which the engine adds to it."""
    return f"into {name}"


def on(rate: str) -> str:
    """Name of the port at a joint, which the engine adds to its rate's change."""
    return f"on {rate}"


def of(parameter: str) -> str:
    """Name of the port at a parameter, which the engine adds to its value."""
    return f"of {parameter}"


@dataclasses.dataclass(frozen=True)
class Term:
    """A candidate cause, as `Effect`, given by its input at the ports.

    make(recording, shape, values) -> by port (n,) for one coefficient or (n, k) for k. recording.signals: states,
    inputs, outputs and `t` along the fitted trajectory, (n,) by name, and the signals that `SimulatedMachine.signals`
    adds. independent: it does not depend on `values`. before(recording, shape) -> by port (n, m): what was there before
    the recording may add, of deviation 1 each. The fit has these numbers while the term acts, and no answer has them.
    """

    cause: str
    at: str
    subsystem: str
    coefficients: tuple[str, ...]
    make: Callable[[Any, Shape, Values], Ports]
    shapes: Sequence[Shape] = ({},)
    admissible: Callable[[Mapping[str, float]], bool] = lambda found: True
    meaning: str = ""
    phase_is_free: bool = False
    independent: bool = False
    form: str = ""
    scale: str | None = None
    once: bool = False
    before: Callable[[Any, Shape], Ports] | None = None


@dataclasses.dataclass(frozen=True)
class SimulatedEffect(Effect):
    """A term as an effect on the outputs."""

    term: Term | None = None


@dataclasses.dataclass(frozen=True)
class Acting:
    """An effect that acts in the simulator: its term at a shape, and coefficients. unknown: these are of one recording,
    by what was there before it."""

    term: Term
    shape: Shape
    coefficients: tuple[float, ...]
    unknown: bool = False
