"""Clock and CAN controllers of a board with firmware in C: those of its master table, or of its manifest, not both."""

import dataclasses
import pathlib
from types import SimpleNamespace

import pytest

from ranger_sim.firmware_sim.native.hardware import DEFAULT_HZ, Hardware
from ranger_sim.foundation.user_error import FirmwareError
from ranger_sim.harness.firmware.table_board import as_the_table_has_it
from tests.datatable.test_machines_of_ones_own import BOARDS, table


def firmware(folder, clock_hz=0):
    """Firmware with a master table whose board ARM has this clock."""
    at = "slot_us = 1000\nrows = [["
    table(folder, BOARDS.replace(at, f"clock_hz = {clock_hz}\n{at}", 1) if clock_hz else BOARDS)
    return SimpleNamespace(folder=pathlib.Path("arm"), manifest=SimpleNamespace(master=folder))


def test_a_board_runs_at_the_clock_of_its_table(tmp_path):
    given = Hardware(external=None)
    assert as_the_table_has_it("ARM", firmware(tmp_path, 168_000_000), given) == dataclasses.replace(
        given, hz=168_000_000
    )


def test_without_a_clock_in_the_table_the_manifest_s_counts(tmp_path):
    plain = firmware(tmp_path)
    assert as_the_table_has_it("ARM", plain, Hardware(hz=48_000_000)).hz == 48_000_000
    assert as_the_table_has_it("ARM", plain, Hardware()).hz == 0 != DEFAULT_HZ  # then NativeBoard takes the default
    assert as_the_table_has_it("OTHER", firmware(tmp_path, 48_000_000), Hardware()).hz == 0


def test_two_different_clocks_are_refused(tmp_path):
    twice = firmware(tmp_path, 48_000_000)
    assert as_the_table_has_it("ARM", twice, Hardware(hz=48_000_000)).hz == 48_000_000
    with pytest.raises(FirmwareError, match=r"^arm: hardware.hz is 60000000, and clock_hz of ARM in .* is 48000000$"):
        as_the_table_has_it("ARM", twice, Hardware(hz=60_000_000))


def test_firmware_without_a_table_keeps_its_hardware():
    alone = SimpleNamespace(folder=pathlib.Path("arm"), manifest=SimpleNamespace(master=None))
    assert as_the_table_has_it("ARM", alone, Hardware()) == Hardware()


def test_a_board_has_the_controllers_of_its_table_and_two_kinds_are_refused(tmp_path):
    at = "slot_us = 1000\nrows = [["
    table(tmp_path, BOARDS.replace(at, f'can = "fd"\n{at}', 1))
    with_fd = SimpleNamespace(folder=pathlib.Path("arm"), manifest=SimpleNamespace(master=tmp_path))
    assert as_the_table_has_it("ARM", with_fd, Hardware()).can == "fd"
    assert as_the_table_has_it("DESK", with_fd, Hardware(can="fd")).can == "fd"  # the table states nothing
    with pytest.raises(FirmwareError, match=r"^arm: hardware.can is classic, and can of ARM in .* is fd$"):
        as_the_table_has_it("ARM", with_fd, Hardware(can="classic"))
