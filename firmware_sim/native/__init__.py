"""Firmware in C, compiled for this computer, in an emulated board's place."""
