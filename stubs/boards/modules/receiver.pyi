# Generated from boards/modules/receiver.py and boards/modules/receiver.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import final

class Receiver:
    frames: int
    cycles: int
    def __init__(self, cycles: int = 0) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...

@final
class FloatReceiver(Receiver):
    value: float
    fixed: int
    def __init__(self) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...

class IntReceiver(Receiver):
    value: int
    def __init__(self) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...

@final
class Ignored(Receiver):
    pass
