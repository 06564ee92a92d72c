"""Timelines of a run: their model, what any machine shows in them, and the formats of their files."""

from ranger_sim.foundation import moved

__getattr__ = moved.attributes(__name__, "ranger_sim.ranger.timeline", "Timeline")
