"""What other methods leave of the same hidden effects: a refit alone, three learners, and the commonest label.

    python -m tests.sysid.comparators
    python -m tests.sysid.comparators --only "joint 4"

Cases: three machines of users (`hidden_effects`), a cell of each machine of the matrix at a strength of 8, and true
terms left out of real recordings. For each the error on another run, over what was measured and all equations: of
the diagnosis before and after, in its own band; and in the full band of the model refitted, and of a kernel ridge,
gradient boosting and sparse regression (pysindy), which learn what the refitted model leaves.
A learner whose library is not installed is skipped with a line (pip install --group comparators).
"""

import argparse
import collections
import dataclasses
import importlib.util
import sys
import warnings
from collections.abc import Callable

import numpy as np

from ranger_sim.sysid.bands import plain
from ranger_sim.sysid.machine import Machine
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.sysid.regression import kept_rows
from tests.sysid import hidden_effects, left_out_terms
from tests.sysid.matrix.bodies import HIDDEN
from tests.sysid.matrix.cases import recordings
from tests.sysid.matrix.cells import CELLS
from tests.sysid.matrix.judged import machine_of, table

MOST_ROWS = 2000  # for the kernel's matrix
STRENGTH = 8.0  # of the matrix's effects


@dataclasses.dataclass(frozen=True)
class Case:
    """names: causes that are right, none where nothing is hidden; tables(): run and held-out run."""

    title: str
    machine: Callable[[], Machine]
    names: tuple
    tables: Callable


def cases(seed):
    for each in hidden_effects.CASES:

        def made(each=each):
            return [each.make(each.cause, each.size, one) for one in (seed, seed + 100)]

        yield Case(each.title, each.machine, tuple(name for name, _ in each.names), made)
    for name in HIDDEN:
        cell = next(each for each in CELLS if each.machine == name)
        for effect, hidden in HIDDEN[name].items():

            def tables(cell=cell, effect=effect):
                run, other, _, _ = recordings(cell, seed, effect, STRENGTH)
                return table(run, "a"), table(other, "b")

            yield Case(f"matrix {name} {effect}", lambda cell=cell: machine_of(cell), hidden.names, tables)
    for term in left_out_terms.TERMS:
        if term.source.there():

            def parts(term=term):
                return tuple(term.tables(1.0, term.fitted()[0]))

            yield Case(term.title, term.machine, term.names, parts)


def rows_of(machine, recording):
    """By equation (features (n, k), residual (n,), rms of the response) at the rows that count, after a refit."""
    regression = plain([recording])
    values = np.array([regression.values[each] for each in regression.names])
    signals = {key: one for each in machine.generic(recording).values() for key, one in each.items() if key != "t"}
    features = np.column_stack([kept_rows(recording, one) for one in signals.values()])
    found = {}
    for name, part in regression.parts.items():
        good = part.valid & ~part.starts
        found[name] = features[good], (part.response - part.measured @ values)[good], _size(part.response[good])
    return found


def _size(response):
    """rms about the mean where an equation has one, as the errors of a diagnosis are taken."""
    return float(np.std(response)) or 1.0


def learned(make, run, other):
    """rms that is left on the other run over what was measured there, over all equations."""
    total = 0.0
    for name, (x, left, _) in run.items():
        x_other, left_other, size = other[name]
        mean, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-12)
        every = max(1, len(x) // MOST_ROWS)
        spread = float(np.std(left)) or 1.0
        predict = make(((x - mean) / scale)[::every], left[::every] / spread)
        total += float(np.mean((left_other - spread * predict((x_other - mean) / scale)) ** 2)) / size**2
    return np.sqrt(total)


def kernel_ridge(x, y):
    from sklearn.kernel_ridge import KernelRidge

    return KernelRidge(alpha=0.1, kernel="rbf", gamma=0.1).fit(x, y).predict


def gradient_boosting(x, y):
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(random_state=0).fit(x, y).predict


def sindy(x, y):
    """Sequentially thresholded least squares on monomials up to the third degree, |x| x and the sign of each signal."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its imports, and where no term is left
        import pysindy

        def library(x):
            pairs = [x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i, x.shape[1])]
            return np.column_stack((np.ones(len(x)), x, *pairs, x**3, x * np.abs(x), np.sign(x)))

        columns = library(x)
        size = np.maximum(np.std(columns, axis=0), 1e-12)
        size[0] = 1.0
        fit = pysindy.STLSQ(threshold=0.1, alpha=0.01).fit(columns / size, y[:, None])
    weights = np.ravel(fit.coef_)
    return lambda x: library(x) / size @ weights


LEARNERS = {
    "kernel ridge": (kernel_ridge, "sklearn"),
    "boosting": (gradient_boosting, "sklearn"),
    "pysindy": (sindy, "pysindy"),
}


def row(case, learners):
    """(label found, cells of the table)."""
    machine = case.machine()
    run, other = case.tables()
    found = diagnose(machine, [run], [other])
    first = next(iter(found.result.causes), None)
    label = first.name if first else "nothing"
    right = (first is not None and first.name in case.names) if case.names else not found.result.detected
    errors = (found.result.evidence.held_out_errors or {}).values()
    before, after = (np.sqrt(sum(getattr(each, which) ** 2 for each in errors)) for which in ("before", "after"))
    made = [machine.prepare(each) for each in (run, other)]
    free = [machine.free(each) for each in made] if hasattr(machine, "free") else made
    rows = [rows_of(machine, each) for each in free]
    refit = np.sqrt(sum(float(np.mean(left**2)) / size**2 for _, left, size in rows[1].values()))
    cells = [case.title, f"{label}{'' if right else ' **wrong**'}", f"{before:.2%}, {after:.2%}", f"{refit:.2%}"]
    return cells + [f"{learned(make, *rows):.2%}" for make in learners.values()]


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--only", default="", help="cases whose title has this")
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    learners = {}
    for name, (make, library) in LEARNERS.items():
        if importlib.util.find_spec(library) is None:
            sys.stdout.write(f"{name}: skipped, {library} is not installed (pip install --group comparators)\n")
        else:
            learners[name] = make
    head = ["case", "diagnosis", "its error before, after", "refit", *learners]
    sys.stdout.write(f"| {' | '.join(head)} |\n{'|---' * len(head)}|\n")
    labels, right = collections.Counter(), 0
    for case in cases(given.seed):
        if given.only not in case.title:
            continue
        labels[case.names[0] if case.names else "nothing"] += 1
        cells = row(case, learners)
        right += "wrong" not in cells[1]
        sys.stdout.write(f"| {' | '.join(cells)} |\n")
        sys.stdout.flush()
    if labels:
        most, count = labels.most_common(1)[0]
        of = sum(labels.values())
        sys.stdout.write(f"right: the diagnosis in {right} of {of}, the commonest label ({most}) in {count}\n")


if __name__ == "__main__":
    main()
