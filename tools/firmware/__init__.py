"""Firmware of one's own on a command line: in C, as an image of the chip, with a debugger."""
