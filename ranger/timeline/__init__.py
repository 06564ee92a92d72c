"""One timeline of a run: slots, interrupts, frames and their paths, signals, states, faults and the body."""

from ranger_sim.ranger.timeline.timeline import Timeline

__all__ = ["Timeline"]
