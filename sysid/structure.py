"""Analysis of equations by their structure alone: the unknowns of each, and the over-determined equations.

Data can contradict the part of a set of equations that has more equations than unknowns (Dulmage and Mendelsohn 1958).
A fault that enters equation e is detectable when e is in that part; it can be separated from a fault in f when e is
still in it without f (Krysander and Frisk 2008, Sensor placement for fault diagnosis). A derivative counts as the
unknown that it is the derivative of.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

Incidence = Mapping[str, frozenset[str]]  # equation: its unknowns


def overdetermined(equations: Incidence) -> set[str]:
    """The equations of the over-determined part: those that an unmatched one reaches by alternating paths."""
    rows = list(equations)
    unknowns = sorted({unknown for each in equations.values() for unknown in each})
    if not rows:
        return set()
    if not unknowns:
        return set(rows)
    place = {unknown: column for column, unknown in enumerate(unknowns)}
    pairs = [(row, place[unknown]) for row, name in enumerate(rows) for unknown in sorted(equations[name])]
    where = ([row for row, _ in pairs], [column for _, column in pairs])
    matrix = csr_matrix((np.ones(len(pairs)), where), shape=(len(rows), len(unknowns)))
    equation_of = maximum_bipartite_matching(matrix, perm_type="row")  # of each unknown, -1: none
    matched = set(equation_of[equation_of >= 0].tolist())
    reached = {row for row in range(len(rows)) if row not in matched}
    waiting = list(reached)
    while waiting:
        for unknown in equations[rows[waiting.pop()]]:
            owner = int(equation_of[place[unknown]])
            if owner >= 0 and owner not in reached:
                reached.add(owner)
                waiting.append(owner)
    return {rows[row] for row in reached}


def isolable(equations: Incidence, faults: Mapping[str, Sequence[str]]) -> dict[str, set[str]]:
    """{fault: faults that it can be separated from}, of the detectable ones. faults: {fault: equations it enters}.

    A fault in several equations can be separated from another when one of its equations stays over-determined without
    all of the other's.
    """
    whole = overdetermined(equations)
    detectable = [fault for fault, where in faults.items() if whole & set(where)]
    found: dict[str, set[str]] = {fault: set() for fault in detectable}
    without: dict[frozenset[str], set[str]] = {}
    for other in detectable:
        left_out = frozenset(faults[other])
        if left_out not in without:
            kept = {name: each for name, each in equations.items() if name not in left_out}
            without[left_out] = overdetermined(kept)
        for fault in detectable:
            if without[left_out] & set(faults[fault]):
                found[fault].add(other)
    return found
