# Generated from firmware_sim/chip.py and firmware_sim/chip.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.board import Board
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.clock import TickTrain
from ranger_sim.firmware_sim.vic import InterruptController
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any

PINS: int
ALARMS: int
ALARM_PLACES: int

class Chip(Board):
    now: int
    instant: int
    code_time: int
    stop_time: int
    alarm_time: int
    alarms_set: int
    waiting: bool
    check_wait: bool
    vic: InterruptController
    ns_per_cycle: float
    cycles_per_ns: float
    ticks: TickTrain
    tick_source: InterruptSource
    tick_time: int
    match_time: int
    pins: MutableSequence[int]
    alarm_times: MutableSequence[int]
    alarm_places: MutableSequence[int]
    hz: int
    crystal: Crystal
    unclaimed: int
    peripherals: list[Any]
    followers: list[Any]
    pwm_follower: Any
    panel: Any
    def __init__(self, name: Any, hz: int, crystal: Any = None) -> None: ...
    def carry(self, panel: Any) -> None: ...
    def move_memory(self, words: Any) -> None: ...
