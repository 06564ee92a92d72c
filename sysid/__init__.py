"""Measured data against a simulation: parameters of benches, and the errors of a model.

    from ranger_sim.sysid import diagnose

    result = diagnose(["run1.csv"], "motor-bench", holdout=["run2.csv"])
    print([f"{cause.name} at {cause.at}" for cause in result.causes])

`diagnose` and `identify` and what they return are public, here and in `ranger_sim`; each is imported on first use.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ranger_sim.sysid.api import diagnose, identify
    from ranger_sim.sysid.results import DiagnosisResult, IdentificationResult

__all__ = ["DiagnosisResult", "IdentificationResult", "diagnose", "identify"]

_MODULES = {"DiagnosisResult": "results", "IdentificationResult": "results", "diagnose": "api", "identify": "api"}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
