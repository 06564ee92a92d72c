"""Every edge of an encoder against its definition: edges lie at whole numbers and the disc's errors, times by splines.

The position between the ends of a step is scipy's Hermite spline; where it runs one way at about the same speed, it is
the spline of time over position. The next edge follows from the position, one edge at a time.
"""

import cmath
import math

import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder

STEP = 125_000
SECOND = 1_000_000_000


class Disc:
    """A disc as the module's doc string has it; `position` takes complex angles, so that it gives its own slope."""

    def __init__(self, lines, gear=1.0, sign=1, line_error=0.0, duty_error=0.0, jitter=0.0, seed=0):
        self.lines, self.gear, self.sign, self.jitter = lines, gear, sign, jitter
        self.scale, self.offset, self.once, self.twice = 1.0, 0.0, (0.0, 0.0), (0.0, 0.0)
        drawn = RandomStream(seed, "encoder e disc")
        self.lines_off = [
            line_error * sorted((-4.0, drawn.normal(), 4.0))[1] if line_error else 0.0 for _ in range(lines)
        ]
        self.duty_error = duty_error
        self.stream = RandomStream(seed, "encoder e jitter")
        self.encoder = IncrementalEncoder("e", lines, gear, sign, line_error, duty_error, jitter, 0.0, seed)

    def describe(self, scale, offset, once, twice):
        self.scale, self.offset, self.once, self.twice = scale, offset, once, twice
        self.encoder.scale, self.encoder.offset_rad = scale, offset
        self.encoder.eccentricity_1, self.encoder.phase_1 = once
        self.encoder.eccentricity_2, self.encoder.phase_2 = twice
        return self

    def position(self, angle):
        shaft = self.sign * self.gear * (self.scale * complex(angle) + self.offset)
        shown = shaft + self.once[0] * cmath.sin(shaft + self.once[1])
        shown += self.twice[0] * cmath.sin(2.0 * shaft + self.twice[1])
        return 2.0 * self.lines * shown / (2.0 * math.pi)

    def slope(self, angle):
        """Edges per rad by a step along the imaginary axis: exact but for rounding."""
        return self.position(angle + 1e-200j).imag / 1e-200

    def edge(self, n):
        return n + self.lines_off[n // 2 % self.lines] + (self.duty_error if n % 2 else 0.0)

    def cell(self, u):
        n = math.floor(u) - 2
        while self.edge(n + 1) <= u:
            n += 1
        return n

    def edges(self, cell, u0, u1, m0, m1):
        """(fraction of the step, edge, forward) of each edge on the way; m0, m1: edges per step at its ends."""
        du = u1 - u0
        one_way = m0 * m1 > 0.0 and all(0.5 <= du / m <= 2.0 for m in (m0, m1))
        if one_way:
            sense = 1.0 if du > 0.0 else -1.0
            way = CubicHermiteSpline([0.0, abs(du)], [0.0, 1.0], [1.0 / abs(m0), 1.0 / abs(m1)])
            pieces = [(u0, u1, lambda level: float(way(sense * (level - u0))))]
        else:
            way = CubicHermiteSpline([0.0, 1.0], [u0, u1], [m0, m1])
            roots = way.derivative().roots(extrapolate=False) if m0 or m1 or du else []
            turns = [x.real for x in roots if 1e-9 < x < 1.0 - 1e-9]
            pieces = []
            for a, b in zip([0.0, *sorted(turns)], [*sorted(turns), 1.0], strict=True):
                at = (float(way(a)), float(way(b)) if b < 1.0 else u1)

                def when(level, a=a, b=b, at=at):
                    if not min(at) < level < max(at):
                        return a if abs(at[0] - level) < abs(at[1] - level) else b
                    return brentq(lambda x: float(way(x)) - level, a, b, xtol=1e-15)

                pieces.append((*at, when))
        found = []
        for begin, end, when in pieces:
            if end > begin:
                while self.edge(cell + 1) <= end:
                    cell += 1
                    found.append((when(self.edge(cell)), cell, True))
            else:
                while self.edge(cell) > end:
                    found.append((when(self.edge(cell)), cell, False))
                    cell -= 1
        return found, cell, one_way

    def levels(self, n, forward):
        """A and B after edge n: A is high from even to odd n, B half a line later."""
        place = n + (0.25 if forward else -0.25)
        return math.floor(place) % 2 == 0, math.floor(n - 0.5) % 2 == 0

    def moves(self, t0, t1, angle0, rate0, angle1, rate1):
        """One step of the encoder, whose edges, cell and total must be those of the definition; the number of them."""
        encoder, cell, total = self.encoder, self.encoder.cell, self.encoder.total
        seconds = (t1 - t0) * 1e-9
        u0, u1 = self.position(angle0).real, self.position(angle1).real
        m0, m1 = (self.slope(angle) * rate * seconds for angle, rate in ((angle0, rate0), (angle1, rate1)))
        expected, cell, one_way = self.edges(cell, u0, u1, m0, m1)
        assert encoder.update(t0, t1, angle0, rate0, angle1, rate1) == len(expected) == encoder.edges.count
        last = t0
        for number, (fraction, n, forward) in enumerate(expected):
            time, a, b = encoder.edges.edge(number)
            exact = t0 + fraction * (t1 - t0)
            if one_way and self.jitter > 0.0:
                exact += self.stream.normal() * self.jitter * (t1 - t0) / abs(u1 - u0)
            exact = min(max(exact, last), t1 - 1)
            # whole ns below; near a turning point 1e-12 of an edge is 1e-6 of a step, 0.1 ns
            assert -0.5 < exact - time < 1.5, (number, exact)
            assert last <= time < t1
            assert (a, b) == self.levels(n, forward)
            last = time
        assert encoder.cell == cell == self.cell(u1)
        assert encoder.total == total + len(expected)
        assert encoder.level_a() == (cell % 2 == 0)
        return len(expected), one_way


DISCS = {
    "even": lambda: Disc(512, 34.0),
    "mirrored": lambda: Disc(512, 34.0, -1),
    "lines and duty": lambda: Disc(512, 34.0, 1, 0.05, 0.2, seed=3),
    "early falls, mirrored": lambda: Disc(512, 34.0, -1, 0.02, -0.3, seed=4),
    "jitter": lambda: Disc(512, 34.0, 1, 0.0, 0.0, 0.3, seed=5),
    "scaled": lambda: Disc(512, 34.0, -1).describe(0.97, 0.013, (0.0, 0.0), (0.0, 0.0)),
    "eccentric": lambda: Disc(512, 34.0, 1).describe(1.03, -0.2, (0.02, 0.7), (0.013, -1.9)),
    "eccentric twice, uneven": lambda: Disc(300, 20.0, -1, 0.03, 0.1, seed=6).describe(1.0, 0.1, (0.0, 0.0), (0.03, 1)),
    "eccentric once": lambda: Disc(300, 20.0).describe(1.0, 0.0, (0.03, 2.0), (0.0, 0.0)),
    "few lines": lambda: Disc(3, 34.0, 1, 0.1, 0.3, seed=9),
}


@pytest.mark.parametrize("disc", DISCS)
def test_every_edge_comes_when_the_position_passes_it(disc):
    """Swings, stops and turns of 250 steps; each step's rates are near its way (one way) or any (turning)."""
    disc = DISCS[disc]()
    stream = RandomStream(11, "motions")
    angle, counts = -0.013, {True: 0, False: 0}
    disc.encoder.reset(angle)
    assert disc.encoder.cell == disc.cell(disc.position(angle).real)
    for k in range(250):
        kind = stream.integer(4)
        way = (2.0 * stream.uniform() - 1.0) * (2e-3 if kind else 2e-4) * 17408 / (disc.lines * disc.gear)
        mean = way / (STEP * 1e-9)
        if kind < 3:  # 0.5 ... 2 of speed over way and somewhat beyond
            rates = [mean * 2.0 ** (2.4 * stream.uniform() - 1.2) for _ in range(2)]
        else:
            rates = [abs(mean) * (6.0 * stream.uniform() - 3.0) for _ in range(2)]
        count, one_way = disc.moves(k * STEP, (k + 1) * STEP, angle, rates[0], angle + way, rates[1])
        counts[one_way] += count
        angle += way
    assert min(counts.values()) > 150


def whole(**errors):
    """An encoder whose position in edges is the angle itself, and a step is a second: everything is exact."""
    disc = Disc(1024, **errors)
    disc.encoder.edges_per_shaft_rad = 1.0
    disc.position = lambda angle: complex(angle)
    return disc


# without, and with the loop for jitter that moves no stamp
@pytest.mark.parametrize("jitter", [0.0, 1e-300])
@pytest.mark.parametrize(
    "u0, u1, m0, m1, passed",
    [
        (0.5, 3.0, 2.5, 2.5, [1, 2, 3]),  # up to an edge: it has come
        (3.5, 3.0, -0.5, -0.5, []),  # down to it: it has not
        (3.5, 2.75, -0.75, -0.75, [3]),
        (3.0, 2.5, -0.5, -0.5, [3]),  # from it
        (3.0, 3.5, 0.5, 0.5, []),
        (-2.5, -3.0, -0.5, -0.5, []),
        (-3.5, -3.0, 0.5, 0.5, [-3]),
        (-0.5, 0.5, 1.0, 1.0, [0]),
        (0.5, -1.5, -2.0, -2.0, [0, -1]),
        # the same with little or no speed at one end, and with turns
        (0.5, 3.0, 0.0, 2.5, [1, 2, 3]),
        (0.5, 3.0, 2.5, 0.1, [1, 2, 3]),
        (3.5, 3.0, 0.0, -0.5, []),
        (3.5, 2.75, -0.75, 0.0, [3]),
        (3.0, 2.5, -0.1, -0.5, [3]),
        (0.5, 0.5, 4.0, -4.0, [1, 1]),
        (0.5, 0.5, -4.0, 4.0, [0, 0]),
        (0.5, 0.5, 8.0, 8.0, [1, 1, 0, 0]),
        (0.5, 0.5, -8.0, -8.0, [0, 0, 1, 1]),
        (0.25, 0.25, 2.999, -2.999, []),  # a parabola of three quarters' height
        (0.25, 0.25, 3.001, -3.001, [1, 1]),
        (0.5, 0.5, 0.0, 0.0, []),
        (0.5, 1.5, 0.0, 0.0, [1]),
        (0.5, -0.5, 0.0, 0.0, [0]),
        (0.5, 1.5, -1.0, -1.0, [1]),
        (0.25, 1.25, 3.0, 3.0, [1]),  # it stands still half way
        (0.5, 1.5, -6.0, 1.0, [0, 0, 1]),
        (0.5, 1.5, 1.0, -6.0, [1, 2, 2]),
        # twice and half of the mean speed are one way still, more and less are not
        *[(0.5, 0.5 + sense * 2.0, sense * 2.0 * a, sense * 2.0 * b, [[0, -1], [], [1, 2]][int(sense) + 1])
          for sense in (1.0, -1.0)
          for a, b in ((0.5, 1.0), (1.0, 0.5), (2.0, 1.0), (1.0, 2.0), (0.5, 0.5), (2.0, 2.0), (0.5, 2.0), (2.0, 0.5),
                       (0.499, 1.0), (1.0, 0.499), (2.01, 1.0), (1.0, 2.01))],
    ],
)  # fmt: skip
def test_ends_on_an_edge_and_limits_of_the_speed_are_exact(u0, u1, m0, m1, passed, jitter):
    disc = whole(jitter=jitter)
    disc.encoder.reset(u0)
    disc.moves(0, SECOND, u0, m0, u1, m1)
    before = math.floor(u0)
    crossed = []
    for number in range(disc.encoder.edges.count):
        _, a, b = disc.encoder.edges.edge(number)
        forward = a != b
        crossed.append(before + 1 if forward else before)
        before += 1 if forward else -1
    assert crossed == passed


@pytest.mark.parametrize("errors", [{}, {"jitter": 1e-300}])
@pytest.mark.parametrize("u0, u1, m0, m1", [(0.5, 3.0, 2.5, 2.5), (0.5, 3.0, 2.5, 0.1), (0.5, 1.0, -1.0, 2.0)])
def test_an_edge_at_the_very_end_is_stamped_a_nanosecond_before_it(u0, u1, m0, m1, errors):
    disc = whole(**errors)
    disc.encoder.reset(u0)
    disc.encoder.edges.read = 3  # of the step before
    disc.encoder.update(5 * SECOND, 6 * SECOND, u0, m0, u1, m1)
    assert disc.encoder.edges.edge(disc.encoder.edges.count - 1)[0] == 6 * SECOND - 1
    assert disc.encoder.edges.read == 0


@pytest.mark.parametrize("errors", [{}, {"jitter": 1e-300}, {"duty_error": 0.4}])
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("count", [62, 63, 64, 65, 200])
def test_as_many_edges_as_there_are_on_the_way_are_kept(count, sense, errors):
    disc = whole(**errors)
    disc.encoder.reset(0.45)
    way = sense * count
    assert disc.moves(0, SECOND, 0.45, way * 1.01, 0.45 + way, way * 0.99) == (count, True)
    assert disc.moves(SECOND, 2 * SECOND, 0.45 + way, way * -6.0, 0.45, way * 0.99)[0] > count


def test_a_step_at_a_late_time_is_the_same_step():
    early, late = whole(), whole()
    for disc, begin in ((early, 0), (late, 7 * SECOND)):
        disc.encoder.reset(0.5)
        disc.moves(begin, begin + SECOND, 0.5, 5.0, 6.0, 6.0)
        disc.moves(begin + SECOND, begin + 2 * SECOND, 6.0, 6.0, 6.0, -6.0)
    for number in range(early.encoder.edges.count):
        time, a, b = early.encoder.edges.edge(number)
        assert late.encoder.edges.edge(number) == (time + 7 * SECOND, a, b)
    assert early.encoder.edges.count == 2


@pytest.mark.parametrize("sign", [1, -1])
def test_between_two_edges_a_step_is_calm_a_tenth_of_an_edge_inside(sign):
    """Angles between which a slow step cannot reach an edge, whatever its cubic does: half an edge's way of rates."""
    disc = Disc(200, 5.0, sign).describe(0.9, 0.3, (0.0, 0.0), (0.0, 0.0))
    encoder = disc.encoder
    per_rad = disc.slope(0.0)
    middle = (41.5 - disc.position(0.0).real) / per_rad
    encoder.reset(middle)
    assert encoder.calm_rad == 0.0
    encoder.update(0, STEP, middle, 1e-3, middle + 1e-3 * STEP * 1e-9, 1e-3)
    shown = sorted(disc.position(angle).real for angle in (encoder.calm_from, encoder.calm_to))
    assert shown == pytest.approx([41.1, 41.9], abs=1e-9)
    assert encoder.calm_from < encoder.calm_to
    assert encoder.calm_rad == pytest.approx(0.5 / abs(per_rad))
    # the fastest calm step bulges out by two times 4/27 of a quarter, and one that is faster is looked at in full
    for factor, calm in ((0.999, True), (1.001, False)):
        for senses in ((1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (-1.0, -1.0)):
            encoder.reset(middle)
            encoder.update(0, STEP, middle, 1e-3, middle + 1e-3 * STEP * 1e-9, 1e-3)
            rates = [0.25 * factor * sense / abs(per_rad) / (STEP * 1e-9) for sense in senses]
            assert disc.moves(STEP, 2 * STEP, middle, rates[0], middle, rates[1])[0] == 0
            assert (encoder.calm_rad > 0.0) == calm
    # from a tenth beside an edge out over it, at the highest speed
    for place, sense in ((41.101, -1.0), (41.899, 1.0)):
        encoder.reset(middle)
        encoder.update(0, STEP, middle, 1e-3, middle + 1e-3 * STEP * 1e-9, 1e-3)
        angle = (place - disc.position(0.0).real) / per_rad
        rates = [sense * turn * 0.249 / per_rad / (STEP * 1e-9) for turn in (1.0, -1.0)]
        assert disc.moves(STEP, 2 * STEP, angle, rates[0], angle, rates[1])[0] == 0
        assert encoder.calm_rad > 0.0
        assert disc.moves(2 * STEP, 3 * STEP, angle, 0.0, angle + sense * 0.2 / per_rad, 0.0)[0] == 1
        assert encoder.calm_rad == 0.0


def test_an_edge_bounces_where_more_than_three_times_3_us_are_left():
    encoder = IncrementalEncoder("e", 100, bounce=1.0)
    came = [(0, 1, 0), (9_000, 0, 1), (18_001, 1, 0), (27_001, 0, 1), (40_000, 1, 1)]
    for end, last_bounces in ((49_000, False), (49_001, True)):
        encoder.edges.clear()
        for edge in came:
            encoder.edges.push(*edge)
        before = encoder.bounces
        assert encoder.add_bounces(end) == 2 + last_bounces == encoder.bounces - before
        expected = [came[0], came[1], (12_000, 1, 1), (15_000, 0, 1), came[2], came[3], (30_001, 1, 1), (33_001, 0, 1)]
        expected += [came[4]] + [(43_000, 0, 1), (46_000, 1, 1)] * last_bounces
        assert [encoder.edges.edge(i) for i in range(encoder.edges.count)] == expected


def test_bounces_are_drawn_edge_by_edge_and_the_buffer_grows_with_them():
    encoder = IncrementalEncoder("e", 100, bounce=0.6, seed=8)
    stream = RandomStream(8, "encoder e jitter")
    came = [(20_000 * k, k % 2, 1 - k % 2) for k in range(63)]
    for edge in came:
        encoder.edges.push(*edge)
    expected = []
    for time, a, b in came:
        expected.append((time, a, b))
        if stream.uniform() < 0.6:
            expected += [(time + 3_000, 1 - a, b), (time + 6_000, a, b)]
    assert encoder.add_bounces(63 * 20_000) == (len(expected) - 63) // 2
    assert [encoder.edges.edge(i) for i in range(encoder.edges.count)] == expected


def test_a_new_disc_has_its_errors_and_the_encoder_starts_again_where_it_is():
    disc, fresh = Disc(64, 2.0, seed=5), Disc(64, 2.0, 1, 0.04, -0.2, seed=5)
    disc.encoder.update(0, STEP, 0.5, 0.0, 0.5, 0.0)
    disc.encoder.set_disc(0.04, -0.2)
    assert disc.encoder.has_errors and not disc.encoder.started
    for n in range(-300, 300):
        assert disc.encoder.threshold(n) == fresh.encoder.threshold(n) == pytest.approx(fresh.edge(n), abs=1e-12)
    disc.encoder.update(STEP, 2 * STEP, 1.5, 0.0, 1.5, 0.0)
    assert disc.encoder.edges.count == 0 and disc.encoder.cell == fresh.cell(fresh.position(1.5).real)
    disc.encoder.set_disc(0.0, 0.0)
    assert not disc.encoder.has_errors and disc.encoder.threshold(7) == 7.0
    disc.encoder.set_disc(0.0, 0.1)
    assert disc.encoder.has_errors and disc.encoder.threshold(-1) == -0.9 and disc.encoder.threshold(-2) == -2.0


def test_an_encoder_is_in_the_cell_of_its_position_and_shows_both_levels():
    stream = RandomStream(2, "stand")
    for disc in (Disc(32, 3.0, 1, 0.1, 0.4, seed=1), Disc(32, 3.0, -1, 0.1, -0.4, seed=2), Disc(32, 3.0)):
        for _ in range(300):
            angle = 6.0 * stream.uniform() - 3.0
            u = disc.position(angle).real
            disc.encoder.reset(angle)
            assert disc.encoder.cell == disc.cell(u)
            assert disc.encoder.level_a() == (disc.cell(u) % 2 == 0)
            assert disc.encoder.level_b(angle) == (math.floor(u - 0.5) % 2 == 0)
    exact = whole().encoder
    for u in (-3.0, -2.5, -1.0, 0.0, 0.5, 1.0, 2.0):
        exact.reset(u)
        assert exact.cell == math.floor(u)
        assert exact.level_b(u) == (math.floor(u - 0.5) % 2 == 0)


@pytest.mark.parametrize(
    "good, bad",
    [
        (dict(lines=1), dict(lines=0)),
        (dict(gear=1e-9), dict(gear=0.0)),
        (dict(sign=-1), dict(sign=0)),
        (dict(line_error=0.1), dict(line_error=0.1001)),
        (dict(line_error=0.0), dict(line_error=-1e-9)),
        (dict(duty_error=0.4), dict(duty_error=0.4001)),
        (dict(duty_error=-0.4), dict(duty_error=-0.4001)),
        (dict(jitter=0.0), dict(jitter=-1e-9)),
        (dict(bounce=1.0), dict(bounce=1.0001)),
        (dict(bounce=0.0), dict(bounce=-1e-9)),
    ],
)
def test_the_last_possible_encoder_is_made_and_the_first_impossible_one_refused(good, bad):
    IncrementalEncoder("e", **{"lines": 10, **good})
    with pytest.raises(UserError, match="encoder e"):
        IncrementalEncoder("e", **{"lines": 10, **bad})
