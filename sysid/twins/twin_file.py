"""The file of a controller's twins: maps, scatter and directions by rate of the log. Same numbers, same bytes."""

import dataclasses
import functools
import hashlib
import io
import json
import pathlib
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from ranger_sim.foundation import json_text
from ranger_sim.foundation.user_error import DataError
from ranger_sim.plant import body_files
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins.model import Direction, Knot, View
from ranger_sim.sysid.twins.step_map import LegMap, outcomes

FOLDER = pathlib.Path(__file__).parent / "files"
FULL, LINK, FEW = "full", "link", "few"  # the table's rate, the data link's, and hip, leg and state alone
MADE_OF = "made_of.json"
SAME_TIME = (1980, 1, 1, 0, 0, 0)  # of every part of the file, so that its bytes say nothing but its numbers
PARTS = ("floors_m", "middle", "deviation", "correlation", "between", "loose", "alarms")
OF_CAUSE = ("cause", "at", "parameter", "form", "low", "high", "tolerance", "sound")
OF_LEG = ("start", "reach", "foothold", "weights", "deviation")


@dataclasses.dataclass(frozen=True)
class TwinFile:
    """views: by rate; made_of: version of the package, controller, body, fingerprint of their numbers, walks."""

    views: Mapping[str, View]
    made_of: Mapping[str, Any]


def fingerprint(values: Mapping[str, float]) -> str:
    """Of the numbers that a twin's walk depends on, those of body and controller: 16 hexadecimal digits."""
    text = repr(sorted((name, float(value)) for name, value in values.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def of_body(body: str) -> str:
    """The fingerprint of a body of this version."""
    values = body_files.load(body).values
    return fingerprint({name: value for name, value in values.items() if not isinstance(value, str)})


def written(file: TwinFile) -> bytes:
    """The file's bytes."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        _add(archive, MADE_OF, json.dumps(file.made_of, indent=1, sort_keys=True).encode())
        for name, view in sorted(file.views.items()):
            for part, values in _arrays(view).items():
                buffer = io.BytesIO()
                np.save(buffer, np.asarray(values, dtype="<f4"), allow_pickle=False)
                _add(archive, f"{name}/{part}.npy", buffer.getvalue())
            texts = [
                {key: getattr(each, key) for key in OF_CAUSE}
                | {"far": [{"size": knot.size, "steps": knot.steps} for knot in each.far]}
                for each in view.directions
            ]
            _add(archive, f"{name}/directions.json", json.dumps({"few": view.few, "directions": texts}).encode())
    return made.getvalue()


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    info = zipfile.ZipInfo(name, SAME_TIME)
    info.external_attr = 0o644 << 16
    archive.writestr(info, content, zipfile.ZIP_DEFLATED, 9)


def _arrays(view: View) -> dict[str, Array]:
    found = {part: getattr(view, part) for part in PARTS}
    for number, leg in enumerate(view.legs):
        found |= {f"leg{number}_{part}": getattr(leg, part) for part in OF_LEG}
    found["terms"] = np.array([each.terms for each in view.directions])
    found["unsure"] = np.array([each.unsure for each in view.directions])
    far = [knot for each in view.directions for knot in each.far]
    found["far_moved"] = np.array([knot.moved for knot in far]).reshape(len(far), view.middle.shape[1])
    return found


def read(path: pathlib.Path) -> TwinFile:
    """The file at a path. UserError for one that is not of twins."""
    try:
        with zipfile.ZipFile(path) as archive:
            made_of = json_text.loads(archive.read(MADE_OF), f"{path}: {MADE_OF}")
            names = sorted({each.partition("/")[0] for each in archive.namelist() if "/" in each})
            views = {name: _view(archive, name) for name in names}
    except (OSError, zipfile.BadZipFile, KeyError, ValueError) as error:
        raise DataError(f"{path}: this is not a file of twins ({error})") from None
    return TwinFile(views, made_of)


def _view(archive: zipfile.ZipFile, name: str) -> View:
    place = f"{name}/directions.json"
    texts = json_text.loads(archive.read(place), f"{archive.filename}: {place}")

    def array(part: str) -> Array:
        return np.load(io.BytesIO(archive.read(f"{name}/{part}.npy")), allow_pickle=False).astype(np.float64)

    legs = [LegMap(*(array(f"leg{number}_{part}") for part in OF_LEG)) for number in range(2)]
    moved = iter(array("far_moved"))
    directions = tuple(
        Direction(
            terms=terms,
            unsure=unsure,
            **each | {"far": tuple(Knot(knot["size"], next(moved), knot["steps"]) for knot in each["far"])},
        )
        for each, terms, unsure in zip(texts["directions"], array("terms"), array("unsure"), strict=True)
    )
    parts = {part: array(part) for part in PARTS}
    view = View(texts["few"], (legs[0], legs[1]), directions=directions, **parts)
    if view.middle.shape[1] != 2 * len(outcomes(view.few)):
        raise ValueError(f"it has other features than this version: {view.middle.shape[1] // 2}")
    return view


def available() -> tuple[str, ...]:
    """The controllers that have a file."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.npz")))


@functools.cache
def of_controller(name: str) -> TwinFile | None:
    """The file that comes with the package; None when this controller has none."""
    return read(FOLDER / f"{name}.npz") if name in available() else None
