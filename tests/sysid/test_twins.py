"""The comparison of a walk with its twins: steps, features, maps, the file, and known answers of the judgement."""

import dataclasses
import pathlib

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.results import TwinCause, TwinsEvidence, Value
from ranger_sim.sysid.twins import evidence, features, judgement, learning, step_map, steps, twin_file
from ranger_sim.sysid.twins.model import mean_of
from ranger_sim.sysid.twins.step_map import FEW, FEW_START, Rest
from ranger_sim.tools.twins import making, walking
from ranger_sim.tools.twins.causes import TWINS
from ranger_sim.tools.twins.emulation import REPEATS, WALKS, emulate

STEP_ROWS = 300


def leg_machine(count):
    """The state of the leg machine over `count` steps: 0, 1, 2, then 3, 4, 5."""
    return np.concatenate([np.repeat(np.arange(3) + 3 * (number % 2), STEP_ROWS // 3) for number in range(count)])


def swinging(count):
    """Columns of a walk whose hip angle is positive at the end of every other step."""
    state = leg_machine(count).astype(float)
    hip = np.concatenate(
        [np.linspace(-0.3, 0.3, STEP_ROWS) * (1 if number % 2 == 0 else -1) for number in range(count)]
    )
    return {"FSM_LEG": state, "MCH_ANGLE": hip, "MCH_MOTOR_CURRENT": np.full(len(hip), 2.0)}


def test_steps_end_where_the_leg_machine_changes_its_leg():
    cut = steps.of_columns(swinging(6))
    assert cut.ends.tolist() == [300, 600, 900, 1200, 1500]
    assert cut.leg.tolist() == [steps.OUTER, steps.INNER, steps.OUTER, steps.INNER]
    assert steps.usual(cut).all()


def test_columns_without_a_state_or_a_step_number_have_no_steps():
    assert steps.of_columns({"MCH_ANGLE": np.zeros(100)}) is None


def test_features_of_a_step_are_what_a_person_reads_off_its_curves():
    found = features.of(steps.of_columns(swinging(4)))
    column = {name: found[:, place] for place, name in enumerate(features.NAMES)}
    assert column["step time"] == pytest.approx(0.6)
    assert column["hip angle top"] == pytest.approx(0.3)
    assert column["hip current mean"] == pytest.approx(2.0) and column["hip current square"] == pytest.approx(4.0)
    assert column["leg state 1"].tolist() == pytest.approx([0.0, 0.2]) or column["leg state 1"][1] == pytest.approx(0.2)
    assert np.isnan(column["gyro mean"]).all()  # a signal that the recording does not have


def test_a_recording_with_other_stamps_per_channel_gives_the_same_steps():
    columns = swinging(6)
    channels = {}
    for name, value in columns.items():
        changed = np.flatnonzero(np.diff(value, prepend=np.nan) != 0.0)
        kept = np.unique(np.append(changed, [0, 1, len(value) - 1]))
        channels[name] = Channel(name, "", steps.CLOCK_S * kept, value[kept])
    cut = steps.of_dataset(Dataset("walk", channels))
    assert cut.ends.tolist() == steps.of_columns(columns).ends.tolist()


def test_names_of_the_experiment_are_variables_of_the_table():
    columns = swinging(6)
    stamps = steps.CLOCK_S * np.arange(len(columns["MCH_ANGLE"]))
    channels = {
        new: Channel(new, "", stamps, columns[old])
        for new, old in (("hip_angle_rad", "MCH_ANGLE"), ("walk_state", "FSM_LEG"))
    }
    assert steps.of_dataset(Dataset("walk", channels)).count == 4


@pytest.mark.parametrize(("name", "sign"), [("outer_leg_abs_angle_gyro_rad", 1.0), ("UI_ROLL", -1.0)])
def test_the_leg_angle_of_a_log_of_2015_has_the_sign_of_the_tables(name, sign):
    columns = swinging(6)
    stamps = steps.CLOCK_S * np.arange(len(columns["MCH_ANGLE"]))
    angle = np.linspace(-0.2, 0.3, len(stamps))
    made = {"hip_angle_rad": columns["MCH_ANGLE"], "walk_fsm_state": columns["FSM_LEG"], name: sign * angle}
    cut = steps.of_dataset(Dataset("walk", {each: Channel(each, "", stamps, value) for each, value in made.items()}))
    assert cut.signals["outer leg angle"].tolist() == pytest.approx(angle.tolist())


def test_a_link_of_50_hz_is_recognised_and_strikes_come_at_most_one_sample_late():
    columns = swinging(8)
    late = steps.by_link(columns, 10, [3, 0, 7])
    cut = steps.of_columns(late, 0.02)
    exact = steps.of_columns(columns)
    assert cut.late_rows > exact.late_rows
    assert np.all((cut.ends - exact.ends >= 0) & (cut.ends - exact.ends <= 10))


# --- made-up walks of the few channels, whose map and directions are known ---------------------------------------

SLOPES = generator(1, "slopes of made-up twins").normal(size=(len(FEW_START), len(FEW)))
EFFECT = generator(2, "effect of a made-up cause").normal(size=(2, len(FEW)))
OTHER = generator(3, "effect of another cause").normal(size=(2, len(FEW)))
UNKNOWN = generator(4, "effect that no cause has").normal(size=(2, len(FEW)))
NOISE = 0.3


def made_up(seed, moved=0.0, other=0.0, count=40, since=0, noise=NOISE, unknown=0.0):
    """Steps whose outcomes are linear in the step before, plus noise and effects of this size from a step on."""
    draw = generator(seed, "made-up walk")
    found = np.full((count, len(features.NAMES)), np.nan)
    leg = np.arange(count) % 2
    starts, outcomes = step_map.columns(FEW_START), step_map.columns(FEW)
    found[0] = draw.normal(size=found.shape[1])
    for row in range(1, count):
        made = 0.15 * found[row - 1, starts] @ SLOPES + noise * draw.normal(size=len(FEW))
        if row >= since:
            made += moved * EFFECT[leg[row]] + other * OTHER[leg[row]] + unknown * UNKNOWN[leg[row]]
        found[row] = draw.normal(size=found.shape[1])
        found[row, outcomes] = made
    return leg, found


def made_up_view(far=()):
    """far: twins beyond the others' sizes."""
    twins = [learning.Twinned(0, *made_up(100 + seed)) for seed in range(40)]
    twins += [learning.Twinned(0, *made_up(200 + seed), loose=True) for seed in range(10)]
    for place, size in enumerate((-0.4, -0.2, 0.2, 0.4) * 3):
        twins.append(learning.Twinned(0, *made_up(300 + place, moved=size), key="one", size=size))
        twins.append(learning.Twinned(0, *made_up(400 + place, other=size), key="two", size=size))
    causes = [
        learning.Cause("one", "geometry", "feet", "foot_height_m", "", 0.0),
        learning.Cause("two", "inertia", "body", "mass_kg", "", 0.0),
    ]
    return learning.learned([*twins, *far], causes, [0.0], few=True)


@pytest.fixture(scope="module")
def view():
    return made_up_view()


@pytest.fixture(scope="module")
def far_view():
    """With walks of the first cause at four times the largest size, and with one of the other that falls there."""
    far = [
        learning.Twinned(0, *made_up(600 + place, moved=bent(size)), key="one", size=size, far=True)
        for place, size in enumerate((-1.6, 1.6, -1.6, 1.6))
    ]
    leg, found = made_up(610, other=1.6)
    return made_up_view([*far, learning.Twinned(0, leg[:3], found[:3], key="two", size=1.6, far=True)])


def judged(view, leg, found):
    rest = step_map.rest(view.legs, leg, found, few=True)
    return judgement.judge(view, rest, FEW, 0.0)


@pytest.fixture(scope="module")
def on_two_floors():
    """The view of a level floor and one of 1 mm, on which steps scatter twice as much."""
    twins = [
        learning.Twinned(floor, *made_up(500 + 100 * floor + seed, noise=noise))
        for floor, noise in enumerate((NOISE, 2.0 * NOISE))
        for seed in range(40)
    ]
    return learning.learned(twins, [], [0.0, 0.001], few=True)


@pytest.mark.parametrize(
    ("noise", "floor_m"), [(0.5, 0.0), (1.0, 0.0), (1.5, 0.001 * (1.25 / 3.0) ** 0.5), (2.0, 0.001), (4.0, 0.001)]
)
def test_a_floor_is_as_rough_as_the_scatter_of_all_features_says(on_two_floors, noise, floor_m):
    view = on_two_floors
    rest = step_map.rest(view.legs, *made_up(9100, count=400, noise=noise * NOISE), few=True)
    # the variance of 200 steps of either leg is known to a tenth, which is 0.13 mm on a level floor
    assert view.roughness(rest) == pytest.approx(floor_m, abs=0.13e-3)


@pytest.mark.parametrize(("noise", "looks_m"), [(2.0, 0.001), (3.0, 0.001 * (8.0 / 3.0) ** 0.5)])
def test_steps_may_look_as_if_on_a_rougher_floor_than_was_made(on_two_floors, noise, looks_m):
    view = on_two_floors
    rest = step_map.rest(view.legs, *made_up(9100, count=400, noise=noise * NOISE), few=True)
    assert view.looks(rest) == pytest.approx(looks_m, rel=0.1)  # variances go with its square


def test_a_cause_that_moves_each_leg_another_way_is_not_a_rougher_floor(on_two_floors):
    view = on_two_floors
    sound, moved = (
        view.roughness(step_map.rest(view.legs, *made_up(9200, moved=size, noise=1.5 * NOISE), few=True))
        for size in (0.0, 0.8)
    )
    assert 0.3e-3 < sound < 1e-3 and moved == pytest.approx(sound, abs=0.1e-3)


def test_a_feature_that_wildly_scatters_alone_is_not_a_rougher_floor(on_two_floors):
    view = on_two_floors
    leg, found = made_up(9300)
    before = view.roughness(step_map.rest(view.legs, leg, found, few=True))
    found[:, features.NAMES.index("leg state 3")] *= 20.0
    found[:, features.NAMES.index("hip angle early")] = np.nan  # nor one that is missing
    assert view.roughness(step_map.rest(view.legs, leg, found, few=True)) == pytest.approx(before, abs=0.1e-3)


def test_shares_of_floors_go_with_the_square_of_the_roughness(on_two_floors):
    assert on_two_floors.weights(0.0005).tolist() == pytest.approx([0.75, 0.25])
    assert on_two_floors.weights(0.0).tolist() == [1.0, 0.0] and on_two_floors.weights(0.003).tolist() == [0.0, 1.0]


def test_a_sound_walk_is_silent_and_lists_what_it_would_have_shown(view):
    verdict = judged(view, *made_up(9001))
    assert not verdict.detected and verdict.named is None
    assert {each.cause for each, _ in verdict.visible} == {"geometry", "inertia"}
    assert all(0.0 < size < 0.4 for _, size in verdict.visible)


@pytest.mark.parametrize("size", [0.3, -0.3, 0.15])
def test_a_cause_is_named_with_an_interval_that_holds(view, size):
    verdict = judged(view, *made_up(9100, moved=size))
    assert verdict.detected and verdict.named.direction.cause == "geometry" and verdict.ties == ()
    assert verdict.named.low <= size <= verdict.named.high
    assert verdict.named.high - verdict.named.low < 0.15


def test_a_larger_effect_never_gains_less(view):
    gains = [judged(view, *made_up(9200, moved=size)).fits[0].gain for size in (0.1, 0.2, 0.4, 0.6)]
    assert gains == sorted(gains)


@pytest.mark.parametrize(("size", "seed"), [(0.0, 9001), (0.3, 9100), (-0.8, 9200)])
def test_no_cause_gains_more_than_its_bound(view, size, seed):
    mean = mean_of(step_map.rest(view.legs, *made_up(seed, moved=size), few=True))
    space = judgement.Space(view, mean, view.weights(0.0))
    assert 0.0 < max(fit.gain for fit in space.fits()) <= space.most()


def test_the_interval_of_a_size_counts_the_noise_of_its_direction(view):
    """With the error of one walk of as many steps the variance of a size doubles."""
    mean = mean_of(step_map.rest(view.legs, *made_up(9100, moved=0.3), few=True))
    widths = []
    for error in (0.0, 1.0 / 39.0 / 0.3**2):
        unsure = np.zeros((3, 3))
        unsure[0, 0] = error
        made = [dataclasses.replace(each, unsure=unsure) for each in view.directions]
        fit = judgement.Space(dataclasses.replace(view, directions=tuple(made)), mean, view.weights(0.0)).fit(0)
        half = 0.5 * (fit.high - fit.low)
        widths.append(np.sqrt(half**2 - (judgement.SIZE_ERROR * fit.size) ** 2))
    assert 1.2 < widths[1] / widths[0] < 1.8  # sqrt(2), but for what the direction's noise takes off its length


def test_a_cause_that_begins_on_the_way_has_its_first_step(view):
    verdict = judged(view, *made_up(9300, moved=0.5, since=22))
    assert verdict.named.direction.cause == "geometry" and abs(verdict.since - 22) <= 2
    assert verdict.named.low <= 0.5 <= verdict.named.high


def test_an_effect_in_another_direction_is_detected_without_a_name(view):
    leg, found = made_up(9400)
    found[1:, step_map.columns(FEW)] += np.where(np.arange(len(FEW)) % 2, 2.0, -2.0)
    verdict = judged(view, leg, found)
    assert verdict.detected and verdict.named is None


def test_a_cause_that_acts_alike_in_either_sign_is_detected_without_a_name(view):
    """Only the square of its size counts, so that what is found has an interval from one sign to the other."""
    line = view.directions[0].terms[0]
    even = changed(view, terms=np.stack((np.zeros_like(line), line / 0.4, np.zeros_like(line))))
    walk = made_up(9420, moved=0.4)
    best = judged(even, *walk).fits[0]
    assert best.direction.cause == "geometry" and best.low < 0.0 < best.high
    assert judged(even, *walk).detected and judged(even, *walk).named is None
    assert judged(view, *walk).named.direction.cause == "geometry"


def test_a_missing_feature_leaves_the_others(view):
    leg, found = made_up(9500, moved=0.4)
    found[:, features.NAMES.index("leg state 5")] = np.nan
    verdict = judged(view, leg, found)
    assert verdict.named.direction.cause == "geometry"


def test_a_walk_of_four_steps_has_no_verdict(view):
    leg, found = made_up(9600, count=5)
    assert judged(view, leg, found) is None


def test_a_tolerance_of_sound_robots_hides_what_is_within_it(view):
    loose = dataclasses.replace(
        view, directions=tuple(dataclasses.replace(each, tolerance=0.3) for each in view.directions)
    )
    leg, found = made_up(9700, moved=0.3)
    assert judged(loose, leg, found).fits[0].gain < 0.2 * judged(view, leg, found).fits[0].gain


def changed(view, **values):
    """The view whose first cause has other values."""
    first, *others = view.directions
    return dataclasses.replace(view, directions=(dataclasses.replace(first, **values), *others))


def test_a_size_that_sound_robots_reach_by_themselves_is_not_a_fault(view):
    walk = made_up(9710, moved=-0.3)
    verdict = judged(changed(view, sound=-0.4), *walk)
    assert judged(view, *walk).detected and not verdict.detected and verdict.named is None
    assert [each.direction.cause for each in verdict.habits] == ["geometry"]
    assert verdict.habits[0].size == pytest.approx(-0.3, abs=0.05)
    assert next(size for each, size in verdict.visible if each.cause == "geometry") > 0.4


@pytest.mark.parametrize(("moved", "other"), [(0.3, 0.0), (-0.6, 0.0), (-0.3, 0.4)])
def test_what_no_sound_robot_reaches_is_a_fault(view, moved, other):
    """The other sign, a larger size, and another cause next to such a size."""
    verdict = judged(changed(view, sound=-0.4), *made_up(9710, moved=moved, other=other))
    assert verdict.detected and verdict.habits == ()


def test_a_size_within_three_deviations_of_sound_robots_is_not_a_fault(view):
    """The tolerance counts as a line in the scatter; where an effect is steeper than its line, its size decides."""
    steep = view.directions[0]
    terms = steep.terms.copy()
    terms[0], terms[2] = 0.02 * terms[0], terms[0] / 0.3**2
    one = changed(view, terms=terms, tolerance=0.15)
    size = 0.3
    leg, found = made_up(9100, moved=size)
    assert judged(changed(view, terms=terms, tolerance=0.05), leg, found).detected
    assert not judged(one, leg, found).detected


def bent(size):
    """An effect that grows half as fast beyond the sizes of which twins were made."""
    return size if abs(size) < 0.4 else np.sign(size) * (0.4 + 0.5 * (abs(size) - 0.4))


def emulating(view, asked, falls_from=np.inf):
    """Walks of the first cause, whose effect is bent, and of the other, whose effect is a line."""

    def emulate(direction, size, floor_m):
        asked.append((direction.cause, size))
        if abs(size) >= falls_from:
            return None
        effect = {"moved": bent(size)} if direction.cause == "geometry" else {"other": size}
        walked = [step_map.rest(view.legs, *made_up(9800 + seed, **effect), few=True) for seed in range(2)]
        return judgement.Walks(mean_of(evidence.joined(walked)), 0.0)

    return emulate


def confirmed(view, size, seed=9750, **more):
    asked = []
    rest = step_map.rest(view.legs, *made_up(seed, moved=bent(size)), few=True)
    return judgement.judge(view, rest, FEW, 0.0, emulating(view, asked, **more)), asked


@pytest.mark.parametrize("size", [1.2, -1.8])
def test_a_size_far_beyond_those_of_twins_is_found_by_emulating_it(view, size):
    blind = judged(view, *made_up(9750, moved=bent(size))).fits[0]
    assert not blind.low <= size <= blind.high
    verdict, asked = confirmed(view, size)
    assert verdict.named.direction.cause == "geometry"
    assert verdict.named.low <= size <= verdict.named.high
    assert len(asked) <= judgement.EMULATIONS


@pytest.mark.parametrize("size", [-1.9, -1.0, 1.2, 1.6])
def test_far_twins_show_a_size_beyond_the_others_without_an_emulation(view, far_view, size):
    leg, found = made_up(9750, moved=bent(size))
    named = judged(far_view, leg, found).named
    assert named.direction.cause == "geometry" and named.low <= size <= named.high
    fit = judged(view, leg, found).fits[0]
    assert not fit.low <= size <= fit.high


def test_far_twins_leave_sizes_of_the_others_as_they_were(view, far_view):
    sizes = np.array([-0.4, -0.1, 0.2, 0.4])
    mean = mean_of(step_map.rest(view.legs, *made_up(9100, moved=0.3), few=True))
    near, far = (judgement.Space(each, mean, np.ones(1)) for each in (view, far_view))
    assert far.profile(0, sizes) == pytest.approx(near.profile(0, sizes), rel=1e-9)


@pytest.mark.parametrize("moved", [0.0, 0.05, 0.3])
def test_far_twins_change_no_limit_and_detect_nothing_more(view, far_view, moved):
    walk = made_up(9001, moved=moved)
    near, far = judged(view, *walk), judged(far_view, *walk)
    assert (far.detected, far.distance, far.limits) == (near.detected, near.distance, near.limits)
    assert [size for _, size in far.visible] == [size for _, size in near.visible]


def test_of_causes_that_leave_a_sound_walk_the_best_known_is_named_and_the_others_tie(view):
    """A direction of few walks gains more, since its noise is taken off its length; what it gains beyond the noise of
    a sound walk is chance."""
    first = view.directions[0]
    vague = dataclasses.replace(first, at="soles", unsure=10.0 * first.unsure)
    verdict = judged(dataclasses.replace(view, directions=(vague, *view.directions)), *made_up(9100, moved=0.3))
    assert verdict.named.direction.at == "feet"
    assert [each.at for each in verdict.ties] == ["soles"]
    gains = {fit.direction.at: fit.gain for fit in verdict.fits}
    assert gains["soles"] > gains["feet"]


def test_a_cause_that_leaves_more_than_a_sound_walk_has_no_tie_by_that_rule(view):
    leg, found = made_up(9100, moved=0.3)
    verdict = judged(view, leg, found)
    assert verdict.named.direction.cause == "geometry" and verdict.ties == ()


def test_a_size_with_which_a_far_twin_falls_is_not_an_answer(far_view):
    least, most = judgement.reach_of(far_view.directions[1])
    assert least == judgement.FARTHEST * -0.4
    assert most == min(judgement.FARTHEST * 0.4, judgement.BELOW_FALL * 1.6)
    fell = changed(far_view, far=(judgement.Knot(0.5, np.zeros(2 * len(FEW)), 0),)).directions[0]
    assert judgement.reach_of(fell)[1] == judgement.BELOW_FALL * 0.5


def test_a_cause_that_only_a_far_twin_shows_is_a_candidate(far_view):
    """Near 0 it moves a walk less than its error; four times further it does not."""
    weak = changed(far_view, terms=0.01 * far_view.directions[0].terms)
    mean = mean_of(step_map.rest(far_view.legs, *made_up(9100, moved=bent(1.6)), few=True))
    assert judgement.Space(weak, mean, np.ones(1)).is_known(0)
    assert not judgement.Space(changed(weak, far=()), mean, np.ones(1)).is_known(0)


def test_a_size_with_which_the_emulated_robot_falls_is_not_an_answer(view):
    verdict, asked = confirmed(view, 1.8, falls_from=1.1)
    assert max(abs(size) for _, size in asked) >= 1.1
    assert all(abs(fit.size) < 1.1 for fit in verdict.fits if fit.direction.cause == "geometry")


def turning(size):
    """An effect that goes on in another direction from a size of 0.8 on: the best size of a line is 0.8 from there."""
    return {"moved": min(size, 0.8), "unknown": 1.2 * max(size - 0.8, 0.0)}


def test_a_cause_that_scatters_the_steps_walks_on_the_floor_that_is_left(on_two_floors):
    """The log looks rougher than any floor that was made, and so do the first walks: the floor may be level."""
    view, walked = on_two_floors, made_up_view()
    view = dataclasses.replace(view, directions=walked.directions, alarms=walked.alarms)
    rest = step_map.rest(view.legs, *made_up(9750, moved=0.9, noise=3.0 * NOISE), few=True)
    floors_m = []

    def emulate(direction, size, floor_m):
        floors_m.append(floor_m)
        return judgement.Walks(mean_of(rest), float(np.hypot(1.6e-3, floor_m)))

    confirmed, own = judgement.confirmed(view, mean_of(rest), view.weights(0.001), 1.7e-3, emulate)
    assert floors_m[:2] == pytest.approx([0.001, (1.7**2 - 1.6**2) ** 0.5 * 1e-3])
    assert own["geometry at feet", "foot_height_m"] == pytest.approx(1.6e-3**2)
    assert all(knot.steps for each in confirmed.directions for knot in each.knots)
    assert sum(len(each.knots) for each in confirmed.directions) == len(floors_m) - len(own)  # first ones do not count


@pytest.mark.parametrize("falls_from", [np.inf, 1.45])
def test_a_size_that_leaves_more_than_a_sound_walk_is_sought_by_walks_next_to_it(view, falls_from):
    asked = []

    def emulate(direction, size, floor_m):
        asked.append((direction.cause, size))
        if direction.cause != "geometry" or size >= falls_from:
            return None
        walked = [step_map.rest(view.legs, *made_up(9800 + seed, **turning(size)), few=True) for seed in range(2)]
        return judgement.Walks(mean_of(evidence.joined(walked)), 0.0)

    rest = step_map.rest(view.legs, *made_up(9750, **turning(1.4)), few=True)
    named = judgement.judge(view, rest, FEW, 0.0, emulate).named
    assert named.direction.cause == "geometry"
    assert named.size == pytest.approx(1.4, abs=0.1)
    assert named.low <= 1.4 <= named.high
    assert len(asked) <= judgement.EMULATIONS


def of_two_forms(seed, size, form):
    """A walk with the first cause near a fall: its gait has one of two forms, at random."""
    return made_up(seed, moved=size, unknown=0.5 * form)


@pytest.mark.parametrize(("forms", "named"), [((1, -1, -1, 1, 1, -1), True), ((0, 0, 0, 0, 0, 0), False)])
def test_a_walk_that_differs_from_the_mean_as_walks_with_its_cause_do_has_a_name(view, forms, named):
    """Two walks of either form have a mean that no walk is like."""

    def rests(first, size, forms):
        walks = [of_two_forms(first + number, size, form) for number, form in enumerate(forms)]
        return [step_map.rest(view.legs, *each, few=True) for each in walks]

    def emulate(direction, size, floor_m):
        if direction.cause != "geometry":
            return None
        return judgement.Walks(mean_of(evidence.joined(rests(9800, size, (1, -1)))), 0.0)

    rest = step_map.rest(view.legs, *of_two_forms(9750, 1.0, 1), few=True)
    verdict = judgement.judge(view, rest, FEW, 0.0, emulate, lambda direction, size, floor_m: rests(9900, size, forms))
    assert verdict.detected and verdict.fits[0].direction.cause == "geometry"
    assert verdict.fits[0].left > judgement.sound_distance(verdict.view)
    assert (verdict.named is not None) == named


def test_a_size_at_which_the_robot_walked_may_be_nearer_to_a_fall(view):
    zero = np.zeros(2 * len(FEW))
    knots = judgement.Knot(1.0, zero, 0), judgement.Knot(0.9, zero, 40)
    assert judgement.reach_of(changed(view, knots=knots).directions[0])[1] == 0.9
    assert judgement.reach_of(changed(view, knots=knots[:1]).directions[0])[1] == judgement.BELOW_FALL


def test_a_sound_walk_asks_for_no_emulation(view):
    verdict, asked = confirmed(view, 0.0, seed=9001)
    assert not verdict.detected and asked == []


def test_an_interval_reaches_as_far_as_walks_with_the_cause_scatter(view):
    named = judged(view, *made_up(9100, moved=0.3)).named
    true = (0.1, 0.5, 0.15, 0.45, 0.1, 0.5)  # of walks for which the size found was asked

    def walks(sizes):
        return [step_map.rest(view.legs, *made_up(9900 + n, moved=each), few=True) for n, each in enumerate(sizes)]

    wide = judgement.as_repeated(view, named, 39, walks(true))
    rms = np.sqrt(np.mean(np.square(np.array(true) - named.size)))
    # Student's 97.5 % of six; the sizes are found to 0.02
    assert wide.high - named.size == pytest.approx(2.447 * rms, abs=2.447 * 0.02)
    assert wide.size == named.size and wide.low == 0.0  # the other sign was not found
    same = judgement.as_repeated(view, named, 39, walks([named.size] * 6))
    assert (same.low, same.high) == (named.low, named.high)
    assert judgement.as_repeated(view, named, 39, walks(true[:3])) is named  # the others fell


def test_a_controller_with_other_parameters_than_candidates_is_not_emulated():
    file = twin_file.of_controller("record-2011")
    assert evidence.unconfirmed(file, ["C_F_ST_F_ANG"]) == ""
    assert "is not known (2 other parameters)" in evidence.unconfirmed(file, ["C_H_X", "C_H_Y"])


def test_walks_for_a_confirmation_are_the_same_each_time():
    asked = evidence.Asked("record-2011", "ranger", "floor", "floor", "slope_rad", 0.004, 0.0, float("nan"))
    first, again = emulate(asked), emulate(asked)
    assert len(first) == WALKS and all(each.full.shape[0] == len(each.leg) for each in first)
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.full, other.full, equal_nan=True)


def test_repeats_are_walks_of_other_bodies_and_batteries_the_same_each_time():
    asked = evidence.Asked("record-2011", "ranger", "floor", "floor", "slope_rad", 0.004, 0.0, float("nan"), True)
    values = walking.values_of("ranger", "record-2011")
    key = "floor@floor@slope_rad"
    task = walking.Task("", 910_000, "record-2011", "ranger", key, 0.004, tolerances=True)
    cause, *loose = walking.drawn(task, values)
    assert cause.scenario == {"slope_rad": 0.004} and len(loose) > 20
    assert not any("slope_rad" in each.scenario for each in loose)  # the tolerance of the cause itself is not drawn
    assert loose == walking.drawn(task, values)[1:]
    assert asked.repeats and REPEATS >= judgement.FEWEST_REPEATS


def test_a_robot_that_falls_at_once_or_cannot_be_made_has_no_walks():
    asked = evidence.Asked("record-2011", "ranger", "floor", "floor", "slope_rad", -0.06, 0.0, 26.0)
    assert emulate(asked) == []
    assert emulate(dataclasses.replace(asked, cause="inertia", at="body", parameter="mass_kg", size=-20.0)) == []


def inside_after(view, rows):
    """Which of the 39 steps count when the states in which these steps start are 50 deviations away."""
    leg, found = made_up(9400)
    found[rows, features.NAMES.index(FEW_START[0])] += 50.0
    return step_map.rest(view.legs, leg, found, few=True).inside


def test_a_stray_step_outside_the_map_is_left_out(view):
    assert inside_after(view, [20]).tolist() == [row != 20 for row in range(39)]


def test_steps_count_that_stay_outside_the_map_from_some_step_on(view):
    inside = inside_after(view, range(20, 40))
    assert inside[:20].all() and inside[26:].all()  # the first ones have inside neighbours


def test_a_walk_outside_the_map_from_its_begin_counts(view):
    assert inside_after(view, range(40)).all()


def test_the_trimmed_mean_is_not_moved_by_a_single_step():
    left = np.zeros((20, 2))
    left[3] = 100.0
    rest = Rest(np.arange(40), np.arange(40) % 2, np.repeat(left, 2, axis=0), np.ones(40, dtype=bool))
    assert mean_of(rest).value.tolist() == [0.0] * 4


# --- the file --------------------------------------------------------------------------------------------------


def test_the_file_has_the_same_bytes_each_time_and_reads_back(far_view, tmp_path):
    view = far_view
    file = twin_file.TwinFile({"few": view}, {"controller": "made-up", "parameters": {}})
    content = twin_file.written(file)
    assert content == twin_file.written(file)
    path = tmp_path / "made-up.npz"
    path.write_bytes(content)
    again = twin_file.read(path)
    assert again.made_of == file.made_of and len(again.views["few"].directions) == 2
    assert again.views["few"].directions[0].terms == pytest.approx(view.directions[0].terms, rel=1e-6)
    assert [[(knot.size, knot.steps) for knot in each.far] for each in again.views["few"].directions] == [
        [(knot.size, knot.steps) for knot in each.far] for each in view.directions
    ]
    assert again.views["few"].directions[0].far[1].moved == pytest.approx(view.directions[0].far[1].moved, rel=1e-6)
    assert twin_file.written(again) == content


def test_far_twins_have_twice_and_four_times_the_outermost_size_of_either_sign():
    tasks = making.far_tasks("record-2011", "ranger")
    assert len({making.path_of(pathlib.Path("here"), each) for each in tasks}) == len(tasks)
    for twin in TWINS:
        sizes = sorted({each.size for each in tasks if each.key == twin.key})
        outermost = min(0.0, *twin.sizes), max(0.0, *twin.sizes)
        assert sizes == sorted(times * size for times in (2.0, 4.0) for size in outermost if size)


def test_a_far_size_that_no_body_has_counts_as_a_fall(tmp_path):
    twin = next(each for each in TWINS if each.key == "coulomb_friction@outer_ankle@change_Nm")
    tasks = [each for each in making.far_tasks("record-2011", "ranger") if each.key == twin.key and each.size < 0.0]
    making.keep(tasks[0], tmp_path)
    ((_, walked),) = making.made(tasks[:1], tmp_path)
    assert walked.fell and len(walked.leg) == 0


def test_another_file_is_refused_in_one_line(tmp_path):
    path = tmp_path / "other.npz"
    path.write_bytes(b"not a file of twins")
    with pytest.raises(DataError, match=r"other\.npz: this is not a file of twins"):
        twin_file.read(path)


def test_every_cause_of_the_table_of_twins_is_an_answer_of_the_catalogue():
    assert len(TWINS) >= 40
    for each in TWINS:
        named = TwinCause(each.cause, each.at, {each.parameter: Value(1.0, (0.5, 1.5))}, 99.0)
        found = TwinsEvidence("record-2011", detected=True, named=named, likeliest=(named,))
        assert evidence.result_cause(found).balance


def test_without_a_file_the_answer_says_how_to_make_it():
    found, verdict = evidence.of([])
    assert verdict is None and not found.detected
    assert "record-2011" in twin_file.available() or "`ranger-sim twins record-2011` makes them" in found.note
