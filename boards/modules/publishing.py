"""What a satellite or the router publishes: one line per variable, laid out in rows as the master table says.

The master table (`datatable/master/boards.toml`) says which variable goes out in which row, because bounds, DBC files
and supervision need that of boards whose firmware is not ours, too. A board's room says where a value comes from and
what sending it costs: a `Send` for each variable, in the order in which boards.toml names them first.
"""

import cython

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.sender import Sender
from ranger_sim.firmware_sim.calls import call
from ranger_sim.firmware_sim.scheduler import Task
from ranger_sim.foundation.numbers import word_of_float, word_of_i32
from ranger_sim.foundation.user_error import FirmwareError


@cython.final
@cython.cclass
class Publication:
    """A variable that a sender's frames carry: what `function()` returns, or always the same `constant`."""

    sender: Sender
    identifier: cython.longlong
    function: object
    constant: cython.double
    whole: cython.bint

    def __init__(self, sender: Sender, identifier, function, constant, whole) -> None:
        self.sender = sender
        self.identifier = identifier
        self.function = function
        self.constant = constant
        self.whole = whole

    def send(self) -> object:
        """A line of the schedule: take the value, make a frame of it as the table's type. Returns 1, or 0 for 0."""
        word: cython.longlong
        if self.function is None:
            word = word_of_float(self.constant)
        elif self.whole:
            word = word_of_i32(call(self.function))
        else:
            word = word_of_float(call(self.function))
        self.sender.build(self.identifier, word, self.sender.time.ms)
        return 1 if word != 0 else 0


@cython.final
@cython.cclass
class ErrorPublication:
    """The error variable of a board: the error that waits longest, if one does."""

    sender: Sender
    identifier: cython.longlong
    errors: ErrorModule

    def __init__(self, sender: Sender, identifier, errors: ErrorModule) -> None:
        self.sender = sender
        self.identifier = identifier
        self.errors = errors

    def send(self) -> object:
        """A line of the schedule; returns how many errors it took, 0 or 1."""
        if self.errors.take():
            self.sender.build(self.identifier, self.errors.word, self.errors.stamp)
            return 1
        return 0


class Send:
    """One published variable in a board's table: its name, its value, modelled cycles, and the limit on them.

    `value`: a function without arguments, a number that never changes, or the board's ErrorModule. Units are those of
    the master table. `cost` is that of the whole line; what the sender does of it later (`Sender.late_cycles`) is taken
    off. `more`: cycles that it costs beside that when the value is not 0, or when an error waits: the library's
    conversion of a whole number has next to nothing to do with a 0.
    """

    def __init__(self, variable, value, cost, limit, more=0) -> None:
        self.variable = variable
        self.value = value
        self.cost = cost
        self.limit = limit
        self.more = more

    def task(self, table, sender: Sender) -> Task:
        """The line as a task that sends by `sender`; `table`: the board's generated module."""
        identifier = getattr(table, self.variable)
        if isinstance(self.value, ErrorModule):
            line: object = ErrorPublication(sender, identifier, self.value)
        elif callable(self.value):
            line = Publication(sender, identifier, self.value, 0.0, table.TYPES[identifier] != "f32")
        else:
            line = Publication(sender, identifier, None, self.value, False)
        cost = max(1, self.cost - sender.late_cycles)
        return Task(line.send, cost, self.limit, self.more, "value" if self.more else "", self.variable)


def laid_out(table, sender: Sender, lines) -> dict:
    """`rows`, `occasional` and `occasional_row` of a Schedule: the `lines` where the master table names them.

    `lines`: a Send for every variable; a Task for work that sends nothing, which the table names in parentheses. The
    first line that is not the one which the table names there is a UserError.
    """
    named = list(dict.fromkeys(name for names in (*table.ROW_NAMES, table.OCCASIONAL_NAMES) for name in names))
    given = [line.variable if isinstance(line, Send) else f"({line.name})" for line in lines]
    for place in range(max(len(named), len(given))):
        wanted, found = ([*names, "no more"][min(place, len(names))] for names in (named, given))
        if wanted != found:
            raise FirmwareError(
                f"{table.BOARD}: line {place + 1} of what is sent is {found} in the board's room; in the master table "
                f"(datatable/master/boards.toml, then `ranger-sim table generate`) it is {wanted}"
            )
    tasks = {
        name: line.task(table, sender) if isinstance(line, Send) else line
        for name, line in zip(named, lines, strict=True)
    }
    return {
        "rows": tuple(tuple(tasks[name] for name in names) for names in table.ROW_NAMES),
        "occasional": tuple(tasks[name] for name in table.OCCASIONAL_NAMES) or None,
        "occasional_row": table.OCCASIONAL_ROW,
    }
