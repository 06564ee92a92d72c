"""A walk compared with its twins, for its report: the same diagnosis as `ranger-sim diagnose --experiment walk`."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from typing import Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.api import diagnosis
from ranger_sim.sysid.readers import run_folder
from ranger_sim.tools.diagnose import twin_words
from ranger_sim.tools.twins.emulation import emulate

LEAST_SCALE = 5.0  # deviations from the middle to the edge of the picture, at least


def compared(folder: pathlib.Path, summary: Mapping[str, Any]) -> dict[str, Any]:
    """What the report shows of the variables in a run's folder, whose summary need not be there yet; with `error` alone
    where nothing can be compared."""
    try:
        dataset = run_folder.variables(folder)
        run_folder.note_end(dataset, summary)
        found = twin_words.summed_up(diagnosis(dataset, "walk", emulator=emulate).answer)
    except UserError as error:
        return {"error": str(error)}
    scale = max([LEAST_SCALE, *(abs(away) for _, away in found["unusual"])])
    band = bar(-found["usual"], found["usual"], scale)
    rows = [
        {
            "name": name,
            "away": f"{away:+.1f}".replace("-", "\u2212"),
            "is_odd": abs(away) > found["usual"],
            "bar": bar(min(0.0, away), max(0.0, away), scale),
        }
        for name, away in found["unusual"]
    ]
    return {**found, "error": "", "band": band, "rows": rows}


def bar(low: float, high: float, scale: float) -> str:
    """The place of a bar from `low` to `high` deviations, as its style."""
    return f"left:{50.0 + 50.0 * low / scale:.2f}%;right:{50.0 - 50.0 * high / scale:.2f}%"
