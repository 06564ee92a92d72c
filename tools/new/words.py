"""Names and numbers in a new project: of boards, and as the languages of its files have them."""

import itertools
import re

LONGEST_NAME = 8  # of a board, by the master table
SILENT_WORDS = {"MOTOR", "ACTUATOR", "JOINT", "TORQUE", "SERVO", "DRIVE"}


def board_name(name: str, taken: set[str], longest: int = LONGEST_NAME) -> str:
    """A name of at most 8 letters, digits and underscores that is not taken: FL_KNEE of front_left_knee_motor."""
    words = [each for each in re.split(r"[\W_]+", name.upper(), flags=re.ASCII) if each]
    while len(words) > 1 and words[-1] in SILENT_WORDS:
        words.pop()
    if len("_".join(words)) > longest and len(words) > 1:
        words = ["".join(each[0] for each in words[:-1]), words[-1]]
    short = "_".join(words)[:longest].strip("_")
    short = short if short[:1].isalpha() else f"J{short}"[:longest]
    for number in itertools.count(1):
        end = "" if number == 1 else str(number)
        found = f"{short[: longest - len(end)]}{end}"
        if found not in taken:
            break
    taken.add(found)
    return found


def quoted(text: str) -> str:
    """A string of Python."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def single(value: float) -> str:
    """A number as a float of C, without its suffix."""
    text = f"{value:.8g}"
    return text if "." in text or "e" in text else f"{text}.0"


def variant(text: str, fd: bool) -> str:
    """The lines of a template for this kind of bus: some begin with the one that they are for."""
    left_out, marked = ("[% classic %]", "[% fd %]") if fd else ("[% fd %]", "[% classic %]")
    lines = [line.removeprefix(marked) for line in text.splitlines(keepends=True) if not line.startswith(left_out)]
    return "".join(lines)
