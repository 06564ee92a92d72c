"""Calibration and measurement by XCP (ASAM MCD-1 XCP 1.x): the slave, what it reads and writes, its transports."""
