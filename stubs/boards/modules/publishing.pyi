# Generated from boards/modules/publishing.py and boards/modules/publishing.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.sender import Sender
from ranger_sim.firmware_sim.scheduler import Task
from typing import Any
from typing import final

@final
class Publication:
    sender: Sender
    identifier: int
    function: Any
    constant: float
    whole: bool
    def __init__(self, sender: Sender, identifier: int, function: Any, constant: float, whole: bool) -> None: ...
    def send(self) -> Any: ...

@final
class ErrorPublication:
    sender: Sender
    identifier: int
    errors: ErrorModule
    def __init__(self, sender: Sender, identifier: int, errors: ErrorModule) -> None: ...
    def send(self) -> Any: ...

class Send:
    variable: Any
    value: Any
    cost: Any
    limit: Any
    more: Any
    def __init__(self, variable: Any, value: Any, cost: Any, limit: Any, more: Any = 0) -> None: ...
    def task(self, table: Any, sender: Sender) -> Task: ...

def laid_out(table: Any, sender: Sender, lines: Any) -> dict[Any, Any]: ...
