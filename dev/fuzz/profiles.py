"""Broken profiles: every file either loads or has all its faults named, never a traceback."""

from __future__ import annotations

import pathlib
import tempfile

from dev.fuzz import Finding
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.outside import profile

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


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run that many damaged profiles and schedules; counts those accepted, those refused, and the faults named.

    Any exception other than ProfileError is a finding and propagates with its case, located by its traceback.
    """
    stream = RandomStream(seed, "broken profiles")
    good = (profile.FOLDER / "hil-1mbit.toml").read_bytes()
    schedule = (profile.FOLDER / profile.SCHEDULES / "1mbit.toml").read_bytes()
    passed = refused = faults = 0
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
            except profile.FaultyProfileError as error:
                refused += 1
                faults += len(error.faults)
                if not error.faults or len(str(error).splitlines()) != len(error.faults):
                    raise Finding(f"not a line per fault: {error} (case {case})") from None
            except Exception as error:
                error.add_note(f"python -m dev.fuzz profiles: seed {seed}, case {case}")
                raise
    return {"cases": cases, "passed": passed, "refused": refused, "faults": faults}
