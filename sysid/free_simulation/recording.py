"""A recording along a simulated trajectory."""

import dataclasses

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.terms import Port, Ports
from ranger_sim.sysid.machine import Recording


@dataclasses.dataclass(kw_only=True)
class SimulatedRecording(Recording):
    """What terms are made of: `signals` along the trajectory, and the ports at which something can enter."""

    ports: tuple[Port, ...]

    def entering(self, entries: Ports) -> Array:
        """(n, ports, k): the input at the ports, (n,) or (n, k) by name, weighted by each port's `where`."""
        columns = {name: each[:, None] if each.ndim == 1 else each for name, each in entries.items()}
        out = np.zeros((len(self.table), len(self.ports), next(iter(columns.values())).shape[1]))
        for number, port in enumerate(self.ports):
            if port.name in columns:
                out[:, number] = columns[port.name]
                if port.where:
                    out[:, number] *= self.signals[port.where][:, None]
        return out
