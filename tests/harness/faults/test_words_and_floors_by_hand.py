"""Faults of the absolute encoders' words and of the floor, step by step, on plants made by hand."""

import math
from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults import sensor, words
from ranger_sim.harness.faults.fault import Place
from ranger_sim.ranger.faults import world

MS = 1_000_000


def encoder(zero=100, sign=1, **more):
    usual = {"scale": 1.0, "offset_rad": 0.0, "lag_s": 0.0, "angle": 0.0, "noise_counts": 0.0}
    usual |= {"eccentricity_1": 0.0, "eccentricity_2": 0.0, "phase_1": 0.0, "phase_2": 0.0}
    return Made(zero=zero, sign=sign, counts_per_rad=sign * 8192 / (2 * math.pi), **{**usual, **more})


class Word:
    """A fault of the second of three words. `noted`: what it noted of it."""

    def __init__(self, kind, held, of=None, chance=(), number=1, **values):
        of = of if of is not None else encoder()
        self.plant = Made(words=[1, 2, 3], word_rad=lambda number: self.rad)
        self.plant.hip_word, self.plant.outer_word, self.plant.inner_word = (
            of if n == number else None for n in range(3)
        )
        self.rad, self.number = 0.0, number
        self.plant.words[number] = held
        self.fault = kind(Place("X", "word", "a word", {"word": number}), None, None, values)
        self.fault.robot = Made(plant=self.plant)
        chance = list(chance)
        self.fault.random = Made(uniform=lambda: chance.pop(0), integer=lambda most: most - 1)
        self.noted = []
        self.fault.note = lambda *what: self.noted.append(what)
        self.fault.connect()
        self.fault.begin(5)

    def step(self, word, end_ns):
        """What is held out in the place of a word."""
        self.plant.words[self.number] = word
        self.fault.after(end_ns - 1, end_ns)
        return self.plant.words[self.number]


OFFSET, STUCK = (
    next(each for each in sensor.mode_classes(words.SignalInWord, "word", words.COUNTS) if each.mode == mode)
    for mode in ("offset", "stuck")
)


def test_counts_of_a_turn_have_a_sign():
    expected = {0: 0, 1: 1, 4095: 4095, 4096: -4096, 8191: -1, 8192: 0, -1: -1, -4097: 4095}
    assert {counts: words.signed(counts) for counts in expected} == expected


@pytest.mark.parametrize(("sign", "shown"), [(1, [200, 4, 205]), (-1, [0, 7996, 5])])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_an_offset_is_in_the_joints_sense_and_held_out_from_its_begin_on(number, sign, shown):
    made = Word(OFFSET, 100, encoder(sign=sign), number=number, offset=100.0)
    assert made.plant.words[number] == shown[0] and made.noted == [(5, 100)]
    assert [made.step(8096, 7), made.step(105, 8)] == [shown[1], shown[2]]
    assert made.noted[1:] == [(7, 100), (8, 100)]
    made.fault.finish(9)
    assert made.plant.words[number] == 105
    assert [each for place, each in enumerate(made.plant.words) if place != number] == [
        each for place, each in enumerate([1, 2, 3]) if place != number
    ]


def test_an_unchanged_word_is_not_noted():
    made = Word(STUCK, 500, level=math.nan)
    assert made.noted == []
    assert made.step(500, 7) == 500 and made.noted == []
    assert made.step(510, 8) == 500 and made.noted == [(8, -10)]
    level = Word(STUCK, 500, level=-50.0)
    assert level.plant.words[1] == 50 and level.noted == [(5, -450)]


def test_halves_of_a_count_go_up():
    assert [Word(OFFSET, 100, offset=each).plant.words[1] for each in (0.49, 0.5, -0.5, -0.51)] == [100, 101, 100, 99]


def test_an_open_line_reads_its_word_while_the_gap_lasts():
    made = Word(words.WordDropOut, 300, chance=[0.5], word=8191.0, length_ms=1.0, pause_ms=1000.0)
    assert made.plant.words[1] == 8191 and made.noted == [(5, words.signed(8191 - 300))]
    assert made.step(310, 5 + MS - 1) == 8191 and made.step(320, 5 + MS) == 320 and len(made.noted) == 2


def test_a_bit_is_read_wrong_in_a_share_of_the_words():
    made = Word(words.BitFlips, 300, chance=[0.05, 0.049, 0.9], share=0.05, bit=3.0)
    assert made.plant.words[1] == 300
    assert [made.step(300, 7), made.step(301, 8)] == [300 ^ 8, 301] and made.noted == [
        (7, words.signed((300 ^ 8) - 300))
    ]
    zero = Word(words.BitFlips, 300, chance=[0.0], share=0.05, bit=0.0)
    assert zero.plant.words[1] == 301
    any_bit = Word(words.BitFlips, 300, chance=[0.0], share=0.05, bit=-1.0)
    assert any_bit.plant.words[1] == 300 ^ 1 << 12  # 13 bits, of which the last is drawn here


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ({}, 100.0 + 0.5 * 8192 / (2 * math.pi)),
        ({"sign": -1}, 100.0 - 0.5 * 8192 / (2 * math.pi)),
        ({"scale": 1.1, "offset_rad": 0.2}, 100.0 + 0.75 * 8192 / (2 * math.pi)),
        ({"lag_s": 0.1, "angle": 0.3}, 100.0 + 0.3 * 8192 / (2 * math.pi)),
        ({"eccentricity_1": 0.1, "phase_1": 0.2}, 100.0 + (0.5 + 0.1 * math.sin(0.7)) * 8192 / (2 * math.pi)),
        ({"eccentricity_2": 0.1, "phase_2": 0.2}, 100.0 + (0.5 + 0.1 * math.sin(1.2)) * 8192 / (2 * math.pi)),
        ({"zero": 8190}, 8190.0 + 0.5 * 8192 / (2 * math.pi) - 8192),
    ],
)
def test_a_word_is_clear_when_it_is_that_of_the_joints_angle(more, expected):
    made = Word(OFFSET, 100, encoder(**more), offset=0.0)
    made.rad = 0.5
    nearest = round(expected)
    for word, clear in ((nearest, True), (nearest + 1, False), (nearest - 1, False)):
        made.plant.words[1] = word % 8192
        assert made.fault.is_clear(0, 1) is clear
    made.fault.encoder.noise_counts = 1.0  # 3.7 deviations more
    for off in (-4, 4):
        made.plant.words[1] = (nearest + off) % 8192
        assert made.fault.is_clear(0, 1) is (abs(nearest + off - expected) <= 4.2 + 1e-6)


# ---- the floor


class Ground:
    """A floor and a body on it; `slopes`: those set on the body."""

    def __init__(self, kind, contact="coulomb", **values):
        self.slopes = []
        self.floor = Made(slope_rad=0.1, step_at=None, step_m=0.0, foothold=7)
        parameters = Made(gravity_m_per_s2=9.8, contact=contact, floor_friction=0.9)
        self.body = Made(
            set_slope=self.slopes.append,
            gx=0.0,
            parameters=parameters,
            sole=Made(mu=0.9),
            outer=Made(Fy=30.0),
            inner=Made(Fy=10.0),
        )
        plant = Made(floor=self.floor, body=self.body, parameters=parameters)
        self.fault = kind(Place("world.floor", "floor", "the floor"), None, None, values)
        self.fault.robot = Made(plant=plant)
        self.noted = []
        self.fault.note = lambda time_ns, value: self.noted.append((time_ns, pytest.approx(value)))
        self.fault.connect()

    def begun(self):
        self.fault.begin(5)
        return self


def test_a_slope_is_added_and_taken_away_again():
    made = Ground(world.Slope, angle=0.05).begun()
    assert made.slopes == [pytest.approx(0.15)] and made.floor.slope_rad == pytest.approx(0.15)
    made.fault.before(6)
    assert made.noted == [(6, 0.05)]
    made.fault.finish(7)
    assert made.slopes[1:] == [0.1] and made.floor.slope_rad == 0.1
    assert not made.fault.is_clear(7, 8)
    made.body.gx = 9.8 * math.sin(0.1)
    assert made.fault.is_clear(7, 8)
    none = Ground(world.Slope, angle=0.0).begun()
    none.fault.before(6)
    assert none.noted == []


def test_a_step_begins_with_the_next_foothold_and_acts_with_each_that_is_taken_on_it():
    made = Ground(world.StepInFloor, height=-0.01).begun()
    assert (made.floor.step_at, made.floor.step_m) == (8, -0.01)
    made.fault.before(6)
    assert made.noted == []
    made.floor.foothold = 8
    made.fault.before(7)
    made.fault.before(8)
    made.floor.foothold = 9
    made.fault.finish(9)
    assert made.noted == [(7, -0.01), (9, -0.01)] and (made.floor.step_at, made.floor.step_m) == (None, 0.0)
    made.fault.acted_count = 2
    assert not made.fault.is_clear(9, 10)
    made.floor.foothold = 10
    assert made.fault.is_clear(9, 10)
    idle = Ground(world.StepInFloor, height=0.0).begun()
    idle.floor.foothold = 8
    idle.fault.before(6)
    idle.fault.finish(7)
    assert idle.noted == [] and idle.fault.is_clear(7, 8)
    taken = Ground(world.StepInFloor, height=0.01)
    taken.floor.step_at = 3
    with pytest.raises(UserError, match="the floor has a step already, from foothold 3 on"):
        taken.begun()


def test_a_slippery_floor_acts_under_load_by_what_it_holds_less():
    made = Ground(world.SlipperyFloor, friction=0.2).begun()
    assert made.body.sole.mu == 0.2
    made.fault.before(6)
    made.body.outer.Fy, made.body.inner.Fy = 5.0, -5.0
    made.fault.before(7)
    assert made.noted == [(6, -0.7 * 40.0)]
    assert not made.fault.is_clear(7, 8)
    made.fault.finish(8)
    assert made.body.sole.mu == 0.9 and made.fault.is_clear(8, 9)
    same = Ground(world.SlipperyFloor, friction=0.9).begun()
    same.fault.before(6)
    assert same.noted == []
    for contact in world.RIGID:
        with pytest.raises(UserError, match="feet never slide"):
            Ground(world.SlipperyFloor, contact=contact, friction=0.2)
