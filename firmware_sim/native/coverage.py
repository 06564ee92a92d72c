"""Which lines and branches of a program in C ran: gcov's counts, read by the gcov of the compiler.

A board writes its counts into a separate folder (`NativeBoard.write_counts`); the compiler's notes are next to the
library. The report covers only the firmware's own files, not the table's.
"""

import dataclasses
import json
import pathlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from typing import Any

from ranger_sim.firmware_sim.native.compiler import compiler
from ranger_sim.foundation.user_error import FirmwareError

PREFIX = "GCOV_PREFIX"  # where libgcov writes to
LONGEST_S = 120.0  # some seconds for large programs


@dataclasses.dataclass
class FileCounts:
    """How often each line of `path` with code ran; branches: for each line, how often each was taken."""

    path: pathlib.Path
    lines: dict[int, int] = dataclasses.field(default_factory=dict)
    branches: dict[int, list[int]] = dataclasses.field(default_factory=dict)
    functions: dict[str, tuple[int, int]] = dataclasses.field(default_factory=dict)  # name: (line, calls)

    def add(self, other: "FileCounts") -> None:
        """Counts of the same file from elsewhere."""
        for line, count in other.lines.items():
            self.lines[line] = self.lines.get(line, 0) + count
        for line, counts in other.branches.items():
            before = self.branches.get(line, [0] * len(counts))
            self.branches[line] = [a + b for a, b in zip(before, counts, strict=True)]
        for name, (line, calls) in other.functions.items():
            self.functions[name] = (line, calls + self.functions.get(name, (line, 0))[1])

    @property
    def missed(self) -> list[int]:
        """Lines that did not run."""
        return [line for line, count in sorted(self.lines.items()) if count == 0]

    def figures(self, folder: pathlib.Path) -> dict[str, Any]:
        """For a summary; the file's name relative to `folder`."""
        taken = [count for counts in self.branches.values() for count in counts]
        return {
            "file": _shown(self.path, folder),
            "lines": len(self.lines),
            "covered": sum(1 for count in self.lines.values() if count),
            "branches": len(taken),
            "taken": sum(1 for count in taken if count),
            "missed": spans(self.missed),
        }


def gcov() -> str:
    """The program that reads what the compiler's programs wrote."""
    path = pathlib.Path(compiler())
    name = path.name.replace("gcc", "gcov") if "gcc" in path.name else "gcov"
    found = shutil.which(str(path.with_name(name))) or shutil.which("gcov")
    if found is None:
        raise FirmwareError(f"{path} has no gcov beside it: --coverage needs gcc with its gcov")
    return found


def notes_of(library: pathlib.Path) -> pathlib.Path:
    """The folder of the compiler's notes of a library with coverage."""
    return library.with_suffix(".notes")


def read(library: pathlib.Path, folder: pathlib.Path, counts: pathlib.Path) -> list[FileCounts]:
    """The counts of each file of the firmware in `folder`, from all counts below the folder `counts`; by name.

    A file without written counts has none: all its lines are reported as not run.
    """
    files: dict[pathlib.Path, FileCounts] = {}
    with tempfile.TemporaryDirectory(prefix="ranger-sim-gcov-") as work:
        place = pathlib.Path(work)
        for note in sorted(notes_of(library).glob("*.gcno")):
            written = sorted(counts.rglob(f"{note.stem}.gcda"))
            for number, data in enumerate(written) if written else ((0, None),):
                each = place / f"{number}"
                each.mkdir(exist_ok=True)
                shutil.copyfile(note, each / note.name)
                if data is not None:
                    shutil.copyfile(data, each / data.name)
                for found in _told(each, note.stem):
                    if found.path.is_relative_to(folder.resolve()):
                        files.setdefault(found.path, FileCounts(found.path)).add(found)
    return [files[path] for path in sorted(files)]


def _told(place: pathlib.Path, stem: str) -> list[FileCounts]:
    """gcov's output for one object's notes and counts in the folder `place`."""
    command = [gcov(), "--json-format", "--stdout", "--branch-probabilities", f"{stem}.gcno"]
    done = subprocess.run(command, cwd=place, capture_output=True, check=False, timeout=LONGEST_S)
    found = []
    try:
        for line in done.stdout.splitlines():
            said = json.loads(line)
            base = pathlib.Path(said["current_working_directory"])
            found += [_file(base / each["file"], each) for each in said["files"]]
    except (ValueError, KeyError, TypeError):
        why = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no reason is given"]
        raise FirmwareError(f"{command[0]}: {stem}: its answer does not read as JSON of gcov: {why[0]}") from None
    return found


def _file(path: pathlib.Path, said: dict[str, Any]) -> FileCounts:
    counts = FileCounts(path.resolve())
    for each in said["lines"]:
        line = each["line_number"]
        counts.lines[line] = counts.lines.get(line, 0) + each["count"]
        if each["branches"]:
            counts.branches[line] = counts.branches.get(line, []) + [branch["count"] for branch in each["branches"]]
    for each in said["functions"]:
        counts.functions[each["name"]] = (each["start_line"], each["execution_count"])
    return counts


def lcov(files: Iterable[FileCounts]) -> str:
    """An lcov tracefile, as genhtml, Codecov and editors read it: `man geninfo`, "FILES"."""
    lines = []
    for file in files:
        lines += ["TN:", f"SF:{file.path}"]
        lines += [f"FN:{line},{name}" for name, (line, _) in sorted(file.functions.items())]
        lines += [f"FNDA:{calls},{name}" for name, (_, calls) in sorted(file.functions.items())]
        lines += [f"FNF:{len(file.functions)}", f"FNH:{sum(1 for _, calls in file.functions.values() if calls)}"]
        for line, counts in sorted(file.branches.items()):
            reached = file.lines.get(line, 0) > 0
            lines += [f"BRDA:{line},0,{i},{count if reached else '-'}" for i, count in enumerate(counts)]
        taken = [count for counts in file.branches.values() for count in counts]
        lines += [f"BRF:{len(taken)}", f"BRH:{sum(1 for count in taken if count)}"]
        lines += [f"DA:{line},{count}" for line, count in sorted(file.lines.items())]
        lines += [f"LF:{len(file.lines)}", f"LH:{len(file.lines) - len(file.missed)}", "end_of_record"]
    return "\n".join(lines) + "\n" if lines else ""


def merged(several: Iterable[Iterable[FileCounts]]) -> list[FileCounts]:
    """Counts of the same files from several boards, added."""
    files: dict[pathlib.Path, FileCounts] = {}
    for each in several:
        for file in each:
            files.setdefault(file.path, FileCounts(file.path)).add(file)
    return [files[path] for path in sorted(files)]


def spans(numbers: list[int]) -> str:
    """`3-7, 12`; what follows another one directly is taken together."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][1] + 1:
            parts[-1][1] = number
        else:
            parts.append([number, number])
    return ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in parts)


def _shown(path: pathlib.Path, folder: pathlib.Path) -> str:
    folder = folder.resolve()
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else path.name
