"""What is odd in data is found at its place with its size; sound data show nothing; repairs undo what was hidden."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import channels, repairs, sanity
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.reading import open_recording as read
from tests.boards.original_images import DATA
from tests.examples import examples

STEP = 2.0 * math.pi / 8192.0  # of the robot's absolute encoders
N = 4000
needs_data = pytest.mark.skipif(not (DATA / "emps_run1.csv").exists(), reason=f"no measured data in {DATA.name}/")


def recording(**values):
    """A swinging joint of 16 s at 4 ms by encoder and tachometer; `values` replace or add (time_s, value, unit)."""
    time_s = np.arange(N) * 0.004
    noise = generator(1, "sanity").normal(0.0, 1.0, (3, N))
    angle = 0.8 * np.sin(2.0 * np.pi * 0.7 * time_s) + 0.2 * np.sin(2.0 * np.pi * 1.9 * time_s)
    rate = 0.8 * 2.0 * np.pi * 0.7 * np.cos(2.0 * np.pi * 0.7 * time_s)
    rate += 0.2 * 2.0 * np.pi * 1.9 * np.cos(2.0 * np.pi * 1.9 * time_s)
    made = {
        "joint_angle_rad": (time_s, np.round(angle / STEP) * STEP, "rad"),
        "joint_rate_rad_per_s": (time_s, rate + 0.01 * noise[0], "rad/s"),
        "current_A": (time_s, 2.0 * angle + 0.02 * noise[1], "A"),
    } | values
    return Dataset("swing", {name: Channel(name, unit, t.copy(), v.copy()) for name, (t, v, unit) in made.items()})


def changed(name, change, stamps=None):
    """The recording with one channel's values (or stamps) changed."""
    data = recording()
    channel = data[name]
    value = channel.value.copy()
    time_s = channel.time_s.copy()
    if stamps is not None:
        time_s = stamps(time_s)
    if change is not None:
        value = change(value)
    data.channels[name] = dataclasses.replace(channel, time_s=time_s, value=value)
    return data


def found(data, kind):
    return [each for each in sanity.inspect(data) if each.kind == kind]


def put(places, new):
    """A change that puts a value, or the result of a function, in some places."""

    def change(value):
        value[places] = new(value[places]) if callable(new) else new
        return value

    return change


def test_sound_data_show_nothing():
    assert sanity.inspect(recording()) == []


def test_every_kind_that_is_reported_is_explained():
    told = {finding.kind for _, data, *_ in CASES for finding in sanity.inspect(data())}
    assert told <= set(sanity.KINDS)
    assert {kind for kind, *_ in CASES} <= told


CASES = [
    # (kind, data, channel, place in s, size within 5 %)
    ("gap", lambda: changed("current_A", None, lambda t: t + 0.5 * (t > 8.0)), "current_A", 8.0, 0.504),
    ("reversed_stamps", lambda: changed("current_A", None, put(1000, 3.5)), "current_A", 3.996, 0.496),
    ("duplicate_stamps", lambda: changed("current_A", None, put(1000, 3.996)), "current_A", 3.996, 1.0),
    ("not_finite", lambda: changed("current_A", put(slice(500, 510), math.nan)), "current_A", 2.0, 10.0),
    ("not_finite", lambda: changed("current_A", put(500, math.inf)), "current_A", 2.0, 1.0),
    ("stuck", lambda: changed("joint_angle_rad", put(slice(2000, 2300), 0.3)), "joint_angle_rad", 8.0, 1.196),
    ("bit_flip", lambda: changed("joint_angle_rad", put(700, lambda v: v + 1024 * STEP)), "joint_angle_rad", 2.8,
     1024 * STEP),
    ("spike", lambda: changed("current_A", put(700, 7.77)), "current_A", 2.8, 7.77 - 2.0 * 0.0),
    ("saturation", lambda: changed("current_A", lambda v: np.clip(v, -1.1, 1.1)), "current_A", None, 1.1),
    ("lag", lambda: changed("joint_rate_rad_per_s", lambda v: np.roll(v, 5)), "joint_rate_rad_per_s", 0.004, 0.020),
    ("lag", lambda: changed("joint_rate_rad_per_s", lambda v: np.roll(v, -5)), "joint_rate_rad_per_s", 0.004, -0.020),
    ("wrong_unit", lambda: changed("joint_rate_rad_per_s", np.degrees), "joint_rate_rad_per_s", None, 57.296),
    ("wrong_unit", lambda: changed("joint_angle_rad", np.degrees), "joint_angle_rad", None, None),
    ("wrong_unit", lambda: changed("current_A", lambda v: 1e-200 * v), "current_A", None, None),
    ("wrong_unit", lambda: changed("joint_rate_rad_per_s", np.negative), "joint_rate_rad_per_s", None, -1.0),
    ("wrong_unit", lambda: changed("joint_rate_rad_per_s", lambda v: v * 30 / math.pi), "joint_rate_rad_per_s", None,
     9.549),
    ("constant", lambda: changed("current_A", put(slice(None), 0.5)), "current_A", 0.0, 0.0),
    ("empty", lambda: changed("current_A", lambda v: v[:0], lambda t: t[:0]), "current_A", 0.0, 0.0),
    ("single_sample", lambda: changed("current_A", lambda v: v[:1], lambda t: t[:1]), "current_A", 0.0, 1.0),
    ("one_instant", lambda: changed("current_A", None, lambda t: 0.0 * t + 2.0), "current_A", 2.0, 0.0),
    ("stamp_wrap", lambda: changed("current_A", None, lambda t: (t + 60.0) % 65.536), "current_A", 65.532, 65.53),
    ("wrap", lambda: recording(counter_rad=(np.arange(N) * 0.004, (np.arange(N) * 0.013) % 6.4, "rad")),
     "counter_rad", None, 6.387),
    ("clock_drift", lambda: recording(board_s=(np.arange(N) * 0.004, np.arange(N) * 0.004 * 1.0005, "s")), "board_s",
     0.0, 500.0),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "data", "channel", "place", "size"), CASES, ids=[f"{k}-{i}" for i, (k, *_) in enumerate(CASES)]
)
def test_what_is_hidden_is_found_where_it_is(kind, data, channel, place, size):
    of_kind = [each for each in found(data(), kind) if each.channel == channel]
    assert of_kind, [(each.channel, each.kind, each.text) for each in sanity.inspect(data())]
    if place is not None:
        assert any(abs(each.start_s - place) < 0.02 for each in of_kind)
    if size is not None:
        # 5 %: a lag is found to a tenth of a sample, a spike's size to its neighbours' motion (0.2 A)
        assert any(each.size == pytest.approx(size, rel=0.05, abs=1e-3) or (kind == "spike" and each.size > 5.0)
                   for each in of_kind)  # fmt: skip


def test_a_lag_that_grows_is_a_drift_of_the_clocks():
    data = recording()
    rate = data["joint_rate_rad_per_s"]
    data.channels[rate.name] = dataclasses.replace(rate, time_s=rate.time_s * 1.005 + 0.02)
    drift = found(data, "clock_drift")
    assert [each.channel for each in drift] == ["joint_rate_rad_per_s"]
    assert drift[0].size == pytest.approx(5000.0, rel=0.1)  # ppm; the rate's noise alone moves a lag by 0.1 ms


@pytest.mark.parametrize("digits", [3, 5])
def test_the_finest_step_is_found_through_printed_digits(digits):
    value = np.round(np.round(np.sin(np.arange(5000) * 0.01) / 0.0123) * 0.0123, digits)
    assert sanity.lattice_step(value) == pytest.approx(0.0123, rel=1e-3)


def test_what_is_on_no_lattice_has_no_finest_step():
    assert sanity.lattice_step(generator(3, "lattice").normal(size=3000)) == 0.0


def test_held_commands_and_resting_channels_are_not_stuck_sensors():
    time_s = np.arange(N) * 0.004
    command = np.repeat(generator(2, "commands").normal(size=8), N // 8)
    rest = np.where(time_s < 6.0, 0.0, np.sin(time_s - 6.0))  # rests, then moves
    data = recording(command_A=(time_s, command, "A"), other_rad=(time_s, np.round(rest / STEP) * STEP, "rad"))
    assert not [each for each in sanity.inspect(data) if each.channel == "command_A" and each.kind != "constant"]


def test_data_without_anything_to_work_on_is_refused_in_a_line():
    empty = Dataset("nothing", {})
    with pytest.raises(UserError, match="nothing: there is no channel"):
        sanity.stop_if_fatal("nothing", sanity.inspect(empty))
    with pytest.raises(UserError, match="swing: current_A: there is one sample only"):
        data = changed("current_A", lambda v: v[:1], lambda t: t[:1])
        sanity.stop_if_fatal(data.name, sanity.inspect(data))
    with pytest.raises(UserError, match="no channel has 2 sound samples"):
        repairs.mend(Dataset("x", {"a_V": Channel("a_V", "V", np.array([0.0]), np.array([1.0]))}))


# --- repairs ------------------------------------------------------------------------------------------------


def test_sound_data_stay_as_they_are():
    data = recording()
    mended = repairs.mend(data)
    assert mended.repairs == []
    for name, channel in data.channels.items():
        assert (mended[name].value == channel.value).all() and (mended[name].time_s == channel.time_s).all()


@pytest.mark.parametrize("kind", ["reversed_stamps", "duplicate_stamps", "not_finite", "bit_flip", "stamp_wrap"])
def test_what_was_wrong_is_left_out_or_put_right_and_recorded(kind):
    data = next(make() for each, make, *_ in CASES if each == kind)
    mended = repairs.mend(data)
    assert kind in {each.kind for each in mended.repairs} <= set(repairs.KINDS)
    assert kind not in {each.kind for each in sanity.inspect(dataclasses.replace(mended, findings=[]))}
    for channel in mended.channels.values():
        assert np.isfinite(channel.value).all() and (np.diff(channel.time_s) > 0.0).all()


def test_an_overrun_integer_counts_on():
    data = recording(counter_rad=(np.arange(N) * 0.004, (np.arange(N) * 0.013) % 6.4, "rad"))
    assert repairs.mend(data)["counter_rad"].value == pytest.approx(np.arange(N) * 0.013)


def test_a_clock_that_ran_over_counts_on_by_its_own_span():
    data = changed("current_A", None, lambda t: (t + 60.0) % 65.536)
    assert repairs.mend(data)["current_A"].time_s == pytest.approx(np.arange(N) * 0.004 + 60.0)


def test_judgements_are_asked_for_by_name_and_undo_what_they_name():
    data = changed("joint_angle_rad", np.degrees)
    data = repairs.converted(data, "joint_angle_rad", "deg")
    assert data["joint_angle_rad"].value == pytest.approx(recording()["joint_angle_rad"].value)
    assert repairs.shifted(data, "current_A", -0.01)["current_A"].time_s[0] == -0.01
    assert repairs.offset(data, "current_A", 1.0)["current_A"].value == pytest.approx(data["current_A"].value + 1.0)
    part = repairs.cut(data, 2.0, 100.0)
    assert part["current_A"].time_s[-1] < 2.0 <= part["current_A"].time_s[-1] + 0.0041
    assert [each.kind for each in part.repairs] == ["converted", "cut"]
    with pytest.raises(UserError, match="unknown unit 'furlong'"):
        repairs.converted(data, "joint_angle_rad", "furlong")
    with pytest.raises(UserError, match="samples outside"):
        repairs.cut(data, 0.0, 100.0)


NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True, width=64), st.sampled_from([0.0, 1.0, -1.0, 1e308, 5e-324])
)


@settings(max_examples=examples(60), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    samples=st.lists(st.tuples(NUMBERS, NUMBERS), max_size=80),
    repeats=st.integers(1, 3),
    name=st.sampled_from(["joint_angle_rad", "joint_rate_rad_per_s", "board_s"]),
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # sums of 1e308 overflow, which is what they are here for
def test_no_numbers_whatever_break_the_inspection_or_the_repairs(samples, repeats, name):
    pairs = np.array(samples * repeats, dtype=float).reshape(-1, 2)
    data = recording()
    data.channels[name] = Channel(name, "s" if name == "board_s" else "rad", pairs[:, 0], pairs[:, 1])
    for finding in sanity.inspect(data):
        assert finding.kind in sanity.KINDS and "\n" not in finding.text
    mended = repairs.mend(data)
    for channel in mended.channels.values():
        assert np.isfinite(channel.value).all() and (np.diff(channel.time_s) > 0.0).all()


# --- what was measured --------------------------------------------------------------------------------------


@needs_data
@pytest.mark.parametrize(
    ("file", "experiment", "kinds"),
    [
        ("emps_run1.csv", "positioning", set()),
        ("emps_run2_pulses.csv", "positioning", set()),
        ("ranger_ankle_sine_slow.csv", "ankle", set()),
        ("ranger_ankle_sine_fast.csv", "ankle", {"gap"}),  # one of 72 ms (docs/robot.md C6.2)
        ("ranger_foot_inertia_2.csv", "ankle", {"gap", "lag"}),
        ("ranger_foot_inertia_3.csv", "ankle", {"lag"}),  # the rate comes 8 to 9 ms after the angle in all five runs
        ("ranger_foot_inertia_5.csv", "ankle", {"lag"}),
        ("ranger_walk_20150820.csv", "walk", set()),  # many gaps, told together as a note
    ],
)
def test_the_measured_logs_show_what_is_known_of_them_and_nothing_else(file, experiment, kinds):
    data = channels.named_for(read(DATA / file), experiment)
    assert {each.kind for each in sanity.inspect(data) if each.severity != "note"} == kinds


def test_an_angle_at_rest_is_not_stuck_because_a_temperature_moves():
    time_s = np.arange(4000) * 1e-3
    angle = np.where(time_s < 1.0, 0.0, np.sin(5.0 * (time_s - 1.0)))
    warmth = 25.0 + np.round(20.0 * time_s) / 20.0

    def stuck(*more):
        all_channels = [
            Channel("motor_angle_rad", "rad", time_s, angle),
            Channel("temperature_C", "C", time_s, warmth),
            *more,
        ]
        found = sanity.inspect(Dataset("rest", {each.name: each for each in all_channels}))
        return [each.channel for each in found if each.kind == "stuck"]

    assert stuck() == []
    assert stuck(Channel("current_A", "A", time_s, np.sin(40.0 * time_s))) == ["motor_angle_rad"]


@pytest.mark.parametrize(("top", "kinds"), [(0.3, ["at_rest"]), (1.0, ["stuck"])])
def test_a_speed_of_zero_is_rest_while_the_command_is_small_and_a_fault_while_it_is_large(top, kinds):
    time_s = np.arange(1000) * 0.01
    within = (time_s > 3.0) & (time_s < 7.0)
    command = np.where(within, top * np.sin(4.0 * np.pi * (time_s - 3.0) / 4.0), np.sin(2.0 * time_s))
    speed = np.where(within, 0.0, np.round(np.sin(2.0 * time_s - 0.3), 3))
    values = {"command": command, "speed": speed}
    data = Dataset("wheel", {name: Channel(name, "", time_s, value) for name, value in values.items()})
    found = [each for each in sanity.inspect(data) if each.kind in ("stuck", "at_rest")]
    assert [(each.channel, each.kind) for each in found] == [("speed", kind) for kind in kinds]
    assert [each.severity for each in found] == ["note" if kinds == ["at_rest"] else "warning"]
    assert "it stays at 0 for 3.98 s while command moves" in found[0].text


def bench_at_first_at_rest(**changes):
    """A motor that rests for half a second of five and then turns to and fro; torque by a noisy load cell."""
    time_s = np.arange(2500) * 0.002
    noise = generator(5, "a load cell").normal(size=(3, len(time_s)))
    turning = np.where(time_s < 0.508, 0.0, np.sin(3.0 * (time_s - 0.508)))
    columns = {
        "voltage_V": (3.0 * turning + 0.01 * noise[0], "V"),
        "current_A": (turning + 0.02 * noise[0], "A"),
        "speed_rad_per_s": (10.0 * turning + 0.03 * noise[1], "rad/s"),
        "torque_Nm": (0.1 * turning + 0.1 * noise[2], "N m"),  # its noise has most of the whole range
        "motor_angle_rad": (np.cumsum(140.0 * turning) * 0.002, "rad"),
    }
    columns |= {name: (value, columns[name][1]) for name, value in changes.items()}
    return Dataset("bench", {name: Channel(name, unit, time_s, value) for name, (value, unit) in columns.items()})


def test_an_angle_is_not_stuck_because_another_sensor_is_noisy():
    data = bench_at_first_at_rest()
    del data.channels["speed_rad_per_s"]
    assert found(data, "stuck") == []
    assert found(bench_at_first_at_rest(), "stuck") == []


def test_a_motor_that_friction_holds_is_at_rest_when_angle_and_speed_say_so():
    time_s = np.arange(2500) * 0.002
    from_the_start = 3.0 * np.sin(3.0 * (time_s - 0.508))  # drives below what breaks it loose, for us to see the rule
    assert found(bench_at_first_at_rest(voltage_V=from_the_start), "stuck") == []
    alone = bench_at_first_at_rest(voltage_V=from_the_start)
    del alone.channels["speed_rad_per_s"]
    assert [each.channel for each in found(alone, "stuck")] == ["motor_angle_rad"]


def test_an_angle_that_stands_while_its_own_rate_moves_is_stuck():
    turning = 10.0 * np.sin(3.0 * (np.arange(2500) * 0.002 - 0.508))
    (told,) = found(bench_at_first_at_rest(speed_rad_per_s=turning), "stuck")
    assert told.channel == "motor_angle_rad" and told.size == pytest.approx(0.508, abs=0.004)
    assert "while speed_rad_per_s move" in told.text


def test_a_channel_of_noise_that_has_nothing_in_common_with_the_others_is_reported():
    noise = generator(6, "nobody's").normal(size=N)
    (told,) = found(changed("current_A", lambda v: noise), "noise")
    assert told.channel == "current_A" and "nothing of it is in any other channel" in told.text


@pytest.mark.parametrize("late", [0, 3, -20])
def test_white_noise_that_drives_a_machine_is_none(late):
    """Its current follows a voltage that jumps at every sample, through a filter and some samples late."""
    time_s, drive = np.arange(N) * 0.004, generator(8, "a drive").normal(size=N)
    answer = np.zeros(N)
    for number in range(1, N):
        answer[number] = 0.9 * answer[number - 1] + 0.1 * drive[number]
    answer += 0.1 * generator(9, "its sensor").normal(size=N)
    data = recording(voltage_V=(time_s, drive, "V"), other_A=(time_s, np.roll(answer, late), "A"))
    assert found(data, "noise") == []


def test_rows_in_disorder_are_reported():
    data = recording()
    order = generator(10, "disorder").permutation(N)
    for name, channel in data.channels.items():
        data.channels[name] = dataclasses.replace(channel, value=channel.value[order])
    (told,) = found(data, "noise")
    assert "every channel jumps from sample to sample" in told.text
