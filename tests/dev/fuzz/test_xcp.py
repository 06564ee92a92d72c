"""The fuzzer of the XCP port: a sample passes, and the faults that it looks for are found."""

import pytest

from dev.fuzz import Finding, xcp
from ranger_sim.harness.xcp import slave, udp
from ranger_sim.harness.xcp.table_memory import TableMemory


def test_hostile_masters_stop_nothing():
    counted = xcp.run(600, seed=4)
    assert counted["cases"] == 600 and counted["well_behaved_answered"] == 12
    assert counted["commands"] > 1000 and counted["measurements"] > 50 and counted["sent_away_malformed"] > 0


def test_the_same_seed_gives_the_same_cases():
    assert xcp.run(200, seed=9) == xcp.run(200, seed=9)


def test_a_slave_that_writes_a_value_that_is_not_a_parameter_is_found(monkeypatch):
    def written(self, address, data):
        if 0x10000 <= address < self.end:
            self.robot.board("MB").memory[(address - 0x10000) // 4] = 1 + int.from_bytes(data[:3], "little")

    monkeypatch.setattr(TableMemory, "write", written)
    with pytest.raises(Finding, match="a variable that is not a parameter was written"):
        xcp.run(3000, seed=4)


def test_a_slave_that_does_not_answer_is_found(monkeypatch):
    monkeypatch.setattr(slave.Slave, "command", lambda self, packet, time_ns: b"")
    with pytest.raises(Finding, match="a well-behaved master is not answered"):
        xcp.run(200, seed=4)


def test_an_endpoint_that_takes_too_many_commands_in_a_poll_is_found(monkeypatch):
    import dataclasses

    monkeypatch.setattr(udp, "RULE", dataclasses.replace(udp.RULE, burst=100_000))
    with pytest.raises(Finding, match="more commands in a poll"):
        xcp.run(3000, seed=4)
