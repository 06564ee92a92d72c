"""Writes docs/reference/schedules.md: what every board runs when, at what cost, within which limit.

python docs/schedules_table.py
"""

import pathlib

from ranger_sim.firmware_sim.vic import FIQ
from ranger_sim.ranger.robot import Ranger
from ranger_sim.tools.command_line.files import replace_file

PAGE = pathlib.Path(__file__).parent / "reference/schedules.md"
HEAD = """# Schedules

Every board's schedule: each function of its table with the cycles of a call (`cost`, and `per item`), and its limit
(`limit`; -: without one). An interrupt's cost is that of one service; its priority is
its slot of the vectored interrupt controller, 0 first, or FIQ, before all of them.
[Slot timing](../slot-timing.md) says where costs and limits come from and what they leave of a slot.

`python docs/schedules_table.py` writes this page from the boards, and a test holds both together: no number of a table
changes unseen. Where the robot's own images are at hand, another one compares costs with them
(`tests/boards/test_original_images.py`).
"""


def page() -> str:
    """The whole page."""
    lines = [HEAD]
    robot = Ranger()
    for name, board in robot.boards.items():
        legend = board.legend()
        lines += [f"## {name}", ""]
        MHz = legend.hz // 1_000_000
        lines += [f"{legend.slot_ns // 1000} us slots of {legend.slot_cycles:,} cycles at {MHz} MHz.", ""]
        lines += ["| | function | cost | per item | limit |", "|---|---|---|---|---|"]
        for number, task in enumerate(legend.tasks, start=1):
            item = f"{task.per_item} / {task.item}" if task.per_item else ""
            lines.append(f"| {number} | {task.name} | {task.cost} | {item} | {task.limit or '-'} |")
        lines += ["", "| row | functions, by their numbers |", "|---|---|"]
        for number, row in enumerate(legend.rows):
            lines.append(f"| {number} | {', '.join(str(1 + task) for task in row)} |")
        for task in legend.tasks:
            if task.entries:
                lines.append(f"| {task.name}, in turn | {', '.join(str(1 + entry) for entry in task.entries)} |")
        lines += ["", "| interrupt | cost | per item | latency | priority |", "|---|---|---|---|---|"]
        for source in board.vic.sources.values():
            priority = "FIQ" if source.slot == FIQ else source.slot
            lines.append(f"| {source.name} | {source.cost} | {source.per_item or ''} | {source.latency} | {priority} |")
        lines.append("")
    robot.close()
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    replace_file(PAGE, page().encode())
