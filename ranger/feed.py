"""The feed's endpoint, in the process that passes the robot's time. Viewers send nothing, and change nothing.

A slow viewer is shown gaps. When all places are taken and another viewer connects, one with gaps gives up its place.
"""

from __future__ import annotations

import socket
from collections import Counter
from typing import Any

from ranger_sim import datatable
from ranger_sim.can_bus.edge.peers import LIMITS, MALFORMED, REASONS, Peer, PeerServer, SocketStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.feed import records
from ranger_sim.ranger.conditions import STATE_VARIABLES, state_names
from ranger_sim.ranger.faults.power import PowerlessBoard
from ranger_sim.ranger.records.summary import energy

POLL_NS = 20_000_000  # virtual time between two polls: 50 pictures a second at real time
STATE_NS = 100_000_000
SLOT_BYTES = 24


class FeedServer(PeerServer[Peer]):
    """Shows `robot` under `name`. Give it to `robot.attach`. UserError when the name is taken.

    Without viewers, it costs one poll for connections every 20 ms of the robot's time.
    """

    def __init__(self, robot: Any, name: str) -> None:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listener.bind(records.address(name))
        except OSError:
            listener.close()
            raise UserError(f"a robot named {name} is already running: choose another --name") from None
        listener.listen(LIMITS["feed"].peers)
        listener.setblocking(False)
        super().__init__("feed", listener)
        self.robot = robot
        self.name = name
        self.streams = list(robot.recorder.streams())
        self.left_out: dict[int, Counter[str]] = {}  # by peer, since the last GAP record to it
        self.greeting = b""  # the first record, while there are viewers
        self.next_state_ns = 0
        self.boards: dict[str, Any] = {}  # those that report their slots
        self.slots_shown: dict[str, int] = {}
        self.totals = {"viewers_seen": 0, "rows_left_out": 0}
        for number, stream in enumerate(self.streams):
            robot.logbook.listen(stream, self._taker(number, stream))

    def _taker(self, number: int, stream: str) -> Any:
        head = bytes([number])

        def take(rows: Any) -> None:
            if self.peers:
                record = records.record(records.ROWS, head + rows.tobytes())
                for peer in self.peers:
                    self._offer(peer, record, stream, len(rows))

        return take

    def _offer(self, peer: Peer, record: bytes, stream: str, rows: int) -> None:
        """Send an unrequested record; it is left out while too much waits for this peer."""
        if peer.ending:
            return
        missed = self.left_out[id(peer)]
        if len(peer.outgoing) + len(record) > self.limits.backlog:
            missed[stream] += rows
            self.totals["rows_left_out"] += rows
            return
        if missed:
            peer.outgoing += records.text_record(records.GAP, dict(missed))
            missed.clear()
        peer.outgoing += record

    def poll(self, now_ns: int) -> int:
        """Accept new viewers and send them what happened; returns the latest time for the next poll, ns."""
        self.receive(now_ns)
        if self.peers:
            self.robot.logbook.flush()
            self._show_slots()
            if now_ns >= self.next_state_ns or self.robot.ended:
                self.next_state_ns = now_ns + STATE_NS
                record = records.text_record(records.STATE, self.state(now_ns))
                for peer in self.peers:
                    self._offer(peer, record, "state", 1)
            self.write()
        return now_ns + POLL_NS

    def _show_slots(self) -> None:
        """Send the slots that the boards' processes have kept since the last poll."""
        for number, (name, board) in enumerate(self.boards.items()):
            rows, self.slots_shown[name], missed = board.slots_since(self.slots_shown[name])
            record = records.record(records.SLOTS, bytes([number]) + rows)
            for peer in self.peers:
                if missed:
                    self.left_out[id(peer)][f"slots of {name}"] += missed
                if rows:
                    self._offer(peer, record, f"slots of {name}", len(rows) // SLOT_BYTES)

    def state(self, now_ns: int) -> dict[str, Any]:
        """What no stream holds: the panel of the user interface board, faults, distance walked."""
        robot, outside, unseen = self.robot, self._outside(), why_unseen(self.robot)
        return {
            "time_ns": now_ns,
            "panel": None if unseen else list(robot.loop.board("UI").memory),
            "panel_unseen": unseen,
            "steps": robot.steps,
            "distance_m": robot.distance_m,
            "speed_m_per_s": robot.mean_speed_m_per_s(),
            "energy_Wh": energy(robot),
            "ended": robot.ended,
            "faults": [fault.summary() for fault in robot.faults if fault.twin is None],
            "bus_errors": {bus.name: outside.get(bus.name, bus.counters).errors for bus in robot.buses},
        }

    def _outside(self) -> dict[str, Any]:
        """{bus: its connection to a real one} of buses that are not emulated (can_bus/edge/external_bus.py)."""
        return {end.name: end for end in self.robot.polled if hasattr(end, "bit_rate")}

    def hello(self) -> dict[str, Any]:
        """The robot's name, and what the streams hold."""
        robot, outside = self.robot, self._outside()
        return {
            "version": records.VERSION,
            "name": self.name,
            "start_ns": robot.start_ns,
            "table": datatable.table_hash(),
            "seed": robot.scenario.seed,
            "controller": robot.scenario.controller,
            "body": robot.scenario.body,
            "log": robot.logbook.mode,
            "streams": [
                {
                    "name": stream,
                    "columns": robot.recorder.streams()[stream].columns,
                    "reals": robot.recorder.streams()[stream].is_real,
                }
                for stream in self.streams
            ],
            "buses": [
                {"name": bus.name, "bit_per_s": outside[bus.name].bit_rate if bus.name in outside else bus.bitrate}
                for bus in robot.buses
            ],
            "boards": [{"name": name, "hz": robot.boards[name].hz} for name in self.boards],
            "samples": dict(robot.plant.sample_names),
            "states": {
                variable: names
                for machine, variable in STATE_VARIABLES.items()
                if (names := state_names(robot, machine))
            },
            "geometry": robot.plant.geometry(),
            "weight_N": robot.plant.parameters.total_mass_kg * robot.plant.parameters.gravity_m_per_s2,
        }

    def _welcome(self, connection: socket.socket) -> Peer:
        peer = Peer(SocketStream(connection))
        if not self.peers:  # boards have separate processes by now; unseen slots are dropped
            there = {name: self.robot.loop.board(name) for name in self.robot.boards}
            self.boards = {name: board for name, board in there.items() if hasattr(board, "slots_since")}
            self.slots_shown = {name: board.slots_since(0)[1] for name, board in self.boards.items()}
            self.greeting = b""
        self.left_out[id(peer)] = Counter()
        self.robot.loop.sampler.words = self.robot.recorder.words  # also of a robot that keeps no log
        self.totals["viewers_seen"] += 1
        if not self.greeting:  # building it takes half a millisecond
            self.greeting = records.text_record(records.HELLO, self.hello())
        peer.outgoing += self.greeting
        return peer

    def _takes_part(self, peer: Peer) -> bool:
        """A viewer keeps its place as long as it reads what it is sent."""
        return not self.left_out.get(id(peer))

    def _take(self, peer: Peer) -> bool:
        """Accept no input: requests have their own endpoint (`ranger-sim ctl`)."""
        if peer.incoming:
            self.send_away(peer, MALFORMED)
        return False

    def _closed(self, peer: Peer) -> None:
        self.left_out.pop(id(peer), None)
        if not self.left_out and not self.robot.logbook.records_words:
            self.robot.loop.sampler.words = None

    def counters(self) -> dict[str, int]:
        """Whole numbers by name: viewers now and seen, rows left out, and peers sent away, by reason."""
        away = {f"sent_away_{reason}": self.sent_away[reason] for reason in REASONS}
        return {"viewers": len(self.peers), **self.totals, **away}


def why_unseen(robot: Any) -> str:
    """Why the front panel's state is unknown here, in a sentence; empty where it is known."""
    board, profile = robot.loop.board("UI"), robot.profile
    if profile is not None and "UI" in profile.external():
        return "The user interface board is outside: its own display, lights and buzzer show what it drives."
    if profile is not None and "UI" in profile.absent():
        return "This run does not have a user interface board."
    if isinstance(board, PowerlessBoard):
        return "The user interface board is without power or held in reset."
    if getattr(board, "gone", False):
        return "The user interface board is lost: its process has ended."
    return ""
