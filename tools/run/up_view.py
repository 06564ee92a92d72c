"""What `ranger-sim up` prints: the live view of a run, and its processes at the end."""

from __future__ import annotations

from rich.console import Console
from rich.live import Live
from rich.table import Table

from ranger_sim.can_bus.edge.peers import reasons_text as counts_text
from ranger_sim.foundation import wallclock
from ranger_sim.harness.processes.supervisor import ELSEWHERE, RUNNING, View
from ranger_sim.tools.run import walk

PLAIN_S = 2.0  # between two lines without a terminal


def print_processes(found: dict, console: Console) -> None:
    """The table of lateness."""
    table = lateness_table({name: each["lateness"] for name, each in found["boards"].items()})
    console.print(table)
    console.print(
        f"{found['paced_factor'] or 0.0:.2f} x real time by the wall clock, "
        f"{sum(each['turns_per_s'] for each in found['boards'].values()):.0f} turns per second of the robot's time"
        + ("; frames or bytes arrived from outside: this run cannot be repeated" if found["asynchronous"] else ""),
        highlight=False,
    )
    for name, counts in found["outside"].items():
        used = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in counts.items() if value)
        console.print(f"{name} outside: {used or 'no traffic'}", highlight=False, soft_wrap=True)
    for endpoint, counts in found["sent_away"].items():
        console.print(f"{endpoint}: sent away {counts_text(counts)}", highlight=False, soft_wrap=True)
    for death in found["deaths"]:
        console.print(walk.loss_text(death), highlight=False, soft_wrap=True)


def micro(value: float | None) -> str:
    """A time in us, or a dash."""
    return "-" if value is None else f"{value:.0f}"


def lateness_table(lateness: dict) -> Table:
    """How late slots were, by board, in us."""
    table = Table(title="lateness of slots, us", box=None, pad_edge=False)
    for heading in ("board", "slots", "p50", "p99", "p99.9", "max"):
        table.add_column(heading, justify="left" if heading == "board" else "right")
    for name, each in lateness.items():
        table.add_row(
            name, str(each["slots"]), *(micro(each[key]) for key in ("p50_us", "p99_us", "p999_us", "max_us"))
        )
    return table


class PlainView(View):
    """Lines for where there is no terminal."""

    def __init__(self, console: Console, every_s: float = PLAIN_S) -> None:
        self.console = console
        self.every_s = every_s
        self.next_s = 0.0

    def show(self, state: dict) -> None:
        """A line now and then."""
        now = wallclock.monotonic_s()
        if now < self.next_s or "time_s" not in state:
            return
        self.next_s = now + self.every_s
        loads = " ".join(f"{100.0 * each['load']:.0f}" for each in state["buses"].values())
        late = max((each["lateness"]["p99_us"] or 0.0) for each in state["boards"].values())
        expected = (RUNNING, ELSEWHERE)
        wrong = [f"{name} {each['state']}" for name, each in state["boards"].items() if each["state"] not in expected]
        self.say(
            f"{state['time_s']:.1f} s, {state['steps']} steps, {state['distance_m']:.2f} m, loads {loads} %, "
            f"late p99 {late:.0f} us" + (", paused" if state["paused"] else "") + "".join(f", {each}" for each in wrong)
        )

    def say(self, text: str) -> None:
        self.console.print(text, highlight=False, soft_wrap=True)


class LiveView(View):
    """A table that is redrawn in place; what happens is printed above it."""

    def __init__(self, console: Console) -> None:
        self.console = console
        # no thread of its own: the supervisor forks
        self.live: Live | None = Live(console=console, auto_refresh=False, transient=True)
        self.started = False

    def show(self, state: dict) -> None:
        """Draw it."""
        if self.live is None or "time_s" not in state:
            return
        if not self.started:
            self.started = True
            self.live.start()
        self.live.update(self.picture(state), refresh=True)

    def picture(self, state: dict) -> Table:
        """The whole view: the robot in two lines, then its boards."""
        loads = "  ".join(
            f"{name} {100.0 * each['load']:.0f} %" + (f" ({each['errors']} errors)" if each["errors"] else "")
            for name, each in state["buses"].items()
        )
        pace = "as fast as it goes" if state["speed"] is None else f"speed {state['speed']:g}"
        late = state["behind_s"]
        caption = f"{loads}\n{state['scheduling']}" + "".join(f"\n{text}" for text in state["damage"])
        for counters in state["ends"]:
            used = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in counters.items() if value)
            caption += f"\n{used}" if used else ""
        table = Table(
            title=f"{state['time_s']:.1f} s ({pace}{', paused' if state['paused'] else ''}"
            f"{f', {late:.1f} s behind' if late > 0.1 and state['speed'] is not None else ''}), "
            f"{state['steps']} steps, {state['distance_m']:.2f} m, {state['speed_m_per_s']:.2f} m/s",
            caption=caption,
            caption_justify="left",
            title_justify="left",
        )
        for heading in ("board", "process", "state", "slots", "longest us", "overruns", "errors"):
            table.add_column(heading, justify="left" if heading in ("board", "state") else "right")
        for heading in ("late p50", "p99", "p99.9", "max us"):
            table.add_column(heading, justify="right")
        for name, each in state["boards"].items():
            lateness = each["lateness"]
            table.add_row(
                name,
                str(each["process"]),
                each["state"],
                str(each["slots"]),
                f"{each['max_slot_us']:.0f}",
                str(each["overruns"]),
                str(each["errors"]),
                *(micro(lateness[key]) for key in ("p50_us", "p99_us", "p999_us", "max_us")),
            )
        return table

    def say(self, text: str) -> None:
        self.console.print(text, highlight=False, soft_wrap=True)

    def close(self) -> None:
        if self.live is not None and self.started:
            self.live.stop()
        self.live = None
