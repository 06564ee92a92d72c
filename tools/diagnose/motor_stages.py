"""`ranger-sim diagnose --experiment motor-stage`: options, screen, files.

The work is `sysid/machines/motor_stage.py`.
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table as RichTable

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.machines import motor_stage
from ranger_sim.sysid.machines.motor_stage import Result, Stage
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file, writable_folder
from ranger_sim.tools.recordings import datasets

EXIT_CLEAN, EXIT_FOUND, EXIT_TOO_LITTLE = 0, 1, 3
DIGITS = {"lag": 3, "current_zero": 3}


def run(options: argparse.Namespace) -> int:
    """The command."""
    for name in ("holdout_part", "gear"):
        if getattr(options, name) is not None:
            raise UserError(f"--{name.replace('_', '-')}: {motor_stage.NAME} has no use for it")
    target = json_target(options.json)
    folder = writable_folder(options.out) if options.out else None
    body = body_files.load(options.model or "ranger")
    data, held = (_opened(options, paths) for paths in (options.data, options.holdout))
    found = motor_stage.diagnose(data, held, body)
    answer = json.dumps({"body": body.name, **found.to_dict()}, indent=1, allow_nan=False)
    if folder is not None:
        replace_file(folder / "diagnosis.json", answer.encode())
    if options.json == "-":
        streams.print_result(answer)
    else:
        if target is not None:
            replace_file(target, answer.encode())
        show(found, body.name, terminal.console())
    return EXIT_FOUND if found.detected else EXIT_CLEAN if found.compared else EXIT_TOO_LITTLE


def _opened(options: argparse.Namespace, paths: Sequence[str]) -> list[Dataset]:
    """Tables with one sample a row, which no other experiment reads, or what every experiment reads."""
    return [motor_stage.read_long(pathlib.Path(path)) or datasets.open_with(options, path) for path in paths]


def show(found: Result, body: str, console: Console) -> None:
    """Print the table of every board, and what differs."""
    table = RichTable(box=None, pad_edge=False)
    for name in ("board", "value", "unit", "found", "95 %", f"body {body}", ""):
        table.add_column(name, justify="right" if name in ("found", f"body {body}") else "left", no_wrap=True)
    for stage in found.stages.values():
        for number, value in enumerate(stage.values.values()):
            digits = DIGITS.get(value.name, 2)
            table.add_row(
                stage.board if not number else "",
                value.name,
                value.unit,
                f"{value.value:.{digits}f}",
                f"{value.low:.{digits}f} to {value.high:.{digits}f}",
                "" if value.simulated is None else f"{value.simulated:.{digits}f}",
                "differs" if value.differs else "",
            )
    odd = [f"{stage.board} {value.name}" for stage in found.stages.values() for value in stage.values.values()
           if value.differs]  # fmt: skip
    text = (
        f"the body {body} differs from the meters in {', '.join(odd)}"
        if odd
        else f"the meters agree with the body {body}"
    )
    if not found.compared:
        text = "too little was measured at rest to compare anything"
    console.print(text, highlight=False, soft_wrap=True)
    console.print(table, highlight=False)
    for stage in found.stages.values():
        console.print(sentence(stage), highlight=False, soft_wrap=True)
        for note in stage.notes:
            console.print(f"{stage.board}: {note}", highlight=False, soft_wrap=True)


def sentence(stage: Stage) -> str:
    """What a board's values rest on, and what they predict."""
    text = f"{stage.board}: {stage.holds} holds, {stage.holds_with_current} of them with a current"
    if stage.moving:
        text += f", {stage.moving} samples in motion"
    if stage.held_out_holds:
        before = "" if math.isnan(stage.held_out_before_W) else f"{stage.held_out_before_W:.2f} W by the body, "
        text += f"; {stage.held_out_holds} held-out holds: error {before}{stage.held_out_after_W:.2f} W by these values"
        text += f", {stage.held_out_inside:.0%} within their scatter"
    return text
