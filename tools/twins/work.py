"""The work of `ranger-sim twins`."""

from __future__ import annotations

import argparse
import json
import pathlib

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ranger_sim.boards.main_brain import controllers
from ranger_sim.plant import body_files
from ranger_sim.sysid.twins import twin_file
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.twins import building, making


def run(options: argparse.Namespace) -> int:
    """Make the walks that are missing, then the file."""
    target = json_target(options.json)
    controllers.load(options.controller)  # a mistake ends before the first walk
    body_files.load(options.body)
    folder = pathlib.Path(options.work or pathlib.Path("runs") / "twins" / pathlib.Path(options.controller).stem)
    out = pathlib.Path(options.out) if options.out else building.default_path(options.controller)
    tasks = making.tasks(options.controller, options.body, options.share)
    screen = terminal.for_progress(options)
    lines = terminal.ProgressLines(screen, options)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=screen,
        transient=True,
        disable=not screen.is_terminal,
    )
    with bar:
        walks = bar.add_task("walks", total=len(tasks))

        def progress(done: int, total: int) -> None:
            bar.update(walks, completed=done, total=total)
            lines.show(f"walk {done} of {total}")

        making.make(tasks, folder, options.jobs, progress)
        bar.update(walks, description="maps and directions")
        file = building.built(tasks, folder)
    out.parent.mkdir(parents=True, exist_ok=True)
    replace_file(out, twin_file.written(file))
    text = json.dumps({name: value for name, value in file.made_of.items() if name != "parameters"}, indent=1)
    if options.json == "-":
        streams.print_result(text)
        return 0
    if target is not None:
        replace_file(target, text.encode())
    view = file.views[twin_file.FULL]
    print(f"{out}: {file.made_of['walks']} walks, {file.made_of['steps']} steps, {len(view.directions)} causes")
    return 0
