"""The body as a functional mock-up unit (FMI 3.0, co-simulation), for other simulators: `ranger-sim fmu FILE.fmu`."""
