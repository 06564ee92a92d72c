"""Broken profiles by the thousand: whatever a file holds, it loads or every fault is named, never a traceback."""

from __future__ import annotations

import pathlib
import tempfile

from ranger_sim.foundation import wallclock
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import profile

INTERFACES = ("ranger_sim", "slcan", "socketcan", "virtual")
WORDS = (
    b'"external"', b'"absent"', b"external", b"[boards]", b"[buses.can1]", b"[[buses]]", b"MB", b"CSR", b"MCH", b"can0",
    b"bit_rate", b"schedule", b"options", b"{}", b"[]", b"=", b"\n", b"-1", b"3_000_000", b"1e999", b"nan", b"true",
    b"2026-11-21", b'"../x"', b'"\\u0000"', b'"""', b"#", b"\xff", b"\x00", b"",
)  # fmt: skip


def damaged(stream: RandomStream, good: bytes) -> bytes:
    """A good file with one to six pieces cut out, doubled, or replaced by words of the language and loose bytes."""
    content = good
    for _ in range(1 + stream.integer(6)):
        at = stream.integer(len(content) + 1)
        length = stream.integer(1 + [4, 30, 300][stream.integer(3)])
        what = stream.integer(4)
        if what == 0:
            content = content[:at] + content[at + length :]
        elif what == 1:
            content = content[:at] + content[at : at + length] + content[at:]
        elif what == 2:
            content = content[:at] + WORDS[stream.integer(len(WORDS))] + content[at + length :]
        else:
            content = content[:at] + bytes([stream.integer(256)]) + content[at + 1 :]
    return content


def benchmark(cases: int, seed: int = 1) -> dict:
    """So many damaged profiles and schedules: how many passed, how many were refused, faults named, cases per CPU s.

    Anything but a UserError ends it: that is what it looks for.
    """
    stream = RandomStream(seed, "broken profiles")
    good = (profile.FOLDER / "hil-1mbit.toml").read_bytes()
    schedule = (profile.FOLDER / profile.SCHEDULES / "1mbit.toml").read_bytes()
    passed = refused = faults = 0
    started = wallclock.process_cpu_s()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / profile.SCHEDULES).mkdir()
        path, beside = folder / "broken.toml", folder / profile.SCHEDULES / "1mbit.toml"
        for case in range(cases):
            of_schedule = case % 4 == 3
            beside.write_bytes(damaged(stream, schedule) if of_schedule else schedule)
            path.write_bytes(good if of_schedule else damaged(stream, good))
            try:
                profile.load(path, interfaces=lambda: INTERFACES)
                passed += 1
            except profile.ProfileError as error:
                refused += 1
                faults += len(error.faults)
                if not error.faults or len(str(error).splitlines()) != len(error.faults):
                    raise UserError(f"case {case}: not a line per fault: {error}") from None
    used = max(wallclock.process_cpu_s() - started, 1e-9)
    return {
        "figure": cases / used,
        "unit": "profiles per CPU s",
        "cases": cases,
        "passed": passed,
        "refused": refused,
        "faults": faults,
    }
