"""Faults of edges, edge by edge: what leaves the wire in one step of 250 us, at which nanosecond, and what is noted."""

import math
from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.harness.faults import edges
from ranger_sim.harness.faults.edges import VALUE_MODES, way_of
from ranger_sim.harness.faults.fault import Place

US = 1000
START, STEP = 1_000_000, 250_000
OFFSET = next(each for each in VALUE_MODES if each.mode == "offset")


class Chance:
    """Gives these numbers, one by one, and no more."""

    def __init__(self, numbers):
        self.numbers = list(numbers)

    def uniform(self):
        return self.numbers.pop(0)


class Line:
    """A fault between an encoder whose edges the test sends and a board that takes them; `count` even: A is high."""

    def __init__(self, kind, count=10, sign=1, level_b=0, chance=(), **values):
        self.encoder = Made(cell=count, sign=sign, edges=EdgeBuffer(4), level_b=lambda angle: self.level_b)
        self.encoder.position = lambda angle: self.encoder.cell + self.off
        self.off, self.level_b = 0.0, level_b
        plant = Made(encoders=[None, self.encoder], encoder_rad=lambda number: 0.25)
        self.fault = kind(Place("A.encoder", "edges", "an encoder", {"encoder": 1}), None, None, values)
        self.fault.robot = Made(plant=plant)
        self.fault.random = Chance(chance)
        self.fault.connect()
        self.noted = []
        self.fault.note = lambda time_ns, difference: self.noted.append(((time_ns - START) / US, difference))
        self.begins = START
        self.fault.activated_ns = START
        self.fault.begin(START)

    def step(self, *edges_us, clear=None):
        """[(us, A, B)] that arrive of edges at these us after the first step began; a negative one goes down."""
        for each in edges_us:
            way = -1 if each < 0 else 1
            self.encoder.cell += way
            level_a = 1 - self.encoder.cell % 2
            self.encoder.edges.push(START + round(abs(each) * US), level_a, 1 - level_a if way > 0 else level_a)
        begins, self.begins = self.begins, self.begins + STEP
        if clear is None:
            self.fault.before(begins)
            self.fault.after(begins, self.begins)
        else:
            assert self.fault.is_clear(begins, self.begins) is clear
        buffer = self.encoder.edges
        found = [buffer.edge(place) for place in range(buffer.count)]
        buffer.clear()
        return [((time_ns - START) / US, level_a, level_b) for time_ns, level_a, level_b in found]


def test_an_edge_counts_up_where_the_levels_differ():
    assert [way_of(5 << 2 | levels) for levels in range(4)] == [-1, 1, 1, -1]


# ---- faults of the value


def test_extra_edges_begin_at_once_and_come_every_ten_microseconds():
    line = Line(OFFSET, offset=3.0)
    assert line.step() == [(0, 0, 1), (10, 1, 0), (20, 0, 1)]
    assert line.noted == [(0, 3)]
    assert line.step() == [] and line.noted == [(0, 3), (500, 3)]


@pytest.mark.parametrize(("offset", "sign"), [(-2.0, 1), (2.0, -1)])
def test_extra_edges_go_the_other_way_for_the_other_sign_and_the_other_mounting(offset, sign):
    line = Line(OFFSET, count=11, sign=sign, offset=offset)
    assert line.step() == [(0, 1, 1), (10, 0, 0)]
    assert line.noted == [(0, offset)]


def test_a_step_takes_25_extra_edges_and_the_rest_follows():
    line = Line(OFFSET, offset=30.0)
    assert [each[0] for each in line.step()] == list(range(0, 250, 10))
    assert [each[0] for each in line.step()] == [250, 260, 270, 280, 290]
    assert line.noted == [(0, 25), (250, 30)]


@pytest.mark.parametrize(
    ("edge_us", "arrive"),
    [
        (5, [0, 5]),
        (3, [0, 3]),  # three microseconds are the shortest pulse
        (2.999, [2.999, 12.999]),
        (12, [0, 12]),
    ],
)
def test_an_edge_of_the_sensor_comes_at_its_time_and_extra_ones_keep_their_distance_to_it(edge_us, arrive):
    line = Line(OFFSET, offset=1.0)
    found = line.step(edge_us)
    assert [each[0] for each in found] == arrive
    assert [each[1:] for each in found] == [(0, 1), (1, 0)]
    assert line.noted == [(next(each for each in arrive if each != edge_us), 1)]


def test_extra_edges_fill_the_gaps_between_those_of_the_sensor():
    line = Line(OFFSET, offset=4.0)
    # room for one before 8 us, none before 17 (10 and 3 behind it), then the sensor's third at 35
    assert [each[0] for each in line.step(8, 17, 35)] == [0, 10, 20, 30, 40, 50, 60]
    assert line.fault.wire.count == line.encoder.cell + 4


def test_what_was_noted_first_is_the_first_edge_that_is_another_one():
    line = Line(OFFSET, offset=0.0)
    assert line.step(20, 40) == [(20, 0, 1), (40, 1, 0)] and line.noted == []
    line.fault.values["offset"] = line.fault.signal.parameters["offset"] = 1.0
    assert line.step(270) == [(250, 0, 1), (270, 1, 0)]
    assert line.noted == [(250, 1)]


def test_after_its_end_the_wire_runs_back_and_is_clear_when_it_is_there():
    line = Line(OFFSET, offset=26.0)
    line.step()
    line.step()
    assert [each[0] for each in line.step(clear=False)] == list(range(500, 750, 10))
    assert [each[0] for each in line.step(clear=True)] == [750]
    assert line.fault.wire.count == line.encoder.cell


@pytest.mark.parametrize(("off", "clear"), [(-0.51, False), (-0.5, True), (0.0, True), (1.5, True), (1.51, False)])
def test_a_sensor_is_as_its_model_within_an_edges_spacing(off, clear):
    line = Line(OFFSET, offset=0.0)
    line.off = off
    line.step(clear=clear)
    line.encoder.cell += 1  # an edge that was not sent
    line.step(clear=False)


def test_a_delay_shifts_every_edge_and_keeps_what_falls_behind_the_step():
    line = Line(edges.EdgesDelay, delay_ms=0.1)
    assert line.step(10, 60, 150, 200) == [(110, 0, 1), (160, 1, 0)]  # 250 us is the next step's
    assert line.noted == [(10, -2)]
    assert line.step(-450) == [(250, 0, 1), (300, 1, 0)]
    assert line.noted[1:] == [(250, 1)]
    assert line.step() == [(550, 0, 0)] and len(line.noted) == 2


def test_the_end_of_a_delay_lets_what_is_under_way_come_at_once():
    line = Line(edges.EdgesDelay, delay_ms=1.0)
    assert line.step(10, 20, 30) == [] and line.noted == [(10, -3)]
    assert line.step(clear=True) == [(250, 0, 1), (260, 1, 0), (270, 0, 1)]


# ---- faults of the line


@pytest.mark.parametrize(
    ("values", "first"),
    [
        ({"level": math.nan, "channel": 0}, []),
        ({"level": math.nan, "channel": 1}, []),
        ({"level": 0.0, "channel": 0}, [(0, 0, 0)]),
        ({"level": 1.0, "channel": 0}, [(0, 0, 1)]),
        ({"level": 2.0, "channel": 0}, []),
        ({"level": 3.0, "channel": 0}, []),
        ({"level": 1.0, "channel": 1}, [(0, 0, 0)]),  # B goes on as the sensor has it: low
        ({"level": 2.0, "channel": 1}, []),
    ],
)
def test_channels_that_are_stuck_jump_to_their_level_once_and_send_nothing(values, first):
    line = Line(edges.EdgesStuck, **values)
    jump = 0 if not first else 1 if first[0][1] != first[0][2] else -1
    assert line.step(20, 40, -60) == first
    assert line.noted == [(0, jump)] * len(first) + [(20, jump - 1), (40, jump - 2), (60, jump - 1)]
    assert line.step() == []
    assert line.fault.miscount == jump - 1


@pytest.mark.parametrize(("level", "passed"), [(0.0, [(20, 0, 0), (40, 1, 0)]), (1.0, [(20, 0, 1), (40, 1, 1)])])
def test_channel_b_alone_is_stuck_and_the_board_counts_to_and_fro(level, passed):
    line = Line(edges.EdgesStuck, level=level, channel=2)
    assert line.step(20, 40) == passed
    assert line.noted == ([(20, -2)] if level == 0.0 else [(40, -2)])


def test_a_stuck_channel_that_keeps_its_level_keeps_that_of_the_beginning():
    line = Line(edges.EdgesStuck, count=11, level_b=1, level=math.nan, channel=2)
    assert line.step(20, 40) == [(20, 1, 1), (40, 0, 1)]


def test_after_the_end_the_levels_are_the_sensors_and_the_miscount_stays():
    line = Line(edges.EdgesStuck, level=math.nan, channel=0)
    line.step(20)
    line.level_b = 1
    line.fault.finish(START + STEP)
    assert line.step(260, 280, clear=True) == [(250, 0, 1), (260, 1, 0), (280, 0, 1)]
    assert line.fault.miscount == 0
    down = Line(edges.EdgesStuck, level=math.nan, channel=0)
    down.step(20)
    down.fault.finish(START + STEP)
    assert down.step(clear=True) == [(250, 0, 0)] and down.fault.miscount == -2
    mounted = Line(edges.EdgesStuck, sign=-1, level=math.nan, channel=0)
    mounted.step(20, 40)
    assert mounted.step(clear=True) == [] and mounted.fault.miscount == 2
    mounted.fault.activated_ns = -1
    assert mounted.fault.miscount == 0


class Gaps:
    """On between these times, us after the start."""

    def __init__(self, *spans):
        self.spans = spans

    def on(self, now_ns):
        return any(begin <= (now_ns - START) / US < end for begin, end in self.spans)


def dropped(*spans, **more):
    line = Line(edges.EdgesDropOut, length_ms=1.0, pause_ms=1.0, chance=[], **more)
    line.fault.gaps = Gaps(*spans)
    return line


def test_without_a_supply_both_channels_are_low_until_it_is_back():
    line = dropped((0, 100))
    assert line.step(50, 150) == [(0, 0, 0), (150, 1, 0)]
    assert line.noted == [(0, -1), (50, -2)]
    assert line.step() == []


def test_a_supply_that_fails_at_an_edge_takes_it_along():
    line = dropped((50, 260), count=11)
    assert line.step(20, 60) == [(20, 1, 0), (60, 0, 0)]
    assert line.noted == [(60, -2), (60, -2)]
    line.level_b = 1
    assert line.step(270) == [(270, 1, 0)]  # low at 250 and high with the sensor's edge


def test_a_supply_that_comes_back_between_edges_shows_the_sensors_levels():
    line = dropped((0, 100))
    assert line.step() == [(0, 0, 0)]
    line.level_b = 1
    assert line.step() == [(250, 1, 1)] and line.fault.miscount == -2


def test_a_drop_out_begins_at_once():
    line = Line(edges.EdgesDropOut, length_ms=1.0, pause_ms=1e6, chance=[0.5])
    assert line.step(20) == [(0, 0, 0)] and [line.step() for _ in range(2)] == [[], []]


def test_a_lost_edge_takes_the_next_one_with_it():
    line = Line(edges.LostEdges, share=0.5, chance=[0.5, 0.499, 0.6])
    assert line.step(10, 20, 30, 40) == [(10, 0, 1), (40, 1, 0)]
    assert line.noted == [(20, -1)] and line.fault.miscount == -2


def test_a_contact_bounces_so_often_and_three_microseconds_each_way():
    line = Line(edges.ContactBounce, share=0.5, times=2.0, chance=[0.499, 0.5])
    assert line.step(10, 100) == [(10, 0, 1), (13, 1, 1), (16, 0, 1), (19, 1, 1), (22, 0, 1), (100, 1, 0)]
    assert line.noted == [(13, -1), (19, -1)] and line.fault.miscount == 0


@pytest.mark.parametrize(
    ("sent", "arrive"),
    [
        ((10, 19), [10, 19]),
        ((10, 19.001), [10, 13, 16, 19.001]),
        ((10, 25), [10, 13, 16, 25]),
        ((10, 25.001), [10, 13, 16, 19, 22, 25.001]),
        ((241,), [241]),
        ((240.999,), [240.999, 243.999, 246.999]),
    ],
)
def test_a_contact_bounces_only_where_the_next_edge_leaves_time_for_it(sent, arrive):
    line = Line(edges.ContactBounce, share=0.5, times=2.0, chance=[0.0, 0.9][: len(sent)])
    assert [each[0] for each in line.step(*sent)] == arrive


def test_swapped_wires_count_every_edge_the_other_way():
    line = Line(edges.EdgesSwapped)
    assert line.step(10, 20, -30) == [(10, 0, 0), (20, 1, 1), (30, 0, 1)]
    assert line.noted == [(10, -2), (20, -4), (30, -2)]
    assert line.step(clear=True) == []


def test_the_place_or_the_kind_reports_how_long_a_miscount_lasts():
    assert Line(edges.EdgesSwapped).fault.permanent == edges.KEPT
    line = Line(edges.EdgesSwapped)
    line.fault.place = Place("A", "edges", "x", {"encoder": 1, "kept": "a reset"})
    line.fault.connect()
    assert line.fault.permanent == "a reset"
