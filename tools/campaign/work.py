"""The work of `ranger-sim campaign` after its options are read."""

import argparse
import csv
import io
import json
import os
import pathlib
import re
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from ranger_sim import loading
from ranger_sim.foundation import systems, wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import engine, group, plan, pools, summary
from ranger_sim.tools.campaign import page
from ranger_sim.tools.campaign.words import proof_text
from ranger_sim.tools.command_line import interrupts, streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file, writable_folder

RANGER = "ranger_sim.ranger.walks:WALKS"  # of a plan without [machine]; loaded for such a plan only
PROGRESS_EVERY_S = 10.0  # where there is no terminal for a progress bar
TABLES_BEGIN = "<!-- written by ranger-sim campaign --document: begin -->\n"
TABLES_END = "<!-- end -->\n"
ENCRYPTED = "tls://"
# option (as argparse names it): its name in Dask
TLS_FILES = {"tls_ca_file": "tls_ca_file", "tls_cert": "tls_client_cert", "tls_key": "tls_client_key"}
EXIT_UNSURE = 1  # a run crashed or timed out: its outcome is not known


def run(options: argparse.Namespace) -> int:
    """Run the plan; 0 done, 1 when a run crashed or timed out, 130 interrupted."""
    console = terminal.for_progress(options)
    json_file = json_target(options.json)
    if options.replay and options.json:
        raise UserError("--json: --replay prints one run; its result is in results.jsonl of the folder")
    wanted = plan.load(options.file, RANGER)
    if options.seed is not None:
        wanted = wanted.with_seed(options.seed)
    check_scheduler(options)
    folder = writable_folder(options.out or pathlib.Path("runs") / "campaigns" / wanted.name)
    campaign = engine.Campaign(wanted, folder)
    try:
        if options.replay:
            return replay(campaign, options.replay)
        if not loading.RUNS_COMPILED:
            console.print(f"running interpreted, slowly: {loading.RUNS_INTERPRETED_BECAUSE}", soft_wrap=True)
        if options.report:
            campaign.take_known()
        else:
            try:
                work(campaign, options, console)
            except KeyboardInterrupt:
                done = sum(campaign.result(case) is not None for case in campaign.cases)
                console.print(
                    f"interrupted: {done} of {campaign.foreseen} runs are kept in {folder}; the same command continues "
                    "there",
                    soft_wrap=True,
                    highlight=False,
                )
                return interrupts.EXIT_INTERRUPTED
        results = summary.of(campaign)
        write(results, folder)
        if options.document:
            into_document(pathlib.Path(options.document), results)
        if options.json == "-":
            streams.print_result(text_of(results))
        elif json_file is not None:
            replace_file(json_file, (text_of(results) + "\n").encode())
        show(results, console)
        console.print(f"page: {folder / 'index.html'}", soft_wrap=True, highlight=False)
        return EXIT_UNSURE if any(results["outcomes"][name]["count"] for name in ("crashed", "timed out")) else 0
    finally:
        campaign.close()


def check_scheduler(options: argparse.Namespace) -> None:
    """UserError for options of a Dask scheduler that contradict each other."""
    if options.scheduler and options.pool == "local":
        raise UserError("--scheduler and --pool local: a scheduler is Dask's")
    given = [f"--{name.replace('_', '-')}" for name in TLS_FILES if getattr(options, name)]
    if not given:
        return
    if not options.scheduler:
        raise UserError(f"{', '.join(given)}: only with --scheduler; --pool dask makes its own certificate")
    if not options.scheduler.startswith(ENCRYPTED):
        raise UserError(f"--scheduler {options.scheduler}: with {', '.join(given)} the address begins with {ENCRYPTED}")
    for name in TLS_FILES:
        option = f"--{name.replace('_', '-')}"
        file = getattr(options, name)
        if not file:
            raise UserError(f"{', '.join(given)}: {option} is missing; a Dask scheduler with TLS needs all three")
        if not os.path.isfile(file):
            raise UserError(f"{option} {file}: no such file")


def pool_of(options: argparse.Namespace) -> Any:
    """The pool that does the runs: processes of this machine, or Dask on request."""
    jobs = options.jobs or systems.processors()
    if options.scheduler and not options.scheduler.startswith(ENCRYPTED):
        terminal.console(stderr=True).print(  # with --quiet as well
            f"warning: the Dask scheduler at {options.scheduler} is used without TLS: any client that reaches it can "
            "run code on its workers and on this computer",
            highlight=False,
            soft_wrap=True,
        )
    if options.scheduler or options.pool == "dask":
        tls = {dask: getattr(options, name) for name, dask in TLS_FILES.items() if getattr(options, name)}
        return pools.DaskPool(options.scheduler, jobs, tls)
    return pools.LocalPool(jobs)


def work(campaign: engine.Campaign, options: argparse.Namespace, console: Console) -> None:
    """Run what is missing, with a progress bar, or lines where there is no terminal."""
    campaign.take_known()
    total, before = campaign.foreseen, len(campaign.cases)
    pool = pool_of(options)
    console.print(
        f"{campaign.plan.title}: {campaign.plan.design} of {total} runs on {pool.description}"
        + (f"; {before} of them have results already" if before else ""),
        highlight=False,
        soft_wrap=True,
    )
    begun = wallclock.monotonic_s()
    every_s = terminal.progress_every_s(options, PROGRESS_EVERY_S)
    line_at = [begun + every_s]
    since: list[tuple[int, float]] = []  # (runs done, when) as the first result of a run came: healthy walks go before
    with Progress(
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn("{task.fields[latest]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("runs", total=total, latest="")

        def report(done: int, latest: str) -> None:
            if done and not since:
                since.append((done, wallclock.monotonic_s()))
            progress.update(task, completed=done, latest=latest)
            now = wallclock.monotonic_s()
            if not console.is_terminal and now >= line_at[0]:
                line_at[0] = now + every_s
                left = ""
                if since and done > since[0][0]:
                    left = f", {(total - done) * (now - since[0][1]) / (done - since[0][0]) / 60.0:.1f} min left"
                console.print(f"{done} of {total}{left}", highlight=False)

        try:
            campaign.run(pool, report)
        finally:
            pool.close()


def text_of(results: dict[str, Any]) -> str:
    """The summary as JSON."""
    return json.dumps(results, indent=1)


def write(results: dict[str, Any], folder: pathlib.Path) -> None:
    """Summary as JSON and Markdown, the runs as CSV, and the page."""
    rows = results["rows"]
    replace_file(folder / "summary.json", (text_of(results) + "\n").encode())
    columns: dict[str, None] = {}
    for row in rows:
        columns.update(dict.fromkeys(row))
    text = io.StringIO()
    table = csv.DictWriter(text, list(columns), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    replace_file(folder / "runs.csv", text.getvalue().encode())
    replace_file(folder / "report.md", page.markdown(results).encode())
    replace_file(folder / "index.html", page.render(results).encode())


def into_document(path: pathlib.Path, results: dict[str, Any]) -> None:
    """Put the tables, with date and version, between the marks of a document. UserError when it has none."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"--document {path}: {error.strerror}") from None
    before, begin, rest = text.partition(TABLES_BEGIN)
    _, end, after = rest.partition(TABLES_END)
    if not (begin and end):
        raise UserError(f"--document {path}: it needs the lines {TABLES_BEGIN.strip()} and {TABLES_END.strip()}")
    tables = page.markdown({**results, "title": f"Results of {wallclock.today_iso()}", "description": ""})
    tables = re.sub("^#", "##", tables, flags=re.MULTILINE)
    replace_file(path, (before + begin + tables + end + after).encode())


def show(results: dict[str, Any], console: Console) -> None:
    """The outcomes in a table."""
    table = Table(box=None, pad_edge=False)
    table.add_column("outcome")
    table.add_column("runs", justify="right")
    table.add_column("share", justify="right")
    for name, share in results["outcomes"].items():
        if share["count"]:
            table.add_row(name, str(share["count"]), page.share_text(share))
    console.print(table)
    for what, share in page.coverage(results).items():
        console.print(
            f"{what}: {page.share_text(share)} ({share['count']} of {share['of']})", highlight=False, soft_wrap=True
        )


def replay(campaign: engine.Campaign, key: str) -> int:
    """Run one case again, from power-up, and compare it with its result on the disk."""
    campaign.take_known()
    for case in campaign.cases or ([] if campaign.plan.search else campaign.plan.cases()):
        if campaign.key(case).startswith(key):
            known = campaign.result(case)
            result = group.alone(case, campaign.plan.watch, campaign.healthy_of(case))
            print(proof_text(case, result))
            if known is not None and known.get("digest") != result.get("digest"):
                print(f"differs from the stored result: trace {result.get('digest')}, there {known.get('digest')}")
                return EXIT_UNSURE
            return 0
    raise UserError(f"--replay {key!r}: the plan has no such run of this version, {campaign.version}")
