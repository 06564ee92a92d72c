"""Deadlines of the developers' tools on a busy machine."""

from dev import load


def test_a_deadline_passes_later_by_what_processes_waited_for_a_processor(monkeypatch):
    now, waited = [100.0], [7.0]
    monkeypatch.setattr(load.wallclock, "monotonic_s", lambda: now[0])
    monkeypatch.setattr(load, "waited_s", lambda: waited[0])
    deadline = load.Deadline(30.0)
    assert deadline.left_s() == 30.0
    now[0] = 131.0
    assert deadline.left_s() == -1.0
    waited[0] = 10.0  # of the 31 s, processes waited in 3
    assert deadline.left_s() == 2.0


def test_a_deadline_is_not_held_up_for_ever(monkeypatch):
    monkeypatch.setattr(load, "waited_s", lambda: 0.0)
    deadline = load.Deadline(30.0)
    monkeypatch.setattr(load, "waited_s", lambda: 1e9)
    assert load.MOST_S < deadline.left_s() <= load.MOST_S + 30.0


def test_the_time_waited_is_read_from_the_kernel_or_is_0(monkeypatch, tmp_path):
    file = tmp_path / "cpu"
    monkeypatch.setattr(load, "PRESSURE", file)
    assert load.waited_s() == 0.0
    file.write_text("some avg10=1.00 avg60=2.00 avg300=3.00 total=6937603\nfull avg10=0.00 total=5\n", encoding="ascii")
    assert round(load.waited_s(), 6) == 6.937603
