"""Results on disk: none lost, none twice, whatever happened to who wrote them."""

import contextlib

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns.store import Store


def opened(path):
    return contextlib.closing(Store(path))


def test_results_are_there_when_the_file_is_opened_again(tmp_path):
    with opened(tmp_path / "results.jsonl") as store:
        assert store.add({"key": "a", "outcome": "fall"}) and store.add({"key": "b", "outcome": "masked"})
    with opened(tmp_path / "results.jsonl") as store:
        assert store.results == {"a": {"key": "a", "outcome": "fall"}, "b": {"key": "b", "outcome": "masked"}}


def test_a_result_is_on_the_disk_before_the_next_one_is_asked_for(tmp_path):
    with opened(tmp_path / "results.jsonl") as store:
        store.add({"key": "a"})
        assert (tmp_path / "results.jsonl").read_bytes() == b'{"key": "a"}\n'


def test_a_result_that_comes_twice_counts_once(tmp_path):
    with opened(tmp_path / "results.jsonl") as store:
        assert store.add({"key": "a", "outcome": "fall"})
        assert not store.add({"key": "a", "outcome": "fall"})
        assert store.repeated == 1 and len((tmp_path / "results.jsonl").read_text().splitlines()) == 1


@pytest.mark.parametrize("cut", [1, 5, 12])
def test_a_line_that_was_cut_short_is_dropped_and_written_again(tmp_path, cut):
    path = tmp_path / "results.jsonl"
    path.write_bytes(b'{"key": "a"}\n' + b'{"key": "b"}\n'[:cut])
    store = Store(path)
    assert set(store.results) == {"a"}
    assert store.add({"key": "b"})
    store.close()
    assert path.read_bytes() == b'{"key": "a"}\n{"key": "b"}\n'


def test_a_file_that_is_something_else_is_left_alone(tmp_path):
    path = tmp_path / "results.jsonl"
    path.write_bytes(b"something else\n")
    with pytest.raises(UserError, match=r"results\.jsonl:1: this is not a result"):
        Store(path)
    assert path.read_bytes() == b"something else\n"


def test_two_campaigns_cannot_write_one_file(tmp_path):
    first = Store(tmp_path / "results.jsonl")
    with pytest.raises(UserError, match="another campaign is writing here"):
        Store(tmp_path / "results.jsonl")
    first.close()
    Store(tmp_path / "results.jsonl").close()
