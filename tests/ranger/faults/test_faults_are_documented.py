"""docs/faults.md has every mode's parameters with default and limits, and the catalogue has the same."""

import math
import pathlib
import re

import pytest

from ranger_sim.ranger.faults.catalogue import CATALOGUE

PAGE = pathlib.Path(__file__).resolve().parents[3] / "docs/faults.md"
PARAMETER = re.compile(r"`(\w+)`([^`()]*)\((\S+) to (\S+?)(?: [^()]*)?\)")


def reported():
    """(place, mode, [(parameter, default or None, low, high)]) of every row of the page's tables."""
    text = PAGE.read_text(encoding="utf-8")
    found = []
    for part in re.split(r"^### ", text, flags=re.MULTILINE)[1:]:
        places = re.findall(r"`([\w.]+)`", part.split("| mode |")[0])
        for line in part.splitlines():
            if re.match(r"\| `\w+` \|", line) and places:
                cells = [cell.strip() for cell in line.strip("|").split(" | ")]
                rows = []
                for name, default, low, high in PARAMETER.findall(cells[2] if len(cells) > 2 else ""):
                    number = re.match(r"\s*(-?[\d.]+(?:e[+-]?\d+)?)\s*$", default)
                    rows.append((name, float(number[1]) if number else None, float(low), float(high)))
                found += [(place, cells[0].strip("` |"), rows) for place in places]
    return found


def test_every_parameter_of_every_fault_has_the_limits_and_the_default_of_the_page():
    CATALOGUE.load()
    compared = 0
    for place, mode, rows in reported():
        kind = CATALOGUE.modes_of(CATALOGUE.find(place))[mode]
        declared = {each.name: each for each in kind.parameters}
        for name, default, low, high in rows:
            each = declared[name]
            assert (float(f"{each.low:g}"), float(f"{each.high:g}")) == (low, high), (place, mode, name)
            assert default is None or math.isclose(each.default, default, rel_tol=1e-5), (place, mode, name)
            compared += 1
    assert compared > 100


def test_a_parameter_takes_its_limits_and_nothing_beyond():
    CATALOGUE.load()
    share = CATALOGUE.modes_of(CATALOGUE.find("MCH.motor"))["short"].parameters[0]
    assert share.checked("0", "here") == 0.0 and share.checked(0.95, "here") == 0.95
    for wrong in (-0.01, 0.96, "much", None, math.nan):
        with pytest.raises(Exception, match=r"^here: share is .*, allowed are 0 to 0.95$"):
            share.checked(wrong, "here")
