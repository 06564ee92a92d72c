"""The variables of the unit: every quantity of the body, registered with pythonfmu3."""

from __future__ import annotations

import functools
import hashlib
import json
import sys
from collections.abc import Callable
from typing import Any
from xml.etree.ElementTree import Element

from pythonfmu3 import Boolean, DefaultExperiment, Float64, Fmi3Causality, Fmi3Variability, Int64, String, Unit

from ranger_sim import __version__
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.fmu.body import INTEGER, NUMBERS, OUTPUT, PARAMETER, REAL, TEXT, TRUTH, ExportedBody, Quantity
from ranger_sim.tools.fmu.stepper import STEP_S
from ranger_sim.tools.fmu.units import exponents

KINDS = {REAL: Float64, INTEGER: Int64, TRUTH: Boolean, TEXT: String}
STOP_S = 10.0  # of the default experiment; chosen by us
MADE_BY = "made_by"  # key in the file of start values: which variables the unit's description has


def signature(given: dict[str, Any]) -> str:
    """The same for two versions of ranger_sim when their units have the same variables in the same order."""
    names = "\n".join(f"{name} {each.kind}" for name, each in ExportedBody(given).quantities.items())
    return hashlib.blake2b(names.encode(), digest_size=16).hexdigest()


def connect(slave: Any, text: str) -> None:
    """Make `slave`, a pythonfmu3 slave, the body that `text` describes (start values of the parameters, JSON).

    UserError when the unit was made by a ranger_sim with other variables.
    """
    given = json.loads(text)
    body = slave.body = ExportedBody(given)
    if given.get(MADE_BY, "") != signature(given):
        raise UserError(
            f"the unit has other variables than those of ranger-sim {__version__} in {sys.executable}: "
            "write it again with that version"
        )
    slave.description = "Body of the Cornell Ranger biped: walking dynamics, motors, drives, battery and sensors"
    slave.author = "ranger-sim"
    slave.license = "MIT"
    slave.version = __version__
    slave.default_experiment = DefaultExperiment(start_time=0.0, stop_time=STOP_S, step_size=STEP_S)
    slave.register_variable(
        Float64(
            "time",
            causality=Fmi3Causality.independent,
            variability=Fmi3Variability.continuous,
            unit="s",
            description="of the last communication point",
            getter=lambda: slave.start_s + body.steps * STEP_S,
        )
    )
    for each in body.quantities.values():
        slave.register_variable(variable(body, each))
    exchange_arrays(slave, body)
    for name in sorted({"s", *(each.unit for each in body.quantities.values() if each.unit)}):
        found, factor = exponents(name)
        slave.register_units([Unit(name, factor=factor, **found)])
    # same body, same token: an importer of the unit already sees that
    slave.guid = hashlib.blake2b(f"{__version__}\n{text}".encode(), digest_size=16).hexdigest()


def exchange_arrays(slave: Any, body: ExportedBody) -> None:
    """Let `slave` move inputs and outputs as arrays; pythonfmu3 itself calls a function for each variable.

    Parameters, the time, and numbers beyond their limits still go through pythonfmu3, which reports what is wrong.
    """
    first = 1 + len(body.parameters)  # references count from 0, and the time has that one

    def getter(name: str, kind: int) -> Callable[[list[int]], list]:
        by_variable = getattr(slave, name)
        get_all = body.stepper.get_all

        def get(references: list[int]) -> list:
            body.begin_if_changed()
            found = get_all(references, first, kind)
            return by_variable(references) if found is None else found

        return get

    def setter(name: str, kind: int) -> Callable[[list[int], list], None]:
        by_variable = getattr(slave, name)
        set_all = body.stepper.set_all

        def put(references: list[int], values: list) -> None:
            if not set_all(references, values, first, kind):
                by_variable(references, values)

        return put

    for kind, name in ((REAL, "float64"), (INTEGER, "int64"), (TRUTH, "boolean")):
        setattr(slave, f"get_{name}", getter(f"get_{name}", NUMBERS[kind]))
        setattr(slave, f"set_{name}", setter(f"set_{name}", NUMBERS[kind]))


def variable(body: ExportedBody, each: Quantity) -> Any:
    """One variable of the interface."""
    unit = {"unit": each.unit} if each.kind == REAL and each.unit else {}
    is_state = each.causality == OUTPUT and each.kind == REAL
    variability = Fmi3Variability.fixed if each.causality == PARAMETER else Fmi3Variability.discrete
    return KINDS[each.kind](
        each.name,
        causality=Fmi3Causality[each.causality],
        variability=Fmi3Variability.continuous if is_state else variability,
        description=each.description,
        getter=functools.partial(body.get, each.name),
        setter=None if each.causality == OUTPUT else functools.partial(body.set, each.name),
        **unit,
    )


def finish(root: Element, body: ExportedBody) -> Element:
    """modelDescription.xml with the limits of numbers, and without the hour at which it was made."""
    del root.attrib["generationDateAndTime"]
    for found in root.iterfind("ModelVariables/*"):
        each = body.quantities.get(found.attrib["name"])
        if each is not None and each.limits is not None:
            low, high = each.limits
            found.set("min", f"{low:.17g}" if each.kind == REAL else str(int(low)))
            found.set("max", f"{high:.17g}" if each.kind == REAL else str(int(high)))
    return root
