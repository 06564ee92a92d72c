"""The walks of all twins: which, in as many processes as wanted, each kept in a file as soon as it is made."""

import concurrent.futures
import hashlib
import multiprocessing
import pathlib
from collections.abc import Callable, Iterator

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.twins import features
from ranger_sim.tools.twins.causes import TWINS, Twin
from ranger_sim.tools.twins.walking import Task, Walked, fingerprint, walk

FLOORS_M = (0.0, 0.0005, 0.001)
SOUND = {0.0: 100, 0.0005: 40, 0.001: 100}  # 30 lose a fifth of the first causes on 1 mm of roughness
LOOSE = 24  # on each floor: bodies within tolerances, from which the thresholds come
SEEDS = 5  # walks of each cause and size: each another seed, battery, and every other one on 0.5 mm
# Times a cause's largest size of either sign: so far a line, a square and a cube do not reach. Some robots fall there.
FAR, FAR_NAME = (4.0, 2.0), "far-"
CHARGES = (1.0, 0.55, 0.8, 0.35, 0.9, 0.65, 0.45)

Progress = Callable[[int, int], None]  # (walks that are there, all)


def tasks(controller: str, body: str, share: float = 1.0) -> list[Task]:
    """Every walk, in order. share: of the sound twins and of the seeds of each cause, above 0, for a trial."""
    found = []
    for floor, (floor_m, count) in enumerate(SOUND.items()):
        for number in range(max(8, round(share * count))):
            seed, charge = 10_000 * (floor + 1) + number, CHARGES[number % len(CHARGES)]
            found.append(Task(f"sound-{floor}-{number:03d}", seed, controller, body, floor_m=floor_m, charge=charge))
        for number in range(max(4, round(share * LOOSE))):
            seed, charge = 10_000 * (floor + 1) + 5000 + number, CHARGES[(number + 3) % len(CHARGES)]
            name = f"loose-{floor}-{number:03d}"
            found.append(Task(name, seed, controller, body, floor_m=floor_m, charge=charge, tolerances=True))
    most = max(_seeds(twin, share) for twin in TWINS)
    for number in range(most):  # one seed of every cause after the other: an unfinished set has them all
        for place, twin in enumerate(TWINS):
            if number >= _seeds(twin, share):
                continue
            for column, size in enumerate(twin.sizes):
                seed = 100_000 + 1000 * place + 10 * number + column
                charge = CHARGES[(seed // 3) % len(CHARGES)]
                name = f"cause-{place:02d}-{number:02d}-{column}"
                floor_m = 0.0005 if number % 2 else 0.0
                found.append(Task(name, seed, controller, body, twin.key, size, floor_m, charge))
    return found + far_tasks(controller, body)


def far_tasks(controller: str, body: str) -> list[Task]:
    """The walks far beyond the other sizes of each cause, one of each size."""
    found = []
    for number, times in enumerate(FAR):
        for place, twin in enumerate(TWINS):
            outermost = min(0.0, *twin.sizes), max(0.0, *twin.sizes)
            for column, size in enumerate(each for each in outermost if each):
                seed = 500_000 + 1000 * place + 10 * number + column
                name = f"{FAR_NAME}{place:02d}-{number:02d}-{column}"
                floor_m = 0.0005 if number % 2 else 0.0
                charge = CHARGES[(seed // 3) % len(CHARGES)]
                found.append(Task(name, seed, controller, body, twin.key, times * size, floor_m, charge))
    return found


def _seeds(twin: Twin, share: float) -> int:
    """Walks of each size of a cause: twice as many where sizes have one sign."""
    usual = twin.seeds or (1.0 if len(twin.sizes) > 2 else 2.0)
    return max(1, round(share * SEEDS * usual))


def make(wanted: list[Task], folder: pathlib.Path, jobs: int, progress: Progress) -> None:
    """Let every task walk that has no file in the folder yet."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [each for each in wanted if not path_of(folder, each).exists()]
    progress(len(wanted) - len(missing), len(wanted))
    if not missing:
        return
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(jobs, mp_context=context) as pool:
        running = {pool.submit(keep, each, folder): each for each in missing}
        done = len(wanted) - len(missing)
        for future in concurrent.futures.as_completed(running):
            future.result()
            done += 1
            progress(done, len(wanted))


def path_of(folder: pathlib.Path, task: Task) -> pathlib.Path:
    """The file of a walk; its name changes with whatever the walk depends on."""
    text = f"{task!r} {fingerprint(task.body, task.controller)}"
    return folder / f"{task.name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.npz"


def keep(task: Task, folder: pathlib.Path) -> None:
    """Let one task walk; its steps are in the folder afterwards."""
    try:
        found = walk(task)
    except UserError:  # no body has this number: as if the robot fell at once
        if not task.name.startswith(FAR_NAME):
            raise
        none = np.zeros((0, len(features.NAMES)))
        found = Walked(np.zeros(0, dtype=int), none, none, True)
    path = path_of(folder, task)
    part = path.with_suffix(".part.npz")
    np.savez(part, leg=found.leg, full=found.full.astype("f4"), link=found.link.astype("f4"), fell=found.fell)
    part.replace(path)


def made(wanted: list[Task], folder: pathlib.Path) -> Iterator[tuple[Task, Walked]]:
    """Every task with its walk. UserError when one has not been made."""
    for task in wanted:
        try:
            with np.load(path_of(folder, task)) as file:
                yield (
                    task,
                    Walked(file["leg"], file["full"].astype(float), file["link"].astype(float), bool(file["fell"])),
                )
        except OSError as error:
            raise UserError(f"{folder}: the walk {task.name} is missing ({error}); start the command again") from None
