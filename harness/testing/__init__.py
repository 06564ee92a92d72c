"""Tests of firmware against the emulated robot, written like unit tests: docs/testing.md.

    robots.py     a robot by a plain call, for hypothesis, notebooks and scripts: `new_robot`
    bench.py      a single board (`BoardAlone`), a single bus (`BusAlone`), driven by the test
    wire.py       periods, jitter and latency of frames, as assertions
    health.py     checks for what no healthy robot does, at the end of each test
    replay.py     a recorded log into one board
    plugin.py     the same as fixtures of pytest; forking.py lets each test have its own branch of a warmed-up robot

Importing this package loads none of these modules.
"""
