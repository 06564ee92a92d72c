"""The page's source for a robot that `up` runs: the feed supplies the data, `ctl` carries out requests."""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from typing import Any

import numpy as np

from ranger_sim import datatable
from ranger_sim.can_bus.edge import peers
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.feed import records
from ranger_sim.harness.processes import control
from ranger_sim.harness.records.sampler import PERIOD_NS
from ranger_sim.ranger.records.summary import JOULES_PER_WH
from ranger_sim.tools.panel.channels import FINE_S, Channel, Memory, Times, Trace, Values, between
from ranger_sim.tools.panel.inside.buses import Bus
from ranger_sim.tools.panel.inside.errors import ERRORS, ON_NO_BUS, ErrorList, changes
from ranger_sim.tools.panel.inside.frames import ERROR, RecentFrames, of_the_robot
from ranger_sim.tools.panel.inside.slots import BoardSlots
from ranger_sim.tools.panel.source import TRUE_POSE, Source, table_channels

CONNECT_S = 5.0
READ_BYTES = 1 << 18
STATUS_S = 0.5
FRAMES_KEPT = 1 << 18  # of each bus; chosen by us: 12 MB, 60 s of a walking robot
REQUESTS = frozenset({"key", "set", "pause", "resume", "restart", "fault", "clear", "radio"})


class RobotSource(Source):
    """The robot that runs under `name`. UserError for an unknown name or another protocol version."""

    can = frozenset(
        {"live", "keys", "parameters", "pace", "faults", "restart", "frames", "panel", "boards", "errors", "twins"}
    )
    walks = (f"the last {FINE_S:.0f} s",)

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        try:
            self.connection = peers.connected(records.address(name), f"the robot named {name}", CONNECT_S)
        except OSError:
            raise UserError(f"no robot named {name} is running here (ranger-sim up --name {name})") from None
        self.incoming = bytearray()
        hello = self._hello()
        if hello["table"] != datatable.table_hash():
            raise UserError(f"the robot named {name} has another master table than this program")
        self.title = f"{name}: {hello['controller']} on {hello['body']}, seed {hello['seed']}"
        self.geometry = hello["geometry"]
        self.weight_N: float = hello["weight_N"]
        self.start_ns: int = hello["start_ns"]
        self.streams = hello["streams"]
        self.body = [
            Channel(column, unit, column.replace("_", " "), "body") for column, unit in hello["samples"].items()
        ]
        states = {name: {int(n): text for n, text in each.items()} for name, each in hello["states"].items()}
        table = table_channels(states)
        self.slots = [BoardSlots(board["name"], board["hz"]) for board in hello["boards"]]
        self.frames = {bus["name"]: RecentFrames(FRAMES_KEPT) for bus in hello["buses"]}
        self.buses = [
            Bus(bus["name"], self.start_ns, bus["bit_per_s"], self.frames[bus["name"]], of_the_robot)
            for bus in hello["buses"]
        ]
        self.channels = [
            *self.body,
            *table.values(),
            *(each for board in self.slots for each in board.channels()),
            *(each for bus in self.buses for each in bus.channels()),
        ]
        self.first_slot = len(self.body) + len(table)  # among the channels
        self.first_load = self.first_slot + 2 * len(self.slots)
        self.identifiers = np.array(list(table))
        self.pose_names = TRUE_POSE
        self.pose_columns = [list(hello["samples"]).index(column) for column in TRUE_POSE]
        period_s = PERIOD_NS * 1e-9
        self.body_rows = Memory(len(self.body), period_s)
        self.word_rows = Memory(len(table), period_s)
        kinds = [all_variables.TYPES[number] for number in table]
        self.floats = np.array([kind == "f32" for kind in kinds])
        self.signed = np.array([kind == "i32" for kind in kinds])
        self.shown: dict[str, Any] = {}  # the newest STATE
        self.status: dict[str, Any] = {}  # the supervisor's
        self.errors = ErrorList()
        self.gaps: Counter[str] = Counter()
        self.table_errors = {number: 0 for number in ERRORS if number in table}

    def _hello(self) -> dict[str, Any]:
        """The first record."""
        while True:
            for kind, body in records.taken(self.incoming):
                hello: dict[str, Any] = json.loads(body)
                if kind != records.HELLO or hello.get("version") != records.VERSION:
                    raise UserError(f"the robot named {self.name} speaks another version of the feed")
                return hello
            try:
                data = self.connection.recv(READ_BYTES)
            except TimeoutError:
                self.connection.close()
                raise UserError(f"the robot named {self.name} has sent nothing for {CONNECT_S:g} s") from None
            if not data:
                raise UserError(f"the robot named {self.name} shows itself to {peers.LIMITS['feed'].peers} already")
            self.incoming += data

    # --- incoming data --------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Receive data until the robot ends."""
        self.connection.setblocking(False)
        reader, writer = await asyncio.open_connection(sock=self.connection, limit=READ_BYTES)
        asking = asyncio.create_task(self._ask_status())
        try:
            while True:
                for kind, body in records.taken(self.incoming):
                    self._take(kind, body)
                data = await reader.read(READ_BYTES)
                if not data:
                    break
                self.incoming += data
        except OSError:
            pass
        finally:
            asking.cancel()
            writer.close()
            self.lost = f"the robot {self.name} has ended"

    async def _ask_status(self) -> None:
        """Poll the supervisor's status some times a second: in a thread, because the reply may be slow."""
        while True:
            try:
                self.status = await asyncio.to_thread(control.ask, self.name, {"do": "status"})
            except UserError:
                self.status = {}
            await asyncio.sleep(STATUS_S)

    def _take(self, kind: int, body: bytes) -> None:
        if kind == records.STATE:
            self.shown = json.loads(body)
            for bus in self.buses:  # every frame that had begun by then has been received
                bus.passed(self.shown["time_ns"])
                bus.more_errors = self.shown["bus_errors"][bus.name] - self.frames[bus.name].total.get(ERROR, 0)
        elif kind == records.GAP:
            missed = json.loads(body)
            self.gaps.update(missed)
            for bus in self.buses:
                if bus.name in missed:
                    bus.gap()
        elif kind == records.SLOTS:
            self.slots[body[0]].take(body[1:], self.start_ns)
        elif kind == records.ROWS:
            stream = self.streams[body[0]]
            rows: Any = np.frombuffer(body[1:], np.float64 if stream["reals"] else np.int64)
            rows = rows.reshape(-1, stream["columns"])
            if stream["name"] == "samples":
                self.body_rows.append(rows[:, 0] - self.start_ns * 1e-9, rows[:, 1:].astype(np.float32))
            elif stream["name"] == "words":
                self._take_words(rows)
            else:
                self._take_frames(next(bus for bus in self.buses if bus.name == stream["name"]), rows)

    def _take_words(self, rows: Any) -> None:
        words = rows[:, 1:][:, self.identifiers]
        values = words.astype(np.float32)  # whole numbers above 2^24 lose their last digits
        raw = np.ascontiguousarray(words.astype(np.uint32))
        values[:, self.floats] = raw[:, self.floats].view(np.float32)
        values[:, self.signed] = raw[:, self.signed].view(np.int32)
        self.word_rows.append((rows[:, 0] - self.start_ns) * 1e-9, values)
        for number in self.table_errors:  # errors that reach the table without a bus
            if ERRORS[number] in ON_NO_BUS:
                for word, time_ns in changes(rows[:, 1 + number], rows[:, 0], self.table_errors[number]):
                    self.errors.note(word, (time_ns - self.start_ns) * 1e-9)
                self.table_errors[number] = int(rows[-1, 1 + number])

    def _take_frames(self, bus: Bus, rows: Any) -> None:
        self.frames[bus.name].append(rows)
        bus.take(rows)
        self.errors.note_frames(rows, self.start_ns)

    # --- displays -------------------------------------------------------------------------------------------

    def span(self) -> tuple[float, float]:
        end = self.body_rows.newest or 0.0
        return (max(0.0, end - 3600.0), end)

    def _place(self, channel: int) -> tuple[Memory, int]:
        body = len(self.body)
        if channel >= self.first_load:
            return self.buses[channel - self.first_load].memory, 0
        if channel >= self.first_slot:
            board, column = divmod(channel - self.first_slot, 2)
            return self.slots[board].memory, column
        return (self.body_rows, channel) if channel < body else (self.word_rows, channel - body)

    def trace(self, channel: int, begin: float, end: float, points: int) -> Trace:
        memory, column = self._place(channel)
        return memory.trace(column, begin, end, points)

    def samples(self, channel: int, begin: float, end: float) -> tuple[Times, Values]:
        memory, column = self._place(channel)
        times, values = memory.fine.rows()
        return between(times, values[:, column], begin, end)

    def values(self, wanted: list[int], at: float | None) -> list[float | None]:
        found: list[float | None] = []
        for channel in wanted:
            memory, column = self._place(channel)
            row = memory.row(np.inf if at is None else at)
            value = None if row is None else float(row[1][column])
            found.append(value if value is not None and np.isfinite(value) else None)
        return found

    def pose(self, at: float | None) -> tuple[float, list[float]] | None:
        row = self.body_rows.row(np.inf if at is None else at)
        return None if row is None else (row[0], [float(row[1][column]) for column in self.pose_columns])

    def state(self, at: float | None) -> dict[str, Any]:
        now_s = self.span()[1]
        return {
            "time_s": now_s,
            "panel": self.shown.get("panel"),
            "panel_unseen": self.shown.get("panel_unseen", ""),
            "steps": self.shown.get("steps", 0),
            "distance_m": self.shown.get("distance_m", 0.0),
            "speed_m_per_s": self.shown.get("speed_m_per_s", 0.0),
            "energy_Wh": self.shown.get("energy_Wh", {}),
            "tcot": self._cost_of_transport(),
            "ended": self.shown.get("ended", ""),
            "faults": self.shown.get("faults", []),
            "boards": self.status.get("boards", {}),
            "slots": {board.name: board.content(at) for board in self.slots},
            "buses": {bus.name: bus.content(at, now_s) for bus in self.buses},
            "pace": {key: self.status.get(key) for key in ("speed", "behind_s", "paused", "scheduling")},
            "errors": self.errors.content(now_s, at),
            "frames": {bus.name: bus.listed(at) for bus in self.buses},
            "left_out": dict(self.gaps),
        }

    def _cost_of_transport(self) -> float | None:
        """Energy from the battery divided by weight and distance (appendix 1); None before a step."""
        distance_m = self.shown.get("distance_m", 0.0)
        if not distance_m > 0.0:
            return None
        total_Wh: float = self.shown["energy_Wh"]["total"]
        return total_Wh * JOULES_PER_WH / (self.weight_N * distance_m)

    async def request(self, request: dict[str, Any]) -> dict[str, Any]:
        if not isinstance(request.get("do"), str) or request["do"] not in REQUESTS:
            raise UserError(f"{str(request.get('do'))[:40]!r} is not a request to a robot")
        answer: dict[str, Any] = await asyncio.to_thread(control.ask, self.name, request)
        return answer
