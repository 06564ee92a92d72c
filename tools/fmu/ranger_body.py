"""The functional mock-up unit: `body.ExportedBody` behind pythonfmu3. This file itself goes into the unit.

The unit holds it in `resources`, with `given.json` (start values of the parameters) and pythonfmu3's own files;
ranger_sim is the version installed on the machine that runs it. Its constructor must not raise: pythonfmu3 0.3.4
crashes the importer then. So the first call that may fail reports an error of the constructor.
"""

from __future__ import annotations

import pathlib
import sys
from typing import Any
from xml.etree.ElementTree import Element

from pythonfmu3 import Fmi3Slave, Fmi3Status, Fmi3StepResult

GIVEN = "given.json"
GOING, FALLEN = Fmi3StepResult(), Fmi3StepResult(terminateSimulation=True)


class _Unusable(dict):
    """Replaces the variables of a unit that could not be made: reading one raises the reason."""

    def __init__(self, fault: str) -> None:
        super().__init__()
        self.fault = fault

    def __getitem__(self, reference: int) -> Any:
        raise RuntimeError(self.fault)


class RangerBody(Fmi3Slave):  # type: ignore[misc]  # from a library without types
    """One instance of the unit."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.start_s = 0.0
        self.fault = ""
        self.body: Any = None
        self.refusal: type[Exception] = Exception
        try:
            from ranger_sim.foundation.user_error import UserError
            from ranger_sim.tools.fmu.interface import connect

            self.refusal = UserError
            connect(self, (pathlib.Path(self.resources) / GIVEN).read_text(encoding="utf-8"))
        except ImportError as error:
            self.fault = f"this unit needs ranger-sim installed for the Python in {sys.prefix}: {error}"
        except Exception as error:
            self.fault = str(error)
        if self.fault:
            self.vars: Any = _Unusable(self.fault)

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """modelDescription.xml."""
        if self.fault:
            raise RuntimeError(self.fault)
        from ranger_sim.tools.fmu.interface import finish

        return finish(super().to_xml(model_options or {}), self.body)

    def setup_experiment(self, start_time: float) -> None:
        """Time counts from here."""
        self.start_s = start_time

    def enter_initialization_mode(self) -> None:
        """Fail here if the unit is unusable."""
        if self.fault:
            raise RuntimeError(self.fault)

    def exit_initialization_mode(self) -> None:
        """End the setting of parameters: their values are final."""
        self.body.begin()

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        """Whole steps of the plant. After a fall nothing moves, and the simulator is asked to end."""
        try:
            count = self.body.steps_in(current_time, step_size, self.start_s)
        except self.refusal as refused:
            self.log(str(refused), Fmi3Status.error)
            return Fmi3StepResult(status=Fmi3Status.error)
        return GOING if self.body.advance(count) else FALLEN
