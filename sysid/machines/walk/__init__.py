"""The experiment `walk`: whole walking logs, with whatever channels they have."""

from ranger_sim.sysid.machines.walk.machine import Walk

__all__ = ["Walk"]
