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
    UserError   a mistake of the user, reported in one line

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
    from ranger_sim.foundation.user_error import UserError
    from ranger_sim.harness.outside.profile import Profile
    from ranger_sim.harness.outside.profile import load as load_profile
    from ranger_sim.harness.ranger import Ranger
    from ranger_sim.harness.scenario import Scenario, StopRule
    from ranger_sim.sysid.reading import Measurement, read

__all__ = ["Measurement", "Profile", "Quirks", "Ranger", "Scenario", "StopRule", "UserError", "load_profile", "read"]
__version__ = "0.1.0"

_PLACES = {
    "Measurement": ("sysid.reading", "Measurement"),
    "Profile": ("harness.outside.profile", "Profile"),
    "Quirks": ("boards.quirks", "Quirks"),
    "Ranger": ("harness.ranger", "Ranger"),
    "Scenario": ("harness.scenario", "Scenario"),
    "StopRule": ("harness.scenario", "StopRule"),
    "UserError": ("foundation.user_error", "UserError"),
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
