"""Tests of firmware against the emulated robot, written like unit tests: docs/testing.md.

    robots.py     a robot by a plain call, for hypothesis, notebooks and scripts: `new_robot`
    bench.py      a single board (`BoardAlone`), a single bus (`BusAlone`), driven by the test
    replay.py     a recorded log into one board
    plugin.py     the same as fixtures of pytest, with the checks and branches of harness/testing/

Importing this package loads none of these modules.
"""
