"""Router, user interface and main brain on a real bus and link: keys go up, lights and time come down."""

import pytest

from ranger_sim.boards.can_router import CanRouterBoard
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.modules.ssp_link import EXCHANGE_NS, empty_segment
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.user_interface import PINS, UserInterfaceBoard
from ranger_sim.can_bus.bus import Bus
from ranger_sim.datatable.generated import errors
from ranger_sim.datatable.generated import mb as table
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.events import CAN_MODE, CAN_REQUEST, PIN_EDGE, SSP_LOAD, SSP_SEGMENT, SSP_START

MS = 1_000_000
QUANTUM = 25_000


class ThreeBoards:
    """The middle of the robot, in the harness's order: buses, boards, outputs. No motor boards, no body."""

    def __init__(self, **quirks):
        switches = Quirks.named(**quirks)
        self.ui = UserInterfaceBoard(Crystal(10_000_000, 21_000), switches, 310_000)
        self.router = CanRouterBoard(Crystal(10_000_000, -9_000), switches, 120_000)
        self.brain = MainBrainBoard(Crystal(13_000_000, 14_000), switches, 777_000)
        self.boards = [self.ui, self.router, self.brain]
        self.buses = {}
        self.nodes = {}
        for n in (1, 2, 3, 4):
            bus = Bus(f"CAN{n}", 3_000_000)
            self.buses[n] = bus
            self.nodes[self.router, n] = (bus, bus.add_node("CSR", self.router.inbox, n, 512 + 1))
        bus = self.buses[2]
        self.nodes[self.ui, 2] = (bus, bus.add_node("UI", self.ui.inbox, 2, 512))
        for n in (1, 3, 4):  # somebody who acknowledges the sync frames
            self.buses[n].add_node("other", type(self.ui.inbox)(), 1, 512 + 2)
        self.loaded = empty_segment()
        self.time = 0

    def run(self, until):
        while self.time < until:
            for bus in self.buses.values():
                bus.advance(self.time)
                bus.log.take()
            for board in self.boards:
                board.advance(self.time + QUANTUM)
                out = board.outbox
                while out.take():
                    if out.kind == CAN_REQUEST:
                        bus, node = self.nodes[board, out.a]
                        bus.request(node, out.b, out.time, out.c, out.d, out.e, out.f)
                    elif out.kind == CAN_MODE:
                        bus, node = self.nodes[board, out.a]
                        bus.set_mode(node, out.b, out.time)
                    elif out.kind == SSP_START:
                        end = out.time + EXCHANGE_NS
                        self.brain.inbox.push(end, 768, SSP_SEGMENT, 0, 0, 0, 0, 0, 0, out.ref)
                        self.router.inbox.push(end, 768, SSP_SEGMENT, 0, 0, 0, 0, 0, 0, self.loaded)
                    elif out.kind == SSP_LOAD:
                        self.loaded = out.ref
            self.time += QUANTUM


@pytest.fixture(scope="module")
def robot():
    three = ThreeBoards()
    three.run(400 * MS)
    return three


def test_the_main_brain_and_the_user_interface_know_the_time_to_two_milliseconds(robot):
    now = robot.router.time.ms
    assert now == 399
    assert 0 <= now - robot.ui.time.ms <= 1
    assert 0 <= now - robot.brain.time.ms <= 3


def test_what_the_user_interface_publishes_is_in_the_data_table(robot):
    assert robot.brain.store.get_float(table.UI_STATUS) == 1.0
    assert robot.brain.store.get_float(table.UI_MAX_EXECUTION_TIME) > 0
    # sent at most 45 ms ago, its stamp is the time the frame was built
    assert 0 <= robot.router.time.ms - robot.brain.store.stamp(table.UI_BUTTONS) <= 45 + 4


def test_the_main_brain_colours_the_lights(robot):
    assert [robot.ui.panel.colour(i) for i in range(6)] == [
        robot.brain.store.get_int(number) for number in range(table.UI_SET_LED_1, table.UI_SET_LED_6 + 1)
    ]
    assert robot.ui.panel.colour(0) != 0  # stand-by has its colour


def test_a_key_reaches_the_data_table_within_sixty_milliseconds(robot):
    robot.ui.inbox.push(robot.time + 1000, 256, PIN_EDGE, PINS["key_2"], 1, -1, 0)
    robot.run(robot.time + 60 * MS)
    assert robot.brain.store.get_int(table.UI_BUTTONS) == 4
    robot.ui.inbox.push(robot.time + 1000, 256, PIN_EDGE, PINS["key_2"], 0, -1, 0)
    robot.run(robot.time + 60 * MS)
    assert robot.brain.store.get_int(table.UI_BUTTONS) == 0


def test_nothing_is_lost_late_or_wrong_but_the_first_segment(robot):
    assert sum(robot.router.router.transmit_lost) == 0
    assert robot.router.router.receive_lost == 0
    assert robot.router.link.transmit_lost == 0
    assert robot.ui.can.receive_lost == 0
    assert [board.scheduler.overruns for board in robot.boards] == [0, 0, 0]
    assert {code: n for code, n in enumerate(robot.router.errors.totals) if n} == {errors.SSP_LOW_RATE: 1}
    assert {code for code, n in enumerate(robot.ui.errors.totals) if n} == set()
    assert robot.brain.errors.totals[errors.MB_SSP_CHKSUM] == 1
    assert list(robot.router.clock.skipped) == [0] * 5


def test_the_traffic_of_the_users_bus_is_that_of_the_firmware():
    three = ThreeBoards()
    three.run(200 * MS)
    sync = three.buses[2].counters.frames_by_identifier[0]
    up = three.ui.can_controller.sent
    three.run(1200 * MS)
    # per second: 1000 sync, 955.6 up (robot.md N1.10); down only what the main brain rewrites
    assert three.buses[2].counters.frames_by_identifier[0] - sync == pytest.approx(1000, abs=1)
    assert three.ui.can_controller.sent - up == pytest.approx(955.6, rel=0.01)
    assert 0 <= three.router.can2.sent - three.ui.can.received <= 1
    assert 0 <= three.ui.can_controller.sent - three.router.can2.received <= 1


def test_with_the_lag_the_last_key_still_arrives_because_other_frames_follow():
    three = ThreeBoards(router_one_frame_lag=True)
    three.run(100 * MS)
    three.ui.inbox.push(three.time + 1000, 256, PIN_EDGE, PINS["key_5"], 1, -1, 0)
    three.run(three.time + 60 * MS)
    assert three.brain.store.get_int(table.UI_BUTTONS) == 32
