"""pyxcp, another's XCP master, measures and sets parameters over both transports while the robot runs."""

import contextlib
import json
import os
import pathlib
import subprocess
import sys

import pytest

from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.datatable import parameters
from ranger_sim.datatable.addresses import XCP_MASTER_ID, XCP_SLAVE_ID, address_of
from ranger_sim.harness.xcp.can import XcpCanProbe
from ranger_sim.harness.xcp.udp import XcpUdpServer
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

pytest.importorskip("pyxcp")
MASTER = pathlib.Path(__file__).with_name("pyxcp_master.py")
MOST_S = 300.0  # of the robot's time; pyxcp alone takes a second or two of a processor to start


@pytest.fixture
def robot():
    with contextlib.closing(Ranger(Scenario(seed=3))) as made:
        yield made


def over_udp(robot):
    server = XcpUdpServer(robot, 0)
    robot.attach(server)
    return str(server.port)


def over_can(robot):
    name = f"pyxcp-{os.getpid()}"
    robot.attach(XcpCanProbe(robot))
    robot.attach(AttachServer(name, {bus.name: bus for bus in robot.buses}))
    return f"{name}/can2,{XCP_MASTER_ID},{XCP_SLAVE_ID}"


@pytest.mark.parametrize("transport", [over_udp, over_can])
def test_pyxcp_measures_at_half_a_millisecond_and_writes_only_what_the_one_check_takes(robot, transport):
    where = transport(robot)
    row = next(
        each
        for each in parameters.parameters()
        if each.type == "f32" and each.minimum is not None and each.minimum <= 0.5 <= (each.maximum or 0.0) < 1e9
    )
    names = ("TIMESTAMP", "MCH_BATT_POWER")
    seen = {}
    numbers = [parameters.find(name).id for name in names]
    addresses = [str(address_of(number)) for number in (*numbers, row.id)]
    master = subprocess.Popen(
        [sys.executable, MASTER, where, *addresses], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    try:
        while master.poll() is None and robot.time_s < MOST_S:
            robot.run_for(0.0005)
            seen[robot.loop.time // 1000] = [robot.variable(name) for name in names]
    finally:
        master.kill()
        output = master.communicate()[0].decode()
    assert "FOUND " in output, output
    found = json.loads(output.partition("FOUND ")[2])
    assert found["name"] == "ranger"  # ranger.a2l describes it
    assert "OUT_OF_RANGE" in found["refused"] and "ACCESS_DENIED" in found["measured_refused"]
    assert found["accepted"] is None and found["now"] == 0.5 == robot.variable(row.name)
    rows = found["rows"]
    assert len(rows) >= 200
    stamps = [stamp for stamp, *_ in rows]
    assert {b - a for a, b in zip(stamps, stamps[1:], strict=False)} == {500_000}  # pyxcp counts in ns
    # it counts from the first packet on; the network time in each row says when that was, to its resolution of 1 ms
    starts = [at for at in seen if all(seen.get(at + stamp // 1000) == values for stamp, *values in rows)]
    assert len(starts) == 1
