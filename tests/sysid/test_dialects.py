"""A sample of the dialects and accidents of one true recording; `python -m dev.dialects` reads all of them."""

import pytest

from ranger_sim.foundation.random_arrays import generator
from tests.sysid import dialects

SAMPLE = 40
DIALECTS = dict(dialects.dialects())
ACCIDENTS = dict(dialects.accidents())


def some(names, seed):
    return sorted(generator(seed, "sample of dialects").permutation(sorted(names))[:SAMPLE].tolist())


def test_there_are_as_many_dialects_and_accidents_as_the_documentation_says():
    assert len(DIALECTS) == 258 and len(ACCIDENTS) == 69


@pytest.mark.parametrize("name", some(DIALECTS, 1))
def test_a_dialect_is_read_as_the_truth(name, tmp_path):
    assert dialects.judged_dialect(DIALECTS[name], tmp_path) == (dialects.RIGHT, "")


@pytest.mark.parametrize("name", some(ACCIDENTS, 2))
def test_an_accident_is_mended_named_or_refused_with_its_reason(name, tmp_path):
    verdict, reason = dialects.judged_accident(ACCIDENTS[name](), tmp_path)
    assert verdict in (dialects.RIGHT, dialects.REFUSED), reason
