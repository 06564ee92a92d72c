# Generated from boards/modules/foot_contact.py and boards/modules/foot_contact.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import Any
from typing import final

class Debounce:
    settled: int
    state: int
    last: int
    run: int
    equal_samples: int
    def __init__(self, equal_samples: int) -> None: ...
    def sample(self, level: int) -> None: ...
    def contact(self) -> int: ...

@final
class FootContact(Debounce):
    level: int
    on_level: int
    off_level: int
    def __init__(self, on_level: int, off_level: int, equal_samples: Any) -> None: ...
    def read(self, counts: int) -> None: ...
