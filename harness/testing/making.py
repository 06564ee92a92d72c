"""Makes the machine that a test ordered: new or warmed up, observed from power-up, perhaps with a timeline."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.testing.backends import SIM
from ranger_sim.harness.testing.wire import observe

TRACED_S = 10.0  # how much of a machine's last time its timeline keeps: some 16 steps of a robot that walks
WARM_UP_LIMIT = "1 h"  # of virtual time: the warm-up of a test fails after it
OTHERS = ("warmed_up", "trace")


class Order(Protocol):
    """The description of a machine. Equal orders give equal machines, so a warmed-up one can serve for another."""

    @property
    def seed(self) -> int: ...
    @property
    def backend(self) -> str: ...
    @property
    def warmed_up(self) -> str: ...
    @property
    def trace(self) -> bool: ...
    @property
    def branches(self) -> bool:
        """Whether a machine that is warmed up can be branched by forking."""

    def fresh(self) -> Any:
        """The machine at power-up."""

    def describe(self) -> str:
        """Its settings, in a line of a report."""

    def arguments(self) -> list[str]:
        """Options of pytest that reproduce it."""


@dataclasses.dataclass(frozen=True)
class MachineOrder:
    """A machine of the project's own: `make(**wanted)`, with the seed among them, as pairs of name and value."""

    make: Callable[..., Any]
    wanted: tuple[tuple[str, Any], ...] = ()
    seed: int = 1
    warmed_up: str = ""
    trace: bool = False
    backend: str = SIM

    @property
    def branches(self) -> bool:
        return bool(self.warmed_up)

    def fresh(self) -> Any:
        return self.make(**{"seed": self.seed, **dict(self.wanted)})

    def describe(self) -> str:
        return ", ".join([f"seed {self.seed}", *(f"{name} {value}" for name, value in self.wanted)])

    def arguments(self) -> list[str]:
        return ["--ranger-seed", str(self.seed)]


def machine_order(make: Callable[..., Any], wanted: Mapping[str, Any]) -> MachineOrder:
    """The order in keywords: `warmed_up` and `trace` are ours, the others those of `make`."""
    rest = {name: value for name, value in wanted.items() if name not in OTHERS and name != "seed"}
    try:
        hash(tuple(rest.values()))
    except TypeError:
        raise UserError(f"mark machine: {rest!r}: values that can be compared are needed, no lists") from None
    return MachineOrder(
        make,
        tuple(sorted(rest.items())),
        int(wanted.get("seed", 1)),
        str(wanted.get("warmed_up", "")),
        bool(wanted.get("trace", False)),
    )


def made(order: Order) -> Any:
    """The ordered machine, warmed up."""
    machine = order.fresh()
    observed = observe(machine)
    if order.trace:
        observed.timeline = machine.timeline(TRACED_S)
    if order.warmed_up:
        try:
            machine.until(order.warmed_up, within=WARM_UP_LIMIT)
        except BaseException:
            machine.close()
            raise
    return machine
