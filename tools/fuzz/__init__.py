"""Fuzzers: hostile input by the thousand against one part of the robot each, everything checked after every case.

A fuzzer is a module with `run(cases, seed)`: it returns what it counted, and raises `Finding` as soon as something is
not as it must be. The same seed gives the same cases. `command` is `ranger-sim fuzz`.
"""


class Finding(Exception):  # noqa: N818  (no error of the fuzzer)
    """What a fuzzer looks for: the program did not stand the case that the text names."""
