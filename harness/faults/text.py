"""A fault as typed: PLACE:MODE[,name=value ...][@START[..END]].

MCH.joint_encoder:stuck@step 12..step 14
MCH.joint_encoder:stuck@step 12..+50 ms
UI.imu:gyro_bias,rate=0.2@3 s
"""

import re
from typing import NamedTuple

from ranger_sim.foundation.quantities import TIMES, in_base_units
from ranger_sim.foundation.user_error import FaultError


class Typed(NamedTuple):
    """The parts of the text; conditions as text, None when they are missing."""

    place: str
    mode: str
    parameters: dict[str, str]
    start: str | None
    end: str | None


def parse(text: str) -> Typed:
    """The parts of a typed fault. UserError with the form for other text."""
    what, _, period = text.partition("@")
    place, colon, rest = what.partition(":")
    mode, *pairs = (part.strip() for part in rest.split(","))
    start, dots, end = (part.strip() for part in period.partition(".."))
    parameters: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not (name and equals and value) or name in parameters:
            raise FaultError(f"fault {text!r}: {pair!r} is not name=value, once per name")
        parameters[name] = value
    if not (colon and place.strip() and mode) or ("@" in text and not start) or (dots and not end):
        raise FaultError(f"fault {text!r}: it reads PLACE:MODE[,name=value][@START[..END]]")
    if start and end and _ends_before(start, end):
        raise FaultError(f"fault {text!r}: it ends at {end!r}, which is not after its start, {start!r}")
    return Typed(place.strip(), mode, parameters, start or None, end or None)


def _ends_before(start: str, end: str) -> bool:
    """True for an end that comes no later than the start: two steps, or two times. Others are not compared."""
    steps = [re.fullmatch(r"step\s*(\d+)", each) for each in (start, end)]
    if steps[0] and steps[1]:
        return int(steps[1][1]) <= int(steps[0][1])
    times_s = [None if end.startswith("+") else in_base_units(each, TIMES) for each in (start, end)]
    return times_s[0] is not None and times_s[1] is not None and times_s[1] <= times_s[0]
