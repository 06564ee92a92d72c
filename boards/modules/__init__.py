"""Firmware modules that several boards share, one job each. A module knows its chip's pins, never a board's name."""
