"""The file of a controller's twins, from their walks."""

import pathlib

from threadpoolctl import threadpool_limits

import ranger_sim
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins import learning, twin_file
from ranger_sim.sysid.twins.twin_file import FEW, FULL, LINK, TwinFile
from ranger_sim.tools.twins.causes import TWINS
from ranger_sim.tools.twins.making import FAR_NAME, FLOORS_M, made
from ranger_sim.tools.twins.walking import Task, Walked, fingerprint, values_of


def built(tasks: list[Task], folder: pathlib.Path) -> TwinFile:
    """Maps, scatter and directions by all rates, from the walks in a folder."""
    walks = list(made(tasks, folder))
    first = tasks[0]
    causes = causes_of_twins()
    with threadpool_limits(1):  # threads of the linear algebra change the last digits
        views = {
            name: learning.learned(twins(walks, name), causes, FLOORS_M, few=name == FEW) for name in (FULL, LINK, FEW)
        }
    values = values_of(first.body, first.controller)
    parameters = {name: value for name, value in values.items() if name.isupper()}
    made_of = {
        "version": ranger_sim.__version__,
        "controller": first.controller,
        "body": first.body,
        "body_fingerprint": twin_file.of_body(first.body),
        "fingerprint": fingerprint(first.body, first.controller),
        "walks": len(walks),
        "steps": sum(len(walk.leg) for _, walk in walks),
        "parameters": parameters,
    }
    return TwinFile(views, made_of)


def causes_of_twins() -> list[learning.Cause]:
    """The causes of the table of twins."""
    return [
        learning.Cause(each.key, each.cause, each.at, each.parameter, each.form, each.tolerance, each.sound)
        for each in TWINS
    ]


def twins(walks: list[tuple[Task, Walked]], name: str) -> list[learning.Twinned]:
    """The walks that count, by the rate of a view."""
    found = []
    for task, walk in walks:
        features: Array = walk.full if name == FULL else walk.link
        count = min(len(walk.leg), len(features))
        far = task.name.startswith(FAR_NAME)
        if far or count >= learning.FEWEST_STEPS:
            floor = FLOORS_M.index(task.floor_m)
            leg, rows = walk.leg[:count], features[:count]
            found.append(learning.Twinned(floor, leg, rows, task.key, task.size, task.tolerances, far))
    return found


def default_path(controller: str) -> pathlib.Path:
    """The file that ships with the package."""
    return twin_file.FOLDER / f"{controller}.npz"
