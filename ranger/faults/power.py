"""Faults of the supply: the battery's, and one board's."""

import math
from typing import Any

from ranger_sim.firmware_sim.activity import ActivityLog
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, Place, WholeNumber
from ranger_sim.harness.faults.reach import emulated, reaching_into, wake_buses
from ranger_sim.harness.firmware.fresh_board import first_outputs, fresh_board, pass_on
from ranger_sim.ranger import wiring
from ranger_sim.ranger.faults.catalogue import CATALOGUE

BATTERY = "battery"
SUPPLY = "board supply"
RESET, OPERATING = 1, 0  # modes of a bus node
# From power-up or reset to the first instruction of a board's program; chosen by us as for a board that gets
# a new process (harness/processes): supply and oscillator settle in about a millisecond.
START_NS = 1_000_000

CATALOGUE.add_places([Place("battery", BATTERY, "the packs that feed motors and electronics")])
CATALOGUE.add_places(
    Place(f"{name}.supply", SUPPLY, f"the supply of {name}", {"board": name}) for name in wiring.BOARDS
)


class BatteryFault(Fault):
    """Another voltage behind the same load; measured by the voltage missing at the present currents."""

    kinds = (BATTERY,)
    needs = "the battery"
    unit = "V"

    def connect(self) -> None:
        self.battery: Any = self.robot.plant.electrics.battery

    def healthy_V(self) -> float:
        """The voltage that the battery would have at the present currents without this fault (EQUATIONS 10.8)."""
        raise NotImplementedError

    def after(self, start_ns: int, end_ns: int) -> None:
        taken = self.healthy_V() - self.battery.voltage_V
        if abs(taken) > 1e-9:  # rounding of a voltage of 25 V is 4e-15 V
            self.note(end_ns, taken)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether the voltage is that of the parameters, charge and current."""
        battery = self.battery
        resistance_ohm = battery.parameters.pack_resistance_ohm / battery.parameters.packs
        charge_before = battery.charge + battery.current_A * (end_ns - start_ns) * 1e-9 * battery.per_As
        open_V = _open_circuit_V(battery, charge_before)
        return math.isclose(battery.voltage_V, open_V - resistance_ohm * battery.current_A, rel_tol=1e-9)


def _open_circuit_V(battery: Any, charge: float) -> float:
    """Voltage without load by the parameters, linear between the points of the cell's curve."""
    p = battery.parameters
    place = min(max(charge, 0.0) * (len(p.cell_volts) - 1), len(p.cell_volts) - 1.0)
    i = min(int(place), len(p.cell_volts) - 2)
    below, above = p.cell_volts[i], p.cell_volts[i + 1]
    return float(p.cells_in_series * (below + (above - below) * (place - i)))


@mode
class Sag(BatteryFault):
    """A worn or cold battery: more resistance inside, less voltage without load, or both."""

    mode = "sag"
    meaning = "sags: more resistance inside, or less voltage"
    parameters = (
        Parameter(
            "ohm", "ohm", 0.1, 0.0, 5.0, "more resistance",
            "chosen by us: seven packs have 0.07 ohm, one has 0.5 (plant/electrics/battery.py)",
        ),
        Parameter("drop", "V", 0.0, 0.0, 15.0, "less voltage without load", "chosen by us: none; 15 V leave a third"),
    )  # fmt: skip

    def begin(self, now_ns: int) -> None:
        self._put(1.0)

    def finish(self, now_ns: int) -> None:
        self._put(-1.0)

    def _put(self, sign: float) -> None:
        battery = self.battery
        battery.resistance_ohm += sign * self.values["ohm"]
        if sign < 0.0:
            battery.resistance_ohm = round(battery.resistance_ohm, 15)  # 0.1 + 0.2 - 0.2 is not 0.1
        for place in range(len(battery.curve)):
            volts = battery.parameters.cells_in_series * battery.parameters.cell_volts[place]
            battery.curve[place] = volts - (self.values["drop"] if sign > 0.0 else 0.0)
        battery.open_voltage_V = battery.open_circuit_V(battery.charge)

    def healthy_V(self) -> float:
        return float(self.battery.voltage_V + self.values["ohm"] * self.battery.current_A + self.values["drop"])


@mode
class PackLost(BatteryFault):
    """Some packs lose contact: the others carry their current. At the end they return with the charge they had."""

    mode = "pack_lost"
    meaning = "loses packs: the others carry the current"
    parameters = (WholeNumber("packs", "1", 1, 1, 100, "number of packs", "chosen by us: a plug; the robot has seven"),)

    def connect(self) -> None:
        BatteryFault.connect(self)
        if self.values["packs"] >= self.battery.parameters.packs:
            raise FaultError(
                f"fault {self.text()}: there are {self.battery.parameters.packs} packs, and without any of them the"
                " robot is switched off; one has to be left"
            )

    def begin(self, now_ns: int) -> None:
        battery = self.battery
        self.usual = (battery.resistance_ohm, battery.per_As)
        packs = battery.parameters.packs
        self.left = (packs - int(self.values["packs"])) / packs
        self.charge_lost = battery.charge
        battery.resistance_ohm /= self.left
        battery.per_As /= self.left

    def finish(self, now_ns: int) -> None:
        battery = self.battery
        battery.resistance_ohm, battery.per_As = self.usual
        battery.charge = self.left * battery.charge + (1.0 - self.left) * self.charge_lost  # the packs equalise
        battery.open_voltage_V = battery.open_circuit_V(battery.charge)

    def healthy_V(self) -> float:
        return float(self.battery.voltage_V + (self.battery.resistance_ohm - self.usual[0]) * self.battery.current_A)


class PowerlessBoard(Board):
    """A substitute for a board without power: it discards its inputs, and does nothing."""

    def __init__(self, before: Any) -> None:
        Board.__init__(self, before.name)
        self.inbox = before.inbox
        self.next_time = NEVER
        self.swing = before.watched()
        self.memory = before.memory
        self.errors = getattr(before, "errors", None)  # the errors that it had recorded
        self.slot_time = before.latest_slot()
        self.counted = before.counters()
        self.log = before.scheduler.log  # of its activity, which the board continues when it returns
        self.buffers: list[Any] = []

    def connect_edges(self, buffer: Any, pin: int, partner_pin: int) -> None:
        """Ignore edges at its pins."""
        self.buffers.append(buffer)

    def advance(self, until: int) -> int:
        """Discard what arrived before `until` (ns)."""
        while self.inbox.head_time < until:
            self.inbox.take()
        for buffer in self.buffers:
            buffer.read = buffer.count
        self.horizon = until
        self.next_time = NEVER
        return NEVER

    def watched(self) -> int:
        """Unchanged."""
        return int(self.swing)

    def latest_slot(self) -> int:
        """That of the board that lost its power."""
        return int(self.slot_time)

    def activity(self) -> Any:
        """That of the board that lost its power, and of the one that returns."""
        if self.log is None:
            self.log = ActivityLog()
        return self.log

    def counters(self) -> Any:
        """Those of the board that lost its power."""
        return self.counted


class Restart(Fault):
    """A board's program ends in the middle, and starts again later on a new board.

    All state that a power-up clears is cleared: all variables, the router's time, the main brain's data table. Crystal,
    wires, bus schedule and swapped schedules of the profile stay; functions that a test put into its schedule do not.
    """

    unit = "boards"

    def connect(self) -> None:
        self.name = self.restarts = self.place.details["board"]
        self.where = f"fault {self.text()}"
        emulated(self.robot, self.name, self.where)
        if self.robot.polled:
            raise FaultError(f"{self.where}: ends outside hold on to this board; start them in separate processes")
        self.back_ns = NEVER
        self.slots_before = 0

    def down_ns(self) -> int:
        """How long it is without power or held in reset."""
        raise NotImplementedError

    def begin(self, now_ns: int) -> None:
        robot, name = self.robot, self.name
        with reaching_into(robot, name, now_ns) as board:
            for bus, node in self._nodes():
                bus.set_mode(node, RESET, now_ns)
            board.break_off(now_ns)
            robot.loop.replace(PowerlessBoard(board))
            self.stop_motor(now_ns)
        self.back_ns = now_ns + self.down_ns() + START_NS
        wake_buses(robot, now_ns)
        self.note(now_ns, 1.0)

    def stop_motor(self, now_ns: int) -> None:
        """Set the state of its bridge."""

    def before(self, now_ns: int) -> None:
        if now_ns >= self.back_ns:
            self.back_ns = NEVER
            self._come_back(now_ns)
            if self.end is None:
                self.ended_ns = now_ns

    def finish(self, now_ns: int) -> None:
        if self.back_ns < NEVER:
            self.back_ns = NEVER
            self._come_back(now_ns)

    def _nodes(self) -> list[tuple[Any, int]]:
        wires = self.robot.loop.wires[self.robot.loop.place(self.name)]
        return [(bus, wires.nodes[controller]) for controller, bus in enumerate(wires.buses) if bus is not None]

    def _come_back(self, now_ns: int) -> None:
        robot, name, loop = self.robot, self.name, self.robot.loop
        place = loop.place(name)
        off = loop.boards[place]
        off.advance(now_ns)
        board = fresh_board(robot, name, now_ns)
        sent = first_outputs(board)
        board.inbox = off.inbox  # buses, link and operator write there
        board.keep_activity(off.log)
        robot.boards[name] = board
        for bus, node in self._nodes():
            bus.nodes[node].renew(name)
            bus.nodes[node].unplug()
            bus.set_mode(node, OPERATING, now_ns)
        loop.replace(board)
        pass_on(sent, loop.wires[place], now_ns)
        loop.due[place] = loop.arrival[place] = now_ns
        loop.wires[place].silent_until = 0
        wake_buses(robot, now_ns)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether its new program runs slots, and its controllers take part."""
        board = self.robot.loop.board(self.name)
        return bool(
            board.latest_slot() > self.activated_ns
            and all(bus.nodes[node].mode == OPERATING for bus, node in self._nodes())
        )


@mode
class BrownOut(Restart):
    """A board's supply fails for a while: its processor stops, its bridge opens, its transceiver releases the bus."""

    mode = "brown_out"
    kinds = (SUPPLY,)
    needs = "the supply of a board"
    meaning = "fails for a while: its board stops, its motor has no power, and its program begins anew"
    parameters = (
        Parameter("off_ms", "ms", 20.0, 0.25, 60_000.0, "without power", "chosen by us: a contact that bounces"),
    )

    def down_ns(self) -> int:
        return round(1e6 * self.values["off_ms"])

    def stop_motor(self, now_ns: int) -> None:
        """Open the bridge: its drivers have no supply, so no transistor conducts from now on."""
        motor = wiring.MOTORS.get(self.name)
        if motor is not None:
            drive = self.robot.plant.motors[motor].drive
            drive.low_side(now_ns, False, False)
            drive.power_off_ns = now_ns
            drive.next_change_ns = now_ns
