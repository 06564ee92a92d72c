"""A main brain's program without its board: data table, estimator and machines, fed by hand."""

from ranger_sim.boards.main_brain import controllers
from ranger_sim.boards.main_brain.estimator import Estimator
from ranger_sim.boards.main_brain.mode_machine import ModeMachine
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.generated.all_variables import TABLE_SIZE
from ranger_sim.datatable.store import DataStore


class Bench:
    """`tick(...)` sets variables by name, advances the network time by 2 ms and runs one slot."""

    def __init__(self, controller="record-2011", quirks=None) -> None:
        quirks = quirks if quirks is not None else Quirks()
        self.store = DataStore(TABLE_SIZE)
        chosen = controllers.load(controller)
        chosen.apply(self.store)
        self.errors = []
        self.estimator = Estimator(self.store, quirks, self.errors.append)
        self.modes = ModeMachine(self.store, quirks, self.estimator, chosen.program)
        self.ms = 0
        self.set(MCFI_MID_ANKLE_ANGLE=1.68, MCFO_RIGHT_ANKLE_ANGLE=1.68)

    def set(self, **values) -> None:
        for name, value in values.items():
            number = getattr(table, name)
            if table.TYPES[number] == "f32":
                self.store.set_float(number, value)
            else:
                self.store.set_int(number, value)

    def get(self, name):
        number = getattr(table, name)
        return self.store.get_float(number) if table.TYPES[number] == "f32" else self.store.get_int(number)

    def command(self, board):
        """(I0, K, D) last sent to a motor board."""
        return tuple(self.get(f"{board}_{word}") for word in ("COMMAND_CURRENT", "STIFFNESS", "DAMPNESS"))

    def time_passes(self) -> None:
        self.ms += 2
        self.store.set_word(table.TIMESTAMP, self.ms, self.ms)

    def tick(self, **values) -> None:
        self.time_passes()
        self.set(**values)
        self.estimator.update()
        self.modes.update()

    def machines_only(self, **values) -> None:
        """A slot in which the estimates are given by hand instead of computed."""
        self.time_passes()
        self.set(**values)
        self.modes.update()

    def press(self, key) -> None:
        """A key goes down for one slot and up for one."""
        self.tick(UI_BUTTONS=1 << key)
        self.tick(UI_BUTTONS=0)

    def states(self):
        """Names of the present states: mode, leg, hip, inner foot, outer foot, steering."""
        m = self.modes
        return tuple(
            machine.current.name
            for machine in (
                m.machine,
                m.leg.machine,
                m.hip.machine,
                m.inner_foot.machine,
                m.outer_foot.machine,
                m.steering.machine,
            )
        )
