"""Waiting for descriptors: what is ready, what is not, and numbers that `select` does not know."""

import contextlib
import os
import resource

import pytest

from ranger_sim.foundation import descriptors

BEYOND = 1030  # FD_SETSIZE is 1024


@contextlib.contextmanager
def pipe(lowest):
    """(reading, writing) ends with numbers from `lowest` on."""
    moved = []
    for end in os.pipe():
        moved.append(os.dup2(end, lowest + len(moved)))
        os.close(end)
    yield tuple(moved)
    for end in moved:
        with contextlib.suppress(OSError):
            os.close(end)


@pytest.fixture(params=[200, BEYOND])
def ends(request):
    if resource.getrlimit(resource.RLIMIT_NOFILE)[0] <= BEYOND + 2:
        pytest.skip(f"needs descriptors to {BEYOND + 2} (ulimit -n)")
    with pipe(request.param) as made:
        yield made


def test_without_data_a_wait_returns_when_the_time_is_over(ends):
    reading, writing = ends
    assert descriptors.wait([reading], [], 0.001) == ([], [])
    assert descriptors.wait([reading], [writing], 0.001) == ([], [writing])


def test_a_readable_descriptor_is_returned_at_once(ends):
    reading, writing = ends
    os.write(writing, b"x")
    assert descriptors.wait([reading], [], 60.0) == ([reading], [])
    assert descriptors.wait([reading], [writing], 60.0) == ([reading], [writing])


def test_an_end_whose_other_end_is_closed_can_be_read(ends):
    reading, writing = ends
    os.close(writing)
    assert descriptors.wait([reading], [], 60.0) == ([reading], [])
    assert os.read(reading, 1) == b""


def test_a_time_that_is_over_does_not_wait(ends):
    reading, _ = ends
    assert descriptors.wait([reading], [], -1.0) == ([], [])
