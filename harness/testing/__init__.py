"""Tests of any machine, written like unit tests: docs/testing.md. The robot's part is ranger/testing/.

    making.py     a machine as a test orders it, new or warmed up
    wire.py       periods, jitter and latency of frames, as assertions
    health.py     checks for what no healthy machine does, at the end of each test
    forking.py    lets each test have its own branch of a warmed-up machine

Importing this package loads none of these modules.
"""
