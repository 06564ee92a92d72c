"""The old name of `ranger_sim.ranger.testing.bench`, until the next version."""

from ranger_sim.foundation import moved

__getattr__ = moved.attributes(__name__, "ranger_sim.ranger.testing.bench")
