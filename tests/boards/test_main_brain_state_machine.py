"""One tick of a state machine, order of transitions, nesting."""

import pytest

from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine


class Script:
    """Actions that write down their names, and conditions that are true while named in `flags`."""

    def __init__(self) -> None:
        self.log = []
        self.flags = set()

    def does(self, name):
        return lambda: self.log.append(name)

    def when(self, flag):
        return lambda: flag in self.flags

    def state(self, number, name, machines=()):
        return State(
            number, name, self.does(f"{name} entry"), self.does(f"{name} main"), self.does(f"{name} exit"), machines
        )

    def took(self):
        taken, self.log = self.log, []
        return taken


@pytest.fixture
def script():
    return Script()


def two_states(script):
    return StateMachine(
        "two",
        (script.state(0, "a"), script.state(1, "b")),
        (("a", "b", script.when("go")), ("b", "a", script.when("back"))),
    )


def test_entry_runs_once_and_main_in_every_tick(script):
    machine = two_states(script)
    machine.step()
    machine.step()
    assert script.took() == ["a entry", "a main", "a main"]


def test_a_transition_runs_exit_entry_and_main_in_one_tick(script):
    machine = two_states(script)
    machine.step()
    script.took()
    script.flags = {"go"}
    machine.step()
    assert script.took() == ["a exit", "b entry", "b main"]
    assert machine.current.name == "b"


def test_a_state_left_before_it_ever_ran_runs_entry_and_main_first(script):
    machine = two_states(script)
    script.flags = {"go"}
    machine.step()
    assert script.took() == ["a entry", "a main", "a exit", "b entry", "b main"]


def test_a_tick_takes_no_second_transition(script):
    machine = two_states(script)
    machine.step()
    script.flags = {"go", "back"}
    machine.step()
    assert machine.current.name == "b"
    machine.step()
    assert machine.current.name == "a"


def test_the_transition_declared_first_for_the_state_wins(script):
    machine = StateMachine(
        "order",
        (script.state(0, "a"), script.state(1, "b"), script.state(2, "c")),
        (("a", "c", script.when("second")), ("a", "b", script.when("first"))),
    )
    script.flags = {"first", "second"}
    machine.step()
    assert machine.current.name == "c"


def test_a_flag_without_a_transition_from_this_state_changes_nothing(script):
    machine = two_states(script)
    script.flags = {"back"}
    machine.step()
    assert script.took() == ["a entry", "a main"]
    assert machine.changes == 0


def test_from_any_state_skips_the_target_itself(script):
    machine = StateMachine(
        "any",
        (script.state(0, "a"), script.state(1, "b")),
        ((ANY, "a", script.when("reset")), ("a", "b", script.when("go"))),
    )
    script.flags = {"reset"}
    machine.step()
    machine.step()
    assert script.took() == ["a entry", "a main", "a main"]
    script.flags = {"go"}
    machine.step()
    script.flags = {"reset"}
    machine.step()
    assert machine.current.name == "a"


def test_nested_machines_run_concurrently_after_the_main_action_in_their_order(script):
    inner = [StateMachine(name, (script.state(0, name),), ()) for name in ("first", "second")]
    outer = StateMachine(
        "outer",
        (script.state(0, "walk", inner), script.state(1, "stand")),
        (("walk", "stand", script.when("stop")),),
    )
    outer.step()
    assert script.took() == ["walk entry", "walk main", "first entry", "first main", "second entry", "second main"]
    script.flags = {"stop"}
    outer.step()
    assert script.took() == ["walk exit", "stand entry", "stand main"]
    outer.step()
    assert script.took() == ["stand main"]


def test_a_machine_can_nest_three_deep(script):
    lowest = StateMachine("low", (script.state(0, "low"),), ())
    middle = StateMachine("middle", (script.state(0, "middle", [lowest]),), ())
    top = StateMachine("top", (script.state(0, "top", [middle]),), ())
    top.step()
    assert [line for line in script.took() if line.endswith("main")] == ["top main", "middle main", "low main"]


def test_a_state_is_reported_by_number_at_the_beginning_of_the_next_tick(script):
    machine = StateMachine(
        "told",
        (script.state(3, "a"), script.state(8, "b")),
        (("a", "b", script.when("go")),),
        on_change=lambda number: script.log.append(number),
    )
    machine.step()
    assert script.took() == [3, "a entry", "a main"]
    script.flags = {"go"}
    machine.step()
    assert script.took() == ["a exit", "b entry", "b main"]
    machine.step()
    machine.step()
    assert script.took() == [8, "b main", "b main"]
    machine.set_state("a")
    assert script.took() == [3]


@pytest.mark.parametrize(
    "states, transitions",
    [
        (("a", "a"), ()),
        (("a", "b"), (("a", "c", None),)),
        (("a", "b"), (("x", "a", None),)),
    ],
)
def test_a_wrong_table_is_refused(script, states, transitions):
    with pytest.raises(ValueError, match="machine wrong"):
        StateMachine("wrong", [script.state(i, name) for i, name in enumerate(states)], transitions)


def test_a_number_used_twice_is_refused(script):
    with pytest.raises(ValueError, match="declared twice"):
        StateMachine("wrong", (script.state(1, "a"), script.state(1, "b")), ())


def test_putting_a_machine_into_an_unknown_state_is_refused(script):
    with pytest.raises(ValueError, match="no state 'z'"):
        two_states(script).set_state("z")
