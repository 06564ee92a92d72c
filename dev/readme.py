"""python -m dev.readme: README and tutorial as a stranger reads them, from `make walk` on.

Every command is run in the order in which it appears, in a copy of this tree without what git ignores, in the
environment that `make walk` makes there. Prints each with its seconds; ends with 1 after a command that ended with
another code than the page says (`# exit code 1`), or that printed a traceback. `make docs` runs this.
"""

import argparse
import dataclasses
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping

from ranger_sim.foundation import wallclock

ROOT = pathlib.Path(__file__).resolve().parents[1]
LONGEST_S = 1800.0  # `make walk` compiles
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
FILE_NAME = re.compile(r"(?:# ([\w-]+\.(?:py|toml))|/\* ([\w-]+\.c) \*/|<!-- ([\w-]+\.xml) -->)\n")
FILE_KINDS = ("python", "toml", "c", "xml")  # blocks whose first line may be such a name
EXIT_CODE = re.compile(r"#.*\bexit code (\d+)")


@dataclasses.dataclass(frozen=True)
class Done:
    """A command that was run. wanted: the exit code that the page says."""

    line: str
    wanted: int
    code: int
    printed: str
    seconds: float

    @property
    def is_right(self) -> bool:
        """True if it ended as the page says, without a traceback."""
        return self.code == self.wanted and "Traceback" not in self.printed

    def text(self) -> str:
        """A line of the table; after it what a wrong one printed."""
        line = f"{self.seconds:7.1f} s  code {self.code}  {self.line}"
        return (
            line
            if self.is_right
            else f"{line}\n--- wrong: code {self.wanted} is expected; the end of its output:\n" + (self.printed[-3000:])
        )


def copied(top: pathlib.Path) -> pathlib.Path:
    """A copy of the files that git knows, or would know; links as links."""
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0"):
        if name and os.path.lexists(ROOT / name):
            (top / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, top / name, follow_symlinks=False)
    return top


def of_a_stranger() -> dict[str, str]:
    """The environment variables, without those of the environment in which this program runs."""
    ours = str(pathlib.Path(sys.prefix) / "bin")
    path = os.pathsep.join(each for each in os.environ["PATH"].split(os.pathsep) if each != ours)
    kept = {name: value for name, value in os.environ.items() if name not in ("VIRTUAL_ENV", "PYTHONPATH")}
    kept = {name: value for name, value in kept.items() if not name.startswith(("RANGER_SIM", "PYTEST", "MAKE"))}
    return {**kept, "PATH": path, "PYTHON": base_python(), "COLUMNS": "120"}


def base_python() -> str:
    """The interpreter of which this environment was made."""
    return str(pathlib.Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}")


def in_order(page: pathlib.Path, folder: pathlib.Path, environment: Mapping[str, str]) -> Iterator[Done]:
    """Every `sh` line of a page, run in `folder` with its files written before; `. FILE` holds for those after it."""
    before = ""
    for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        named = FILE_NAME.match(text)
        if named and kind in FILE_KINDS:
            (folder / (named[1] or named[2] or named[3])).write_text(text, encoding="utf-8")
        for line in filter(None, text.splitlines() if kind == "sh" else ()):
            if line.startswith(". "):
                before += f"{line} && "
                continue
            wanted = EXIT_CODE.search(line)
            began = wallclock.monotonic_s()
            run = subprocess.run(
                ["sh", "-c", before + line],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                check=False,
                timeout=LONGEST_S,
            )
            yield Done(
                line, int(wanted[1]) if wanted else 0, run.returncode, run.stdout, wallclock.monotonic_s() - began
            )


def pages(top: pathlib.Path) -> Iterator[Done]:
    """README in the copy's top folder, then the tutorial in a new folder."""
    environment = of_a_stranger()
    yield from in_order(top / "README.md", top, environment)
    lesson = top / "lesson"
    lesson.mkdir()
    active = {**environment, "PATH": f"{top / '.venv' / 'bin'}{os.pathsep}{environment['PATH']}"}
    yield from in_order(top / "docs" / "tutorial.md", lesson, active)


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m dev.readme", description=(__doc__ or "").partition("\n")[0])
    parser.parse_args(arguments)
    all_right = True
    with tempfile.TemporaryDirectory() as folder:
        for done in pages(copied(pathlib.Path(folder, "ranger-sim"))):
            print(done.text(), flush=True)
            all_right &= done.is_right
    return 0 if all_right else 1


if __name__ == "__main__":
    sys.exit(main())
