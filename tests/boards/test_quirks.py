"""The table of disagreements and the dataclass of switches say the same."""

import pathlib
from dataclasses import fields

import pytest

from ranger_sim import boards
from ranger_sim.boards.quirks import Quirks
from ranger_sim.foundation.user_error import UserError

TABLE = pathlib.Path(boards.__file__).parent / "QUIRKS.md"


def rows():
    """Cells of every line of the first table (the one with switches)."""
    text = TABLE.read_text().split("## Without a switch")[0]
    lines = [line for line in text.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_every_switch_has_exactly_one_line_of_the_table_and_no_line_lacks_its_switch():
    named = [row[3].strip("`") for row in rows()]
    assert named == [each.name for each in fields(Quirks)]


def test_defaults_and_values_of_2016_in_the_table_are_those_of_the_dataclass():
    by_name = {each.name: each for each in fields(Quirks)}
    for row in rows():
        each = by_name[row[3].strip("`")]
        assert row[4].strip("`") == str(each.default), each.name
        assert row[5].strip("`") == str(each.metadata["firmware"]), each.name


def test_every_line_has_what_the_appendix_says_and_what_the_firmware_does():
    for row in rows():
        assert len(row) == 6
        assert all(len(cell) > 0 for cell in row)


def test_lines_without_a_switch_give_the_reason():
    text = TABLE.read_text().split("## Without a switch")[1].split("## Our own departures")[0]
    lines = [line for line in text.splitlines() if line.startswith("|")][2:]
    assert len(lines) >= 10
    for line in lines:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        assert len(cells) == 4 and all(cells), line


def test_our_own_departures_are_listed_with_the_reason():
    text = TABLE.read_text().split("## Our own departures")[1]
    lines = [line for line in text.splitlines() if line.startswith("|")][2:]
    assert len(lines) >= 7
    for line in lines:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        assert len(cells) == 3 and all(cells), line


def test_every_switch_sets_the_value_of_2016():
    firmware = Quirks.firmware_2016()
    for each in fields(Quirks):
        assert getattr(firmware, each.name) == each.metadata["firmware"]
    assert firmware.contact_equal_samples == 11
    assert firmware.proportional_current_control is False


def test_a_value_that_is_not_allowed_is_reported_in_one_line():
    with pytest.raises(UserError, match=r"quirk imu_packets: 'all' is not allowed .*'rates'"):
        Quirks(imu_packets="all")
    with pytest.raises(UserError, match="contact_equal_samples: 0 is not allowed"):
        Quirks(contact_equal_samples=0)
    with pytest.raises(UserError, match="speed_limiter: 1 is not allowed"):
        Quirks(speed_limiter=1)


def test_an_unknown_switch_is_reported_in_one_line():
    with pytest.raises(UserError, match="no such switch"):
        Quirks.named(speed_limitter=False)
    assert Quirks.named(speed_limiter=False).speed_limiter is False
