"""Hostile users of `ranger-sim ctl` and of the feed: requests that reach a walking robot, and viewers of every kind.

One case is one request (faults of every place, mode, parameter and condition, their ends, the stick, keys, parameters),
admitted by the supervisor's endpoint and executed by the body's process, or one action of a viewer of the feed. A
refusal is a line. After every few cases the robot walks on: no admitted request may stop its program, the feed's
endpoint keeps its limits, and a viewer that reads receives the events.
"""

from __future__ import annotations

import json
import os
import socket
from contextlib import closing, suppress
from typing import Any

from dev.fuzz import Connection, Finding
from ranger_sim.can_bus.edge.peers import LIMITS
from ranger_sim.datatable import parameters
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults.catalogue import MODES
from ranger_sim.harness.feed import records
from ranger_sim.harness.processes.plant_process import PlantRun
from ranger_sim.ranger import requests
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.ranger.feed import FeedServer
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

SLICE_S = 0.002
CASES_PER_SLICE = 8
POLLS_TO_SHOW = 50  # for a viewer that reads: later events arrive with the next one
VIEWERS = 6  # two more than there are places
ROBOT_S = 3.0  # then another one walks: a robot takes 255 faults
NUMBERS = ("0", "1", "-1", "0.5", "7", "100", "-3000", "1e9", "1e-9", "1e400", "nan", "", "x", "0x10", "1_000", "٣")
CONDITIONS = (
    *("{n} s", "{n} ms", "step {n}", "hip in HI_premid", "hip in {n}", "MCH_ANGLE > {n}", "hip_rad < {n}", "fell"),
    *("error AE_SPIKE from MCH", "+{n} ms", "", "{n}", "FSM_HIP == {n}", "step", "now", "MCH_ANGLE"),
)


class Body(PlantRun):
    """The body process's handling of a request, for a robot whose boards are all in this process."""

    def __init__(self, robot: Ranger) -> None:
        self.robot = robot
        self.orders, self.orders_ns = 0, -1
        self.answers: list[dict[str, Any]] = []

    def report(self, **content: Any) -> None:
        """The answer that the user gets."""
        self.answers.append(content)


class Viewer(Connection):
    """A viewer program, which reads or not, and perhaps sends something."""

    def __init__(self, name: str) -> None:
        super().__init__(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
        try:
            self.socket.connect(records.address(name))
        except OSError:
            self.gone = True


class Fuzz:
    """`case()` is one case, `walk()` lets the robot walk on and checks it; Finding when a check fails."""

    def __init__(self, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "requests fuzz")
        self.seed = seed
        self.names = tuple(row.name for row in parameters.parameters())
        self.cases = self.robots = self.admitted = self.refused = self.armed = self.acted = self.shown = 0
        self.viewers: list[Viewer] = []
        self._start()

    def _start(self) -> None:
        """A new robot with its feed."""
        self.robots += 1
        self.robot = Ranger(Scenario(seed=self.seed + self.robots))
        self.name = f"fuzz-requests-{os.getpid()}-{self.robots}"
        self.feed = FeedServer(self.robot, self.name)
        self.feed.clock = lambda: self.robot.loop.time * 1e-9
        self.robot.attach(self.feed)
        self.body = Body(self.robot)
        self.viewers = [Viewer(self.name) for _ in range(VIEWERS)]
        self.good = Viewer(self.name)

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def one_of(self, choices: Any) -> Any:
        return choices[self.number(len(choices))]

    def condition(self) -> str:
        """A time at which a fault begins or ends, or almost."""
        return str(self.one_of(CONDITIONS)).format(n=self.number(40) / self.one_of((1, 1, 10, -1)))

    def fault_text(self) -> str:
        """A fault as typed: mostly with a matching place and mode."""
        place = self.one_of(tuple(CATALOGUE.places.values()))
        kinds = [name for kind, name in MODES if kind == place.kind] if self.number(8) else [name for _, name in MODES]
        mode = str(self.one_of(kinds)) if kinds else "stuck"
        kept = MODES.get((place.kind, mode))
        names = tuple(each.name for each in kept.parameters) if kept is not None else ()
        text = f"{place.name}:{mode}"
        for name in names:
            if self.number(3):
                likely = str(self.number(200) / self.one_of((1, 10, -1)))
                text += f",{name}={likely if self.number(3) else self.one_of(NUMBERS)}"
        if self.number(12) == 0:
            text += f",{self.one_of(('x', 'force', ''))}={self.one_of(NUMBERS)}"
        if self.number(2):
            text += f"@{self.condition()}" + (f"..{self.condition()}" if self.number(2) else "")
        if self.number(20) == 0:
            place_of_change = self.number(len(text))
            text = (
                text[:place_of_change]
                + self.one_of((":", "@", ",", "..", "=", "\0", "é", ""))
                + text[place_of_change + 1 :]
            )
        return text

    def request(self) -> dict[str, Any]:
        """A user's request."""
        what = self.number(10)
        if what < 5:
            return {"do": "fault", "fault": self.fault_text()}
        if what == 5:
            return {"do": "clear", "which": self.one_of((0, 1, self.number(300), -1, 1.5, None, "0"))}
        if what == 6:
            return {
                "do": "radio",
                "stick": self.one_of((0.0, 1, -1, self.number(200) / 100 - 1, 1.01, "x", None, 1e30)),
            }
        if what == 7:
            return {"do": "key", "key": self.one_of((0, 1, 2, 3, 4, 5, 6, -1, True, "1"))}
        name = self.one_of(self.names)
        row = parameters.find(name)
        least, most = row.minimum, row.maximum
        value = self.one_of((least, most, 0, 1, -1, (self.number(2000) - 1000) / 10, 1e30, "x"))
        return {"do": "set", "name": name, "value": value}

    def case(self) -> None:
        """One request, or one action of a viewer."""
        self.cases += 1
        if self.number(4) == 0:
            self.look()
            return
        line = json.dumps(self.request()).encode()
        try:
            asked = requests.admitted(line)
        except UserError as fault:
            self.refusal(str(fault))
            return
        if asked.do == "set":  # it reaches the main brain's process through the channel, which has its own fuzzer
            self.robot.board("MB").memory[parameters.find(asked.name).id] = asked.word
            self.admitted += 1
            return
        self.body.answers.clear()
        self.body.obey({"do": asked.do, "key": asked.key, "fault": asked.fault, "which": asked.which,
                        "stick": asked.stick, "number": 1})  # fmt: skip
        (answer,) = self.body.answers
        if "error" in answer:
            self.refusal(answer["error"])
        else:
            self.admitted += 1
            self.armed += asked.do == "fault"

    def refusal(self, text: str) -> None:
        """Count it; it must be a printable line."""
        self.refused += 1
        if not text or "\n" in text or len(text) > LIMITS["control"].longest:
            raise Finding(f"a refusal is not a line: {text[:100]!r} (case {self.cases})")

    def look(self) -> None:
        """A viewer connects, leaves, stops reading, or sends something."""
        place, what = self.number(VIEWERS), self.number(6)
        viewer = self.viewers[place]
        if viewer.gone or what == 0:
            viewer.socket.close()
            self.viewers[place] = Viewer(self.name)
        elif what == 1:
            viewer.reads = not viewer.reads
        elif what == 2:
            with suppress(OSError):
                viewer.socket.send(bytes(self.number(256) for _ in range(self.number(100))))

    def walk(self) -> None:
        """The robot walks on, and viewers receive it."""
        self.robot.run_for(SLICE_S)
        if len(self.feed.peers) > LIMITS["feed"].peers:
            raise Finding(f"{len(self.feed.peers)} viewers (case {self.cases})")
        for peer in self.feed.peers:
            if len(peer.outgoing) > LIMITS["feed"].backlog + LIMITS["feed"].unread:
                raise Finding(f"{len(peer.outgoing)} bytes wait for a viewer (case {self.cases})")
        for viewer in (*self.viewers, self.good):
            if viewer.reads:
                viewer.hear()
                self.understand(viewer)
        if self.good.gone:  # another one was accepted first, and there was no place
            self.good.socket.close()
            self.good = Viewer(self.name)
        if self.robot.ended or self.robot.time_s > ROBOT_S:
            self.end()
            self._start()

    def understand(self, viewer: Viewer) -> None:
        """Whole records, of the kinds there are; what is JSON has finite numbers."""
        for kind, body in records.taken(viewer.heard):
            if kind in (records.HELLO, records.GAP, records.STATE):
                json.loads(body, parse_constant=self._no_number)
            elif kind != records.ROWS:
                raise Finding(f"a record of kind {kind} (case {self.cases})")
            self.shown += 1

    def _no_number(self, text: str) -> None:
        raise Finding(f"{text} in a record (case {self.cases})")

    def end(self) -> None:
        """Count, and release everything."""
        self.acted += sum(fault.acted for fault in self.robot.faults)
        if self.robot.time_s > 2 * POLLS_TO_SHOW * SLICE_S and not self.shown:
            raise Finding(f"no client was shown anything (case {self.cases})")
        json.dumps(self.robot.summary(), allow_nan=False)
        for viewer in (*self.viewers, self.good):
            viewer.socket.close()
        self.feed.close()
        self.robot.close()

    def close(self) -> None:
        """Release the rest."""
        self.end()


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counts."""
    fuzz = Fuzz(seed)
    with closing(fuzz):
        try:
            while fuzz.cases < cases:
                for _ in range(min(CASES_PER_SLICE, cases - fuzz.cases)):
                    fuzz.case()
                fuzz.walk()
        except Exception as error:
            if not isinstance(error, Finding):
                error.add_note(f"python -m dev.fuzz requests: seed {seed}, case {fuzz.cases}")
            raise
    return {
        "cases": fuzz.cases,
        "robots": fuzz.robots,
        "admitted": fuzz.admitted,
        "refused": fuzz.refused,
        "faults_armed": fuzz.armed,
        "faults_that_acted": fuzz.acted,
        "records_shown": fuzz.shown,
    }
