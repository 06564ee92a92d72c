# Generated from boards/modules/network_time.py and boards/modules/network_time.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.receiver import Receiver

class NetworkTime(Receiver):
    ms: int
    def __init__(self) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...
