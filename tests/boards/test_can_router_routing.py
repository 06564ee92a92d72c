"""Routing of frames between the buses and the link: table, order, rings, the one-frame lag."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.boards.modules.can_load import CanLoad
from ranger_sim.boards.modules.routing import Router, RoutingTable
from ranger_sim.boards.modules.ssp_link import MainBrainSspLink, RouterSspLink
from ranger_sim.datatable.generated import errors, routes
from ranger_sim.foundation.events import FLAG_REMOTE

EIGHT_BYTES = 8  # flags of a data frame of eight bytes, identifier of 11 bits


def build(lag=False, table=None):
    said = []
    table = RoutingTable(enumerate(routes.DESTINATIONS)) if table is None else table
    return Router(table, RouterSspLink(said.append), CanLoad(), said.append, lag), said


def queued(router, channel):
    """Frames in the transmit ring of a bus, oldest first."""
    n = router.frames_for(channel)
    first = router.tx_read[channel]
    rows = [4 * (channel * 8 + (first + i) % 8) for i in range(n)]
    return [(router.tx_rows[r], router.tx_rows[r + 2], router.tx_rows[r + 3]) for r in rows]


def to_main_brain(router):
    """Identifiers that wait for the link."""
    brain = MainBrainSspLink(lambda code: None, 2031, False)
    got = []
    while router.ssp.half_words_waiting():
        brain.receive(router.ssp.next_segment(10**9))
        brain.parse()
        got += [identifier for identifier, _, _ in brain.parsed()]
    return got


def test_a_sensor_value_goes_to_the_main_brain_and_nowhere_else():
    router, _ = build()
    router.receive(1, 14, 8, 7, 9)  # MCH_ANGLE from CAN1
    router.route_step(0)
    assert to_main_brain(router) == [14]
    assert [router.frames_for(c) for c in (1, 2, 3, 4)] == [0, 0, 0, 0]


def test_an_identifier_that_no_table_names_goes_to_the_main_brain():
    router, _ = build()
    router.receive(3, 1999, 8, 7, 9)
    router.route_step(0)
    assert to_main_brain(router) == [1999]


@pytest.mark.parametrize(("identifier", "channel"), [(16, 1), (36, 3), (64, 4), (113 + 2, 4), (134, 2), (173, 2)])
def test_a_command_from_the_main_brain_goes_to_the_bus_of_its_board(identifier, channel):
    router, _ = build()
    assert routes.DESTINATIONS[identifier] == 1 << channel
    router.route(0, identifier, 8, 11, 12, 0)
    for c in (1, 2, 3, 4):
        assert queued(router, c) == ([(identifier, 11, 12)] if c == channel else [])
    assert to_main_brain(router) == []


def test_the_main_brains_status_goes_to_all_four_buses():
    router, _ = build()
    assert router.route(0, 9, 8, 1, 2, 0) == 4
    assert [queued(router, c) for c in (1, 2, 3, 4)] == [[(9, 1, 2)]] * 4


def test_a_frame_never_returns_to_the_bus_it_came_from():
    table = RoutingTable([(100, 0b11111)])
    for source in range(5):
        router, _ = build(table=table)
        assert router.route(source, 100, 8, 0, 0, 0) == 4
        assert (router.ssp.half_words_waiting() > 0) == (source != 0)
        for c in (1, 2, 3, 4):
            assert router.frames_for(c) == (0 if c == source else 1)


def test_the_table_learns_a_source_and_silently_relearns_it():
    router, said = build()
    assert router.table.sources[14] == 7
    router.route(1, 14, 8, 0, 0, 0)
    assert router.table.sources[14] == 1
    router.route(3, 14, 8, 0, 0, 0)
    assert router.table.sources[14] == 3
    assert (router.table.learned, router.table.changed) == (1, 1)
    assert said == []


def test_one_step_takes_one_frame_of_each_source_in_the_order_link_bus_own():
    router, _ = build()
    brain = MainBrainSspLink(lambda code: None, 2031, False)
    for identifier in (134, 135):
        brain.send(identifier, 0, 0)
    brain.flush()
    router.ssp.tick(0)
    router.ssp.receive(brain.next_segment())
    router.ssp.tick(200_000)
    router.receive(1, 14, 8, 0, 0)
    router.receive(1, 15, 8, 0, 0)
    router.send(160, 0, 0)
    router.send(161, 0, 0)
    assert router.route_step(0) == 3
    assert queued(router, 2) == [(134, 0, 0)]
    assert to_main_brain(router) == [14, 160]
    assert router.route_step(0) == 3
    assert queued(router, 2) == [(134, 0, 0), (135, 0, 0)]
    assert to_main_brain(router) == [15, 161]
    assert router.route_step(0) == 0


def test_without_the_lag_every_frame_is_forwarded_at_once():
    router, _ = build()
    got = []
    for identifier in (14, 21, 15, 37):
        router.receive(1, identifier, 8, 0, 0)
        router.route_step(0)
        got.append(to_main_brain(router))
    assert got == [[14], [21], [15], [37]]


def test_with_the_lag_the_robots_own_injection_sequence_comes_out():
    # robot.md N1.5: of 14, 21, 15, 37 each appears when its successor is received; the first reception yields nothing
    router, _ = build(lag=True)
    got = []
    for identifier in (14, 21, 15, 37):
        router.receive(1, identifier, 8, 0, 0)
        router.route_step(0)
        got.append(to_main_brain(router))
    assert got == [[], [14], [21], [15]]


def test_the_first_pop_of_the_lagging_ring_is_an_all_zero_record():
    # identifier 0 from channel 0, the link: the time stamp's only destination is the link itself
    router, _ = build(lag=True)
    router.receive(1, 14, 8, 0, 0)
    assert router.route_step(0) == 1
    assert router.table.sources[0] == 0
    assert router.copies == 0


@pytest.mark.parametrize("lag", [False, True])
def test_sixty_three_frames_fit_the_receive_ring_and_the_next_is_reported(lag):
    router, said = build(lag=lag)
    assert [router.receive(2, 142, 8, i, 0) for i in range(64)] == [True] * 63 + [False]
    assert said == [errors.CAN2_RX_BUF_OF]
    assert router.receive_lost == 1


def test_a_full_transmit_ring_loses_the_new_frame_silently():
    router, said = build()
    for i in range(9):
        router.route(0, 134, 8, i, 0, 0)
    assert [f[1] for f in queued(router, 2)] == list(range(7))
    assert router.transmit_lost[2] == 2
    assert said == []


def test_the_own_ring_holds_seven():
    router, _ = build()
    assert [router.send(160, i, 0) for i in range(8)] == [True] * 7 + [False]


def test_a_remote_frame_subscribes_its_bus_and_is_not_forwarded():
    router, _ = build()
    router.route(1, 14, 8, 1, 1, 0)  # the router knows that 14 comes from CAN1
    router.route(2, 14, FLAG_REMOTE, 0, 0, 0)
    assert queued(router, 1) == []
    router.route(1, 14, 8, 5, 6, 0)
    assert queued(router, 2) == [(14, 5, 6)]


def test_identifiers_that_can_forbids_are_counted_and_dropped():
    router, _ = build()
    assert router.route(1, 2040, 8, 0, 0, 0) == 0
    assert router.unroutable == 1


def test_the_load_counter_reports_the_largest_millisecond_since_the_last_report():
    load = CanLoad()
    for n in (3, 9, 5):
        for _ in range(n):
            load.count(2)
        load.end_of_millisecond()
    assert load.report_peak(2) == 9.0
    load.count(2)
    load.end_of_millisecond()
    assert load.report_peak(2) == 1.0
    assert load.report_peak(1) == 0.0


events = st.lists(
    st.one_of(
        st.tuples(st.just("bus"), st.integers(1, 4), st.integers(0, 313)),
        st.tuples(st.just("own"), st.just(5), st.integers(160, 168)),
        st.tuples(st.just("step"), st.just(0), st.just(0)),
    ),
    max_size=60,
)


@given(events)
def test_every_frame_received_is_routed_exactly_once_and_in_order(script):
    router, _ = build()
    expected, got = {c: [] for c in range(6)}, []
    routed = {c: [] for c in range(6)}
    number = 0
    copies = 0
    for what, channel, identifier in script:
        number += 1
        if what == "bus":
            assert router.receive(channel, identifier, 8, number, 0)
            expected[channel].append(number)
            copies += destinations(identifier, channel)
        elif what == "own":
            if router.send(identifier, number, 0):
                expected[5].append(number)
                copies += destinations(identifier, channel)
        else:
            router.route_step(0)
        got += drain(router)
    for _ in range(70):
        router.route_step(0)
        got += drain(router)
    for source, n in got:
        routed[source].append(n)
    # a frame to one bus only that came from there goes nowhere; all others appear once per destination
    for c in range(1, 6):
        assert routed[c] == sorted(routed[c])
        assert set(routed[c]) <= set(expected[c])
    assert router.routed == sum(len(v) for v in expected.values())
    assert router.copies == copies


def destinations(identifier, source):
    return bin(routes.DESTINATIONS[identifier] & ~(1 << source)).count("1")


def drain(router):
    """(source, number) of every copy made since the last call, with the rings emptied."""
    out = []
    for c in (1, 2, 3, 4):
        for f in queued(router, c):
            out.append((router.table.sources[f[0]], f[1]))
    router.tx_read = list(router.tx_write)
    while router.ssp.half_words_waiting():
        router.ssp.next_segment(10**9)
    return out


def test_a_frame_of_the_routers_own_is_a_data_frame_of_eight_bytes():
    router, _ = build(table=RoutingTable([(900, 1 << 1)]))
    router.send(900, 5, 6)
    assert router.route_step(0) == 1
    row = 4 * 8  # of CAN1
    assert list(router.tx_rows[row : row + 4]) == [900, EIGHT_BYTES, 5, 6]
