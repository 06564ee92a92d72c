"""What other methods leave of the hidden effects of `hidden_effects`: a refit alone, and two learners without physics.

    python -m tests.sysid.comparators --only "heated rod"

For each case the error on another run, as a share of what was measured and over all outputs: of the model refitted, of
the diagnosis, and of a kernel ridge and gradient boosting, which learn what the refitted model leaves from the
machine's signals. The last line is how often the commonest label would be right. Needs scikit-learn.
"""

import argparse
import collections
import sys

import numpy as np

from ranger_sim.sysid.bands import plain
from ranger_sim.sysid.regression import kept_rows
from tests.sysid.hidden_effects import CASES

MOST_ROWS = 2000  # for the kernel's matrix


def rows_of(machine, recording):
    """(features (n, k), residual by equation): signals at the rows that count, and what the refitted model leaves."""
    regression = plain([recording])
    values = np.array([regression.values[each] for each in regression.names])
    names = [*machine.states, *(each.channel for each in machine.outputs)]
    features = np.column_stack([kept_rows(recording, recording.signals[name]) for name in names])
    return features, {name: part.response - part.measured @ values for name, part in regression.parts.items()}


def learned(make, machine, run, other):
    """rms that is left on the other run over what was measured there, over all outputs."""
    x, left = rows_of(machine, run)
    x_other, left_other = rows_of(machine, other)
    mean, size = x.mean(axis=0), x.std(axis=0)
    every = max(1, len(x) // MOST_ROWS)
    total = 0.0
    for name, residual in left.items():
        scale = float(np.std(other.table[name]))
        model = make().fit(((x - mean) / size)[::every], residual[::every] / scale)
        total += float(np.mean((left_other[name] / scale - model.predict((x_other - mean) / size)) ** 2))
    return np.sqrt(total)


def main():
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.kernel_ridge import KernelRidge

    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--only", default="")
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    labels = collections.Counter()
    sys.stdout.write(f"{'case':26}  refit  diagnosis  kernel ridge  gradient boosting\n")
    for case in CASES:
        if given.only.replace(" ", "-") not in case.title:
            continue
        labels[case.names[0] if case.names else ("nothing", "")] += 1
        errors = case.found(given.seed).errors.values()
        before, after = (np.sqrt(sum(getattr(each, which) ** 2 for each in errors)) for which in ("before", "after"))
        machine = case.machine()
        run, other = (
            machine.prepare(case.make(case.cause, case.size, each)) for each in (given.seed, given.seed + 100)
        )
        run, other = machine.free(run), machine.free(other)
        kernel = learned(lambda: KernelRidge(alpha=0.1, kernel="rbf", gamma=0.1), machine, run, other)
        boosted = learned(lambda: HistGradientBoostingRegressor(random_state=0), machine, run, other)
        sys.stdout.write(f"{case.title:26} {before:6.2%} {after:9.2%} {kernel:12.2%} {boosted:12.2%}\n")
        sys.stdout.flush()
    most = labels.most_common(1)[0]
    sys.stdout.write(f"the commonest label is right in {most[1]} of {sum(labels.values())}\n")


if __name__ == "__main__":
    main()
