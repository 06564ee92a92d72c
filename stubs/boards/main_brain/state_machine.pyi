# Generated from boards/main_brain/state_machine.py and boards/main_brain/state_machine.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import Any
from typing import final

ANY: str

@final
class State:
    number: int
    name: str
    entry: Any
    main: Any
    exit: Any
    machines: list[Any]
    transitions: list[Any]
    def __init__(self, number: int, name: str, entry: Any = None, main: Any = None, exit: Any = None, machines: Any = ...) -> None: ...
    def run_main(self) -> None: ...

@final
class Transition:
    target: State
    condition: Any
    def __init__(self, target: State, condition: Any) -> None: ...

@final
class StateMachine:
    name: str
    states: list[Any]
    on_change: Any
    changes: int
    start: State
    current: State
    told: State
    entered: bool
    def __init__(self, name: str, states: Any, transitions: Any, on_change: Any = None) -> None: ...
    def put(self, name: Any) -> Any: ...
    def _tell(self) -> Any: ...
    def step(self) -> None: ...
