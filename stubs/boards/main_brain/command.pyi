# Generated from boards/main_brain/command.py and boards/main_brain/command.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.datatable.store import DataStore
from typing import Any

def table_id(name: Any) -> Any: ...

class MotorCommand:
    store: DataStore
    current_id: int
    stiffness_id: int
    dampness_id: int
    def __init__(self, store: DataStore, board: Any) -> None: ...
    def send(self, current_A: float, stiffness: float, dampness: float) -> None: ...
    def off(self) -> None: ...
