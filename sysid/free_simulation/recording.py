"""A recording along a simulated trajectory."""

import dataclasses
import enum
from collections.abc import Mapping

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.terms import Port, Ports
from ranger_sim.sysid.machine import Recording


class Way(enum.Enum):
    """How an input goes from a row to the next."""

    LINE = "straight line"
    CUBIC = "cubic"
    HELD = "held"
    MEAN = "mean of the step before the row"


@dataclasses.dataclass(kw_only=True)
class SimulatedRecording(Recording):
    """What terms are made of: `signals` along the trajectory, the ports at which something can enter, and by input its
    way between the rows."""

    ports: tuple[Port, ...]
    ways: Mapping[str, Way]

    def entering(self, entries: Ports) -> dict[int, Array]:
        """By number of its port (n, k): the input at the ports, (n,) or (n, k) by name, weighted by their `where`.

        UserError for an unknown port.
        """
        numbers = {port.name: number for number, port in enumerate(self.ports)}
        unknown = [name for name in entries if name not in numbers]
        if unknown:
            raise UserError(f"a term puts something into {', '.join(unknown)}; ports are {', '.join(numbers)}")
        out = {}
        for name, each in entries.items():
            number = numbers[name]
            column = each[:, None] if each.ndim == 1 else each
            where = self.ports[number].where
            out[number] = column * self.signals[where][:, None] if where else column
        return out
