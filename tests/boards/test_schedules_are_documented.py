"""docs/reference/schedules.md has every board's table as it runs: no cost, limit or priority changes unseen."""

import contextlib
import pathlib
import re

import pytest

from ranger_sim.firmware_sim.vic import FIQ
from ranger_sim.ranger.robot import Ranger

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/reference/schedules.md"
BOARDS = ("MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB")


@pytest.fixture(scope="module")
def boards():
    with contextlib.closing(Ranger()) as robot:
        yield robot.boards


def documented(board):
    """(sentence on the slots, functions, rows, interrupts) of a board, cells as text."""
    text = PAGE.read_text(encoding="utf-8").split(f"\n## {board}\n")[1].split("\n## ")[0]
    sentence, *tables = re.split(r"\n\n(?=\|)", text.strip())
    cells = [
        [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]] for table in tables
    ]
    return sentence, *cells


def test_every_board_has_its_chapter():
    assert tuple(re.findall(r"^## (\w+)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)) == BOARDS


@pytest.mark.parametrize("name", BOARDS)
def test_functions_cost_and_may_cost_what_the_page_says(boards, name):
    _, functions, _, _ = documented(name)
    runs = []
    for number, task in enumerate(boards[name].scheduler.tasks, start=1):
        item = f"{task.per_item} / {task.item}" if task.per_item else ""
        runs.append([str(number), task.name, str(task.cost), item, str(task.limit) if task.limit else "-"])
    assert functions == runs


@pytest.mark.parametrize("name", BOARDS)
def test_slots_and_rows_are_those_of_the_page(boards, name):
    sentence, functions, rows, _ = documented(name)
    slot_us, cycles, megahertz = (int(each.replace(",", "")) for each in re.findall(r"[\d,]*\d", sentence))
    assert slot_us * megahertz == cycles
    scheduler = boards[name].scheduler
    assert (slot_us, cycles, megahertz) == (scheduler.slot_ns / 1000, scheduler.slot_cycles, boards[name].hz / 1e6)
    legend = boards[name].legend()
    by_number = {int(number): function for number, function, *_ in functions}
    shown = {row: [by_number[int(number)] for number in numbers.split(", ")] for row, numbers in rows}
    lists = {f"{task.name}, in turn": task.entries for task in legend.tasks if task.entries}
    run = {str(row): numbers for row, numbers in enumerate(legend.rows)} | lists
    assert shown == {row: [legend.tasks[number].name for number in numbers] for row, numbers in run.items()}


@pytest.mark.parametrize("name", BOARDS)
def test_interrupts_have_the_costs_and_the_order_of_the_page(boards, name):
    *_, interrupts = documented(name)
    assert interrupts == [
        [
            source.name,
            str(source.cost),
            str(source.per_item or ""),
            str(source.latency),
            "FIQ" if source.slot == FIQ else str(source.slot),
        ]
        for source in boards[name].vic.sources.values()
    ]
