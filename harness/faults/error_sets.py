"""Error configurations by the names of ASAM XIL's port for electrical error simulation: sets of faults, one at a time.

    port = ErrorPort(robot)
    port.set_configuration(
        ErrorConfiguration(
            "sensors of the hip",
            (
                ErrorSet("frozen", ("MCH.joint_encoder:stuck", "MCH.absolute_encoder:stuck"), trigger="step 5"),
                ErrorSet("healthy", ()),
                ErrorSet("noisy", ("MCH.absolute_encoder:noise,deviation=40",), trigger="step 9"),
            ),
        )
    )
    port.activate()

A set becomes active by its trigger: the condition it names (XIL's software trigger), or `port.trigger()` (the manual
one). Then the faults of the previous set end. Those of this one begin when all places are clear. An empty set clears.
"""

import dataclasses
from typing import Any

from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.fault import Fault
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.waiting import Condition


@dataclasses.dataclass(frozen=True)
class ErrorSet:
    """Faults that act together, each as typed but without start and end. `trigger`: None, or a condition."""

    name: str
    errors: tuple[str, ...]
    trigger: str | None = None


@dataclasses.dataclass(frozen=True)
class ErrorConfiguration:
    """Sets in the order in which they become active."""

    name: str
    sets: tuple[ErrorSet, ...]


class ErrorPort(StepWatch):
    """Selects a robot's error sets. `active_set`: the active one, None before the first trigger."""

    def __init__(self, robot: Any) -> None:
        StepWatch.__init__(self)
        self.robot = robot
        self.configuration: ErrorConfiguration | None = None
        self.active_set: ErrorSet | None = None
        self.active_errors: list[Fault] = []  # those of the active set
        self.leaving: list[Fault] = []  # those of the previous set whose places are not clear yet
        self.coming: list[Fault] = []  # those of the active set while places are not clear yet
        self.number = -1
        self.waits: Condition | None = None
        self.triggered = False

    def set_configuration(self, configuration: ErrorConfiguration) -> None:
        """Set what will be activated. UserError for an impossible fault, or one that has a start or an end."""
        if self in self.robot.loop.watchers:
            raise FaultError(f"error port: {configuration.name}: deactivate the one that is active first")
        for one in configuration.sets:
            for each in one.errors:
                self._made(configuration, each)  # so that mistakes are reported now
            if one.trigger is not None:
                self.robot.condition(one.trigger)
        self.configuration = configuration

    def _made(self, configuration: ErrorConfiguration, text: str) -> Fault:
        fault = self.robot.catalogue.typed(text)
        if fault.start is not None or fault.end is not None:
            raise FaultError(
                f"error configuration {configuration.name}: {text!r}: its set says when it begins and ends"
            )
        return fault

    def activate(self) -> None:
        """Let the first set wait for its trigger from now on. UserError without a configuration."""
        if self.configuration is None:
            raise FaultError("error port: there is no configuration to activate")
        if self in self.robot.loop.watchers:
            raise FaultError(f"error port: {self.configuration.name} is active already")
        self.robot.loop.watchers.append(self)
        self.number = -1
        self.triggered = False
        self._wait_for_next()

    def trigger(self) -> None:
        """Make the next set active with the next step of the plant, regardless of its trigger."""
        if self.configuration is None or self not in self.robot.loop.watchers:
            raise FaultError("error port: there is nothing to trigger before a configuration is activated")
        if self.number + 1 >= len(self.configuration.sets):
            raise FaultError("error port: there is no set left to trigger")
        self.triggered = True

    def deactivate(self) -> None:
        """End every fault of the configuration; no set is active. It may be activated again from its first set on."""
        for fault in self.active_errors:
            fault.stop()
        self.leaving += self.active_errors
        self.active_errors, self.coming, self.active_set = [], [], None
        if self in self.robot.loop.watchers:
            self.robot.loop.watchers.remove(self)

    def before_step(self, now_ns: int) -> None:
        if self.triggered or (self.waits is not None and self.waits.met()):
            self.triggered = False
            self._next()
        self.leaving = [fault for fault in self.leaving if not fault.over]
        if self.coming and not self.leaving:
            for fault in self.coming:
                self.robot.arm(fault)
            self.active_errors, self.coming = self.coming, []

    def _next(self) -> None:
        """Make the next set active: faults of the last one end."""
        assert self.configuration is not None
        self.number += 1
        for fault in self.active_errors:
            fault.stop()
        self.leaving += self.active_errors
        self.active_errors = []
        self.active_set = self.configuration.sets[self.number]
        self.coming = [self._made(self.configuration, each) for each in self.active_set.errors]
        self._wait_for_next()

    def _wait_for_next(self) -> None:
        """Wait for the trigger of the set after the active one, if it has one."""
        assert self.configuration is not None
        self.waits = None
        if self.number + 1 < len(self.configuration.sets):
            trigger = self.configuration.sets[self.number + 1].trigger
            if trigger is not None:
                self.waits = self.robot.condition(trigger)
                self.waits.begin(self.robot)
