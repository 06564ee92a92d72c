"""Emulation of the whole Cornell Ranger biped: seven boards' firmware, four CAN buses, one walking body.

    from ranger_sim import Ranger, Scenario

    robot = Ranger(Scenario(seed=3))
    robot.run_for(5.0)
    print(robot.steps, robot.variable("MCH_ANGLE"), robot.board("MCH").scheduler.max_slot_cycles)

The public names:

    Ranger      one robot in one scenario: advance time, read and change its state
    Scenario    what to run: seed, controller, slope, floor, model of motors, joints and sensors
    StopRule    when a walk is done: steps, time or distance
    Quirks      where the firmware follows the one of 2016 instead of the appendix
    Profile     which boards and buses are real, bit rates and schedules of the buses; `load_profile` reads one
    read        measured data of any format: channels, what became of every sample, what is odd
    Measurement what `read` returns
    diagnose    the errors of a simulation by measured data: a `DiagnosisResult`
    identify    parameters from the recording of a bench: an `IdentificationResult`
    UserError   a mistake of the user, reported in one line; by what is wrong a TableError, ProfileError, ScenarioError,
                ModelError, DataError, FaultError, CampaignError, BusError, FirmwareError or RequestError

Everything else is internal and changes without notice; CAN programs find the interface `ranger_sim` by python-can.

The packages (`ranger_sim.boards`, `ranger_sim.plant`, ...) are top-level folders of the repository; importing this
package finds them and chooses, once for all of them, whether compiled or plain modules run (`ranger_sim.loading`). It
loads no package: each name is imported on first use (PEP 562).
"""

import importlib
from typing import TYPE_CHECKING, Any

from ranger_sim import loading  # noqa: F401  (first: it finds the packages)

if TYPE_CHECKING:
    from ranger_sim.boards.quirks import Quirks
    from ranger_sim.foundation.user_error import (
        BusError,
        CampaignError,
        DataError,
        FaultError,
        FirmwareError,
        ModelError,
        ProfileError,
        RequestError,
        ScenarioError,
        TableError,
        UserError,
    )
    from ranger_sim.harness.outside.profile import Profile
    from ranger_sim.harness.outside.profile import load as load_profile
    from ranger_sim.ranger.robot import Ranger
    from ranger_sim.ranger.scenario import Scenario, StopRule
    from ranger_sim.sysid.api import diagnose, identify
    from ranger_sim.sysid.reading import Measurement, read
    from ranger_sim.sysid.results import DiagnosisResult, IdentificationResult

__all__ = [
    "BusError",
    "CampaignError",
    "DataError",
    "DiagnosisResult",
    "FaultError",
    "FirmwareError",
    "IdentificationResult",
    "Measurement",
    "ModelError",
    "Profile",
    "ProfileError",
    "Quirks",
    "Ranger",
    "RequestError",
    "Scenario",
    "ScenarioError",
    "StopRule",
    "TableError",
    "UserError",
    "diagnose",
    "identify",
    "load_profile",
    "read",
]
__version__ = "0.1.0"

_PLACES = {
    "DiagnosisResult": ("sysid.results", "DiagnosisResult"),
    "IdentificationResult": ("sysid.results", "IdentificationResult"),
    "Measurement": ("sysid.reading", "Measurement"),
    "Profile": ("harness.outside.profile", "Profile"),
    "Quirks": ("boards.quirks", "Quirks"),
    "Ranger": ("ranger.robot", "Ranger"),
    "Scenario": ("ranger.scenario", "Scenario"),
    "StopRule": ("ranger.scenario", "StopRule"),
    **{name: ("foundation.user_error", name) for name in __all__ if name.endswith("Error")},
    "diagnose": ("sysid.api", "diagnose"),
    "identify": ("sysid.api", "identify"),
    "load_profile": ("harness.outside.profile", "load"),
    "read": ("sysid.reading", "read"),
}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'ranger_sim' has no attribute {name!r}; it offers {', '.join(__all__)}")
    module, inside = _PLACES[name]
    value = getattr(importlib.import_module(f"ranger_sim.{module}"), inside)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
