"""Recordings as files: those that a run writes, and those of any kind that are read."""
