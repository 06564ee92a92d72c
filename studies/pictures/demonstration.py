"""The recording of README.md's first commands: python -m studies.pictures.demonstration (from a checkout, a minute).

The commands of the section "In a minute" after `make walk` are run in order in a folder of their own; what they print
is drawn as a terminal, with the middle of long outputs left out.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

from rich.console import Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

ROOT = pathlib.Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "demonstration.svg"
WIDTH = 112
SLOT = re.compile(r"^E  ")  # the picture of a slot in a failed test


def commands():
    """The commands of the section, without the set-up."""
    section = (ROOT / "README.md").read_text(encoding="utf-8").partition("## In a minute")[2].partition("\n## ")[0]
    lines = [line for block in re.findall(r"```sh\n(.*?)```", section, re.DOTALL) for line in block.splitlines()]
    return [line for line in lines if not line.startswith(("make ", ". "))]


def without_time(line):
    """pytest's last line; a picture that is made again is the same."""
    return line.partition(" in ")[0]


def shown(command, printed):
    """The lines that a reader needs."""
    lines = printed.splitlines()
    if command.startswith("pytest") and any(map(SLOT.match, lines)):
        return [line[7:] for line in lines if SLOT.match(line)][:-3] + [without_time(lines[-1])]
    if command.startswith("pytest"):
        return [without_time(lines[-1])]
    if "--proof" in command:
        return [line for line in lines if "MCH" in line or "fell" in line]
    if "diagnose" in command:
        return [lines[0], *lines[-2:]]
    return lines if "new" in command else []


def main():
    console = Console(record=True, width=WIDTH + 8, file=open(os.devnull, "w", encoding="utf-8"), force_terminal=True)
    path = f"{pathlib.Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    with tempfile.TemporaryDirectory() as folder:
        os.symlink(ROOT / "examples", pathlib.Path(folder, "examples"))
        for command in commands():
            done = subprocess.run(
                ["sh", "-c", command],
                cwd=folder,
                env={**os.environ, "PATH": path, "COLUMNS": str(WIDTH)},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
            console.print(Text("$ " + command.partition("  #")[0], style="bold green"))
            for line in shown(command, done.stdout.replace(folder, "~")):
                console.print(Text(line))
    PICTURE.write_text(
        console.export_svg(title="ranger-sim", theme=MONOKAI, unique_id="demonstration"), encoding="utf-8"
    )
    print(PICTURE)


if __name__ == "__main__":
    main()
