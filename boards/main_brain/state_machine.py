"""Concurrent, nestable finite state machines with entry, main and exit actions.

One tick of a machine (robot.md C1.0): of the transitions declared for the present state,
the first one whose condition holds is taken; with none, the state's main action runs (after its entry
action, the first time). A transition is complete within its tick: the old state's exit action, then both entry
and main action of the new state; an old state that was entered but never ran gets its entry and main
first. A machine takes no second transition in the same tick, and a transition to the present state changes nothing.
It reports its state at the beginning of a tick, so that readers of the number see a change one tick later.

A state may hold nested machines. They are stepped after its main action, in their written order,
so a state of an outer machine (walking) contains machines that run concurrently (one per motor).
Conditions and actions are callables without arguments; conditions must not change anything.
"""

import cython

from ranger_sim.firmware_sim.calls import call


@cython.final
@cython.cclass
class State:
    """One state. `entry`, `main`, `exit`: callables or None; `machines`: the machines nested in it."""

    number: cython.longlong
    name: str
    entry: object
    main: object
    exit: object
    machines: list
    transitions: list

    def __init__(self, number, name, entry=None, main=None, exit=None, machines=()) -> None:
        self.number = number
        self.name = name
        self.entry = entry
        self.main = main
        self.exit = exit
        self.machines = list(machines)
        self.transitions = []

    @cython.ccall
    def run_main(self) -> None:
        """The main action, then one tick of every nested machine."""
        machine: StateMachine
        if self.main is not None:
            call(self.main)
        for machine in self.machines:
            machine.step()


@cython.final
@cython.cclass
class Transition:
    """A condition and its target state; made by StateMachine from its table."""

    target: State
    condition: object

    def __init__(self, target, condition) -> None:
        self.target = target
        self.condition = condition


@cython.final
@cython.cclass
class StateMachine:
    """A machine built from two tables.

    states: State objects, the first is the start state. transitions: rows (from, to, condition) of state
    names; `from` may be one name, a tuple of names or ANY. For each state the order of the rows is the
    order of precedence. on_change: callable that gets the present state's number at the beginning of the first tick and
    of each tick after a change, or None.
    """

    name: str
    states: list
    on_change: object
    changes: cython.longlong
    start: State
    current: State
    reported: State
    entered: cython.bint

    def __init__(self, name, states, transitions, on_change=None) -> None:
        self.name = name
        self.states = list(states)
        self.on_change = on_change
        self.changes = 0
        by_name = {}
        numbers = set()
        for state in self.states:
            if state.name in by_name or state.number in numbers:
                raise ValueError(f"machine {name}: state {state.number} {state.name} is declared twice")
            by_name[state.name] = state
            numbers.add(state.number)
        for row in transitions:
            origins, target, condition = row
            if origins == ANY:
                origins = tuple(by_name)
            elif isinstance(origins, str):
                origins = (origins,)
            for origin in (*origins, target):
                if origin not in by_name:
                    raise ValueError(f"machine {name}: no state {origin!r} for the transition to {target!r}")
            for origin in origins:
                if origin != target:
                    by_name[origin].transitions.append(Transition(by_name[target], condition))
        self.start = self.states[0]
        self.current = self.start
        self.reported = None
        self.entered = False

    @cython.ccall
    def set_state(self, name) -> object:
        """Place the machine in a state whose entry action has yet to run."""
        for state in self.states:
            if state.name == name:
                self.current = state
                self.entered = False
                self._report()
                return
        raise ValueError(f"machine {self.name}: no state {name!r}")

    @cython.ccall
    def _report(self) -> object:
        self.reported = self.current
        if self.on_change is not None:
            self.on_change(self.current.number)

    @cython.ccall
    def step(self) -> None:
        """One tick."""
        state: State = self.current
        transition: Transition
        if self.reported is not state:
            self._report()
        for transition in state.transitions:
            if call(transition.condition):
                if not self.entered:
                    if state.entry is not None:
                        call(state.entry)
                    state.run_main()
                if state.exit is not None:
                    call(state.exit)
                self.changes += 1
                state = transition.target
                self.current = state
                self.entered = False
                break
        if not self.entered:
            self.entered = True
            if state.entry is not None:
                call(state.entry)
        state.run_main()


ANY = "any state"
