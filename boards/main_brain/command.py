"""What a machine sends to a motor board, and the ids of the data table's variables."""

from typing import TYPE_CHECKING

import cython

from ranger_sim.datatable.generated import mb as table

if TYPE_CHECKING:
    from ranger_sim.datatable.store import DataStore


def table_id(name):
    """Number of the variable `name` in the data table."""
    return getattr(table, name)


def variables_of(machine: type) -> tuple[str, ...]:
    """Names of the variables of the data table of which a machine's class declares a field, in alphabetical order."""
    fields = {*vars(machine), *vars(machine).get("__annotations__", ())}
    return tuple(sorted(name for name in fields if name.isupper()))


@cython.cclass
class MotorCommand:
    """The three words of the compliant law I = I0 - K p - D dp/dt of one motor board.

    board: prefix of its variables ("MCH"). All three are rewritten on every call, so the link sends them
    in every slot, as the machines of 2011 did (robot.md C1.2).
    """

    store: "DataStore"
    current_id: cython.longlong
    stiffness_id: cython.longlong
    dampness_id: cython.longlong

    def __init__(self, store, board) -> None:
        self.store = store
        self.current_id = table_id(f"{board}_COMMAND_CURRENT")
        self.stiffness_id = table_id(f"{board}_STIFFNESS")
        self.dampness_id = table_id(f"{board}_DAMPNESS")

    @cython.ccall
    def send(self, current_A: cython.double, stiffness: cython.double, dampness: cython.double) -> None:
        """I0 in A, K in A/rad, D in A s/rad."""
        self.store.set_float(self.current_id, current_A)
        self.store.set_float(self.stiffness_id, stiffness)
        self.store.set_float(self.dampness_id, dampness)

    @cython.ccall
    def off(self) -> None:
        """A passive motor."""
        self.send(0.0, 0.0, 0.0)
