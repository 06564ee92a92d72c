"""Which lines of firmware in C ran in tests: one folder of counts per library, below the folder of a pytest run."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import pathlib

from ranger_sim.firmware_sim.native import coverage
from ranger_sim.firmware_sim.native.coverage import FileCounts
from ranger_sim.harness.firmware.native_firmware import Firmware

ABOUT = "firmware.json"  # next to counts: their firmware


def counting(firmware: Firmware, counts: str) -> Firmware:
    """Firmware that was built for coverage, with its folder below `counts`."""
    library, folder = str(firmware.library.resolve()), str(firmware.folder.resolve())
    place = pathlib.Path(counts) / hashlib.blake2b(library.encode(), digest_size=8).hexdigest()
    place.mkdir(parents=True, exist_ok=True)
    (place / ABOUT).write_text(json.dumps({"library": library, "folder": folder}), encoding="utf-8")
    return dataclasses.replace(firmware, counts=place)


def counted(counts: pathlib.Path) -> list[FileCounts]:
    """The lines of firmware that ran in all the tests that had `counts` as their folder."""
    found = []
    for about in sorted(counts.glob(f"*/{ABOUT}")):
        build = json.loads(about.read_text(encoding="utf-8"))
        found.append(coverage.read(pathlib.Path(build["library"]), pathlib.Path(build["folder"]), about.parent))
    return coverage.merged(found)
