"""The fuzzer of a board's gdb port: a sample passes, and the faults that it looks for are found."""

import pytest

from dev.fuzz import Finding, gdb
from ranger_sim.firmware_sim.gdb import server, stub


def test_hostile_debuggers_stop_nothing():
    counted = gdb.run(600, seed=4)
    assert counted["cases"] == 600 and counted["well_behaved"] == 15
    assert counted["requests"] > 500 and counted["frames"] > 300


def test_an_endpoint_that_sends_a_wrong_checksum_is_found(monkeypatch):
    monkeypatch.setattr(server.packets, "framed", lambda payload: b"$" + payload + b"#zz"[:1] + b"01")
    with pytest.raises(Finding, match="a wrong checksum"):
        gdb.run(200, seed=4)


def test_an_endpoint_that_sends_half_the_registers_is_found(monkeypatch):
    answer = stub.Stub.answer
    monkeypatch.setattr(stub.Stub, "answer", lambda self, payload: b"00" if payload == b"g" else answer(self, payload))
    with pytest.raises(Finding, match="a well-behaved debugger asked b'g'"):
        gdb.run(200, seed=4)
