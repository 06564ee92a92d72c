"""Faults of incremental encoders on a prescribed motion: what a decoder that knows nothing of them counts."""

import math

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.tools.faults import fault_text
from tests.harness.faults.bench import EdgeBench

RAD_PER_EDGE = math.pi / 2048.0
SIGNS = pytest.mark.parametrize("sign", [1, -1], ids=["hip", "outer ankles, mounted the other way"])


def forward(seconds):
    """2 rad/s, so 1304 edges a second."""
    return 0.1 + 2.0 * seconds


def backward(seconds):
    return 0.1 - 2.0 * seconds


def to_and_fro(seconds):
    """0.2 rad to either side, once in 100 ms."""
    return 0.1 + 0.2 * math.sin(2.0 * math.pi * seconds / 0.1)


def at_rest(seconds):
    return 0.1


def run(bench, until_ms):
    bench.step(round(until_ms * 4) - bench.loop.time // 250_000)
    return bench


def injected(bench, mode, at="10 ms", until="60 ms", **parameters):
    """The fault from 10 to 60 ms, not begun yet."""
    fault = bench.inject(bench.place, mode, at, until, **parameters)
    run(bench, 10)
    assert bench.counted == bench.true  # the board counts what the sensor sends, before
    return fault


def ends_clear(bench, fault, miscount=0):
    """At 100 ms the place shows the sensor's edges again, and the board's miscount is this."""
    before = fault.cleared_ns
    assert before == -1
    run(bench, 100)
    assert 60_000_000 < fault.cleared_ns <= 70_000_000
    assert bench.board.level_a == bench.encoder.level_a()
    counted, true = bench.counted, bench.true
    assert counted - true == miscount
    run(bench, 130)
    assert bench.true != true or bench.angle is at_rest
    assert bench.counted - bench.true == miscount  # edge for edge again
    assert fault not in bench.loop.watchers


@SIGNS
@pytest.mark.parametrize("offset", [100, -100, 7, -1])
@pytest.mark.parametrize("motion", [at_rest, forward, to_and_fro])
def test_an_offset_is_its_exact_number_of_edges_which_are_taken_back(motion, offset, sign):
    bench = EdgeBench(motion, sign)
    fault = injected(bench, "offset", offset=offset)
    before = bench.board.edges
    run(bench, 60)
    assert bench.counted - bench.true == offset
    if motion is at_rest:
        assert bench.board.edges - before == abs(offset)
    assert fault.largest_difference == offset
    assert fault.acted_ns == 10_000_000  # its first edge
    ends_clear(bench, fault)


def test_edges_of_an_offset_are_ten_microseconds_apart_so_that_a_slots_ring_takes_them():
    bench = EdgeBench(at_rest)
    injected(bench, "offset", offset=100)
    run(bench, 12)
    assert bench.board.edges == 100
    assert bench.board.shortest_ns == 10_000
    assert bench.board.latest_ns < 11_250_000  # 1 ms and what the ends of steps cost


@SIGNS
def test_a_stuck_encoder_sends_nothing_and_the_board_keeps_what_it_missed(sign):
    bench = EdgeBench(forward, sign)
    fault = injected(bench, "stuck")
    edges, true = bench.board.edges, bench.true
    run(bench, 60)
    assert bench.board.edges == edges
    missed = bench.true - true
    assert missed == pytest.approx(2.0 * 0.05 / RAD_PER_EDGE, abs=1)
    assert fault.largest_difference == -missed
    assert fault.permanent == "the board's count, until its next power-up; it uses only the rate"
    # 65 edges are missed; where that is odd, one edge sets the levels right, and counts by them
    run(bench, 61)
    assert fault.miscount in (-missed, -missed + 1, -missed - 1)
    assert fault.miscount % 2 == 0
    ends_clear_with = fault.miscount
    assert fault.cleared_ns == 60_250_000
    run(bench, 100)
    assert bench.counted - bench.true == ends_clear_with


def test_a_stuck_encoder_that_does_not_move_has_not_acted():
    bench = EdgeBench(at_rest)
    fault = injected(bench, "stuck")
    run(bench, 100)
    assert not fault.acted
    assert fault.cleared_ns > 0


@pytest.mark.parametrize(("level", "way"), [(0, -1), (1, 1), (2, 1), (3, -1)])
def test_levels_that_are_forced_are_one_edge_if_channel_a_was_at_the_other(level, way):
    bench = EdgeBench(at_rest)
    high = bench.encoder.level_a()
    fault = injected(bench, "stuck", level=level)
    run(bench, 60)
    changes = high != level >> 1
    assert bench.counted == (way if changes else 0)
    assert fault.acted == changes
    run(bench, 62)
    assert fault.cleared_ns == 60_250_000
    assert bench.board.level_a == bench.encoder.level_a()


def test_channel_b_alone_stuck_makes_a_turn_count_to_and_fro():
    bench = EdgeBench(forward)
    fault = injected(bench, "stuck", channel=2)
    before = bench.counted
    run(bench, 60)
    assert bench.board.edges > 60
    assert bench.counted - before in (-1, 0, 1)
    assert fault.acted
    run(bench, 100)
    assert bench.counted - bench.true == fault.miscount
    assert fault.cleared_ns == 60_250_000


def test_channel_a_alone_stuck_sends_nothing():
    bench = EdgeBench(forward)
    fault = injected(bench, "stuck", channel=1)
    edges = bench.board.edges
    run(bench, 60)
    assert bench.board.edges == edges
    assert fault.acted


@SIGNS
@pytest.mark.parametrize("rate", [2000, -2000])
def test_a_drift_grows_with_time(rate, sign):
    bench = EdgeBench(to_and_fro, sign)
    fault = injected(bench, "drift", rate=rate)
    run(bench, 35)
    # 25 ms of it, looked at at the last edge or the start of the last step: half an edge, and half for rounding
    assert bench.counted - bench.true == pytest.approx(rate * 0.025, abs=1.1)
    run(bench, 60)
    assert fault.largest_difference == pytest.approx(rate * 0.05, abs=1.1)
    ends_clear(bench, fault)


@SIGNS
@pytest.mark.parametrize("factor", [2.0, 1.1, 0.5, 0.0, -1.0])
@pytest.mark.parametrize("motion", [forward, backward])
def test_a_scale_multiplies_what_is_turned_from_its_start_on(motion, factor, sign):
    bench = EdgeBench(motion, sign)
    fault = injected(bench, "scale", factor=factor)
    counted, true = bench.counted, bench.true
    run(bench, 60)
    # half an edge of rounding, and an edge that has no room before the end of the step
    assert bench.counted - counted == pytest.approx(factor * (bench.true - true), abs=1.6)
    ends_clear(bench, fault)


@SIGNS
def test_noise_has_its_deviation_and_leaves_nothing(sign):
    bench = EdgeBench(to_and_fro, sign)
    fault = injected(bench, "noise", until="2 s", deviation=5)
    errors = []
    for _ in range(7960):
        bench.step()
        errors.append(bench.counted - bench.true)
    deviation = math.sqrt(sum(error * error for error in errors) / len(errors))
    # 7960 values: 0.8 % of statistical error, four times that; rounding adds 1/12 to 25; up to 25 edges fit a step
    assert deviation == pytest.approx(math.sqrt(25 + 1 / 12), rel=0.035)
    assert abs(sum(errors) / len(errors)) < 4 * 5 / math.sqrt(len(errors))
    run(bench, 2010)
    assert fault.cleared_ns > 0
    assert bench.counted == bench.true


@pytest.mark.parametrize("height", [30, -30])
def test_spikes_come_and_go(height):
    bench = EdgeBench(to_and_fro)
    fault = injected(bench, "spike", height=height, length_ms=2, pause_ms=5)
    errors = set()
    for _ in range(200):
        bench.step()
        errors.add(bench.counted - bench.true)
    assert min(errors, key=lambda error: error * height) * height >= 0
    assert {0, height} <= errors
    assert fault.largest_difference == height
    ends_clear(bench, fault)


@SIGNS
def test_quantisation_shows_multiples_of_its_step(sign):
    bench = EdgeBench(to_and_fro, sign)
    fault = injected(bench, "quantisation", step=10)
    start = bench.first * sign
    for _ in range(200):
        bench.step()
        shown = start + bench.counted
        # ten edges at 10 us apart take 100 us of the next step at most: the wire may still be on its way
        assert abs(shown - (start + bench.true)) <= 5 + 10
    bench.angle = lambda seconds: to_and_fro(0.06)
    bench.step(4)
    assert fault.largest_difference != 0
    ends = EdgeBench(at_rest, sign)
    injected(ends, "quantisation", step=10)
    run(ends, 20)
    shown = sign * ends.first + ends.counted
    assert shown % 10 == 0
    assert abs(ends.counted - ends.true) <= 5


@pytest.mark.parametrize(("low", "high"), [(-20, 30), (0, 5), (-5, 0)])
def test_saturation_ends_at_both_limits_from_where_it_starts(low, high):
    bench = EdgeBench(lambda seconds: 0.1 + 0.2 * math.sin(2.0 * math.pi * (seconds - 0.01) / 0.02))
    fault = injected(bench, "saturation", low=low, high=high)
    start = bench.counted
    shown = set()
    for _ in range(200):
        bench.step()
        shown.add(bench.counted - start)
    assert min(shown) == low
    assert max(shown) == high
    run(bench, 70)
    assert fault.cleared_ns > 0
    assert bench.counted == bench.true


@SIGNS
def test_a_delay_shows_every_edge_so_much_later(sign):
    late, prompt = EdgeBench(to_and_fro, sign), EdgeBench(to_and_fro, sign)
    fault = injected(late, "delay", delay_ms=5)
    run(prompt, 10)
    at = {}
    for bench in (late, prompt):
        at[bench] = {}
        for _ in range(160):
            bench.step()
            buffer = bench.encoder.edges
            for place in range(buffer.count):
                time_ns, level_a, level_b = buffer.edge(place)
                at[bench][time_ns] = (level_a, level_b)
    assert fault.acted_ns == min(at[prompt])  # the first edge that is not there
    expected = {t + 5_000_000: levels for t, levels in at[prompt].items() if 10_000_000 <= t < 45_000_000}
    assert at[late] == expected
    assert len(expected) > 100
    run(late, 60)
    ends_clear(late, fault)


def test_a_delay_shorter_than_the_whole_fault_shows_nothing_at_first():
    bench = EdgeBench(forward)
    injected(bench, "delay", delay_ms=20)
    edges = bench.board.edges
    run(bench, 29)
    assert bench.board.edges == edges
    run(bench, 40)
    assert bench.board.edges > edges


@SIGNS
def test_drop_outs_take_both_channels_low_and_lose_what_comes_in_them(sign):
    bench = EdgeBench(forward, sign)
    fault = injected(bench, "drop_out", length_ms=5, pause_ms=5)
    lengths = 0
    for _ in range(200):
        bench.step()
        lengths += bench.board.level_a == 0 and bench.encoder.edges.count == 0
    assert lengths > 40  # at least one of 5 ms in all
    assert fault.acted
    run(bench, 61)
    assert fault.cleared_ns == 60_250_000
    missed = fault.miscount
    assert missed < 0
    assert missed % 2 == 0
    run(bench, 100)
    assert bench.counted - bench.true == missed


@SIGNS
@pytest.mark.parametrize("motion", [forward, backward])
def test_lost_edges_take_their_successors_with_them(motion, sign):
    bench = EdgeBench(motion, sign)
    fault = injected(bench, "lost_edges", until="400 ms", share=0.2)
    true, counted = bench.true, bench.counted
    run(bench, 400)
    way = 1 if motion is forward else -1
    sent, seen = abs(bench.true - true), abs(bench.counted - counted)
    # with a share p of lost first edges, of 2p + (1 - p) edges 2p are lost: a third here; 509 edges, three deviations
    assert seen / sent == pytest.approx(1 - 1 / 3, abs=3 * math.sqrt(2 / sent))
    run(bench, 402)
    assert fault.cleared_ns == 400_250_000
    assert fault.miscount * way < 0
    run(bench, 450)
    assert bench.counted - bench.true == fault.miscount
    assert bench.board.level_a == bench.encoder.level_a()


def test_all_edges_lost_is_a_stuck_encoder_and_none_lost_does_not_act():
    bench = EdgeBench(forward)
    fault = injected(bench, "lost_edges", share=1.0)
    edges = bench.board.edges
    run(bench, 60)
    assert bench.board.edges == edges
    assert fault.acted
    bench = EdgeBench(forward)
    fault = injected(bench, "lost_edges", share=0.0)
    run(bench, 100)
    assert not fault.acted
    assert bench.counted == bench.true


@pytest.mark.parametrize("times", [1, 3])
def test_bouncing_edges_come_over_back_and_over_again(times):
    bench, healthy = EdgeBench(forward), EdgeBench(forward)
    fault = injected(bench, "contact_bounce", share=1.0, times=times)
    run(healthy, 10)
    expected = 0
    for _ in range(200):
        healthy.step()
        buffer = healthy.encoder.edges
        for place in range(buffer.count):
            # each needs 6 us, and 3 us more are left before the end of the step
            room_ns = healthy.loop.time - buffer.edge(place)[0]
            expected += min(times, max(0, (room_ns - 3_001) // 6_000))
    run(bench, 60)
    assert expected > 50 * times
    assert bench.board.edges - healthy.board.edges == 2 * expected
    assert bench.counted == bench.true
    assert bench.board.shortest_ns == 3_000
    assert abs(fault.largest_difference) == 1
    ends_clear(bench, fault)


@SIGNS
@pytest.mark.parametrize("motion", [forward, to_and_fro])
def test_swapped_channels_count_the_other_way(motion, sign):
    bench = EdgeBench(motion, sign)
    fault = injected(bench, "swapped_sign")
    true, counted = bench.true, bench.counted
    run(bench, 50)
    assert bench.counted - counted == -(bench.true - true) != 0
    run(bench, 60)
    run(bench, 61)
    miscount = fault.miscount
    assert fault.cleared_ns == 60_250_000
    run(bench, 100)
    assert bench.counted - bench.true == miscount


def test_a_second_fault_at_a_place_that_is_taken_is_refused_when_it_begins():
    bench = EdgeBench(forward)
    bench.inject(bench.place, "offset")
    bench.inject(bench.place, "stuck", at="5 ms")
    with pytest.raises(UserError, match=r"stuck.*offset.* still works at MCH.joint_encoder; one fault at a time"):
        run(bench, 10)


def test_one_that_gives_way_never_begins_where_another_works_and_the_run_goes_on():
    """Those that are asked for while the robot runs: `ctl` must not end it."""
    bench = EdgeBench(forward)
    first = bench.inject(bench.place, "offset", until="20 ms")
    late = CATALOGUE.fault(bench.place, "stuck", "5 ms", None, {})
    late.gives_way = True
    late.arm(bench)
    bench.faults.append(late)
    run(bench, 10)
    assert first.active and late.activated_ns < 0 and late.over and not late.acted
    reported = late.summary()
    assert reported["gave_way_s"] == pytest.approx(0.005)  # its start
    assert reported["gave_way_to"] == "MCH.joint_encoder:offset@0 s..20 ms still works at MCH.joint_encoder"
    assert fault_text(reported) == (
        "fault MCH.joint_encoder:stuck@5 ms: INVALID, it gave way at 0.005 s: "
        "MCH.joint_encoder:offset@0 s..20 ms still works at MCH.joint_encoder; one fault at a time"
    )
    assert first.summary()["gave_way_s"] is first.summary()["gave_way_to"] is None
    now = CATALOGUE.fault(bench.place, "stuck", None, None, {})
    now.gives_way = True
    with pytest.raises(UserError, match="offset.* still works at MCH.joint_encoder; one fault at a time"):
        now.arm(bench)  # said at once, where it would have to begin at once
    run(bench, 100)
    assert first.ended_ns == 20_000_000


def test_a_second_fault_at_a_place_may_begin_when_the_first_one_is_clear():
    bench = EdgeBench(forward)
    first = bench.inject(bench.place, "offset", at="5 ms", until="10 ms")
    second = bench.inject(bench.place, "stuck", at="20 ms", until="30 ms")
    run(bench, 40)
    assert first.acted
    assert second.acted
    assert second.cleared_ns == 30_250_000


def test_the_same_seed_gives_the_same_edges_and_another_one_others():
    def edges(seed):
        bench = EdgeBench(to_and_fro)
        bench.seed = seed
        fault = injected(bench, "lost_edges", share=0.3)
        run(bench, 60)
        return bench.board.edges, fault.acted_count

    assert edges(1) == edges(1)
    assert edges(1) != edges(2)
