"""`python -m dev.confinement_cost`: its figures, and that it refuses what it cannot compare."""

import json
import sys

import pytest

from dev import confinement_cost
from ranger_sim.foundation.user_error import UserError


def test_the_cost_is_that_of_the_medians():
    used = {
        confinement_cost.WITHOUT: [4.0, 5.0, 99.0],
        "without process numbers": [5.0, 5.1, 5.2],
        "confined": [1.0, 5.25, 6.0],
    }
    wanted = {confinement_cost.WITHOUT: 0.0, "without process numbers": 2.0, "confined": 5.0}
    assert confinement_cost.costs(used) == wanted


def test_every_kind_is_first_as_often_as_the_others_and_digests_agree(monkeypatch, tmp_path):
    order, digests = [], ["ab"] * 9

    def used_s(kind, seconds, out):
        order.append((kind, seconds))
        return 1.0

    monkeypatch.setattr(confinement_cost, "used_s", used_s)
    monkeypatch.setattr(confinement_cost, "digest_in", lambda _out: digests.pop())
    used = confinement_cost.measured(3, 2.0, tmp_path)
    assert {kind: len(each) for kind, each in used.items()} == dict.fromkeys(confinement_cost.KINDS, 3)
    assert sorted(kind for kind, _ in order[::3]) == sorted(confinement_cost.KINDS)
    assert {seconds for _, seconds in order} == {2.0}
    digests[:] = ["ab", "ab", "cd"]
    with pytest.raises(UserError, match="2 digests"):
        confinement_cost.measured(1, 2.0, tmp_path)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are confined on Linux")
def test_each_kind_is_a_walk_with_the_digest_of_the_others(tmp_path, capsys):
    code = confinement_cost.main(["--turns", "1", "--seconds", "0.05", "--json", str(tmp_path / "cost.json")])
    shown = capsys.readouterr()
    if "this system confines it" in shown.err:
        pytest.skip(shown.err)
    assert code == 0, shown.err
    kept = json.loads((tmp_path / "cost.json").read_text(encoding="utf-8"))
    assert kept["walked_s"] == 0.05 and all(each[0] > 0.1 for each in kept["processor_s"].values())
    assert [line.split("  ")[0] for line in shown.out.splitlines()] == list(confinement_cost.KINDS)
