"""The command that repeats a walk, for any options: parsed again, it asks for the same walk."""

import argparse
import shlex

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ranger_sim.ranger.scenario import LIMITS, StopRule
from ranger_sim.tools import cli
from ranger_sim.tools.run import serial_options, walk_options
from ranger_sim.tools.run.walk_options import WALK

NAMES = st.text(min_size=1, max_size=8).filter(lambda text: "\0" not in text)
NUMBERS = {name: st.floats(low, high) for name, (low, high, _) in LIMITS.items()}
VALUES = {
    "steps": st.integers(1, 10**9),
    "time": st.floats(0.0, 1e9, exclude_min=True),
    "distance": st.floats(0.0, 1e9, exclude_min=True),
    "controller": NAMES,
    "body": NAMES,
    "seed": st.integers(0),
    "floor_roughness": NUMBERS["floor_roughness_m"],
    "slope": NUMBERS["slope_rad"],
    "battery": NUMBERS["battery_charge"],
    "battery_capacity": NUMBERS["battery_capacity_Wh"],
    "off": st.lists(st.just("left-outer-ankle"), min_size=1, max_size=2),
    "model": NAMES,
    "profile": NAMES,
    "fault": st.lists(NAMES, min_size=1, max_size=3),
    "fault_module": st.lists(NAMES, min_size=1, max_size=2),
    "daq_port": NAMES,
    "daq_link": st.sampled_from(["wired", "bluetooth"]),
    "daq_dropouts": st.just(True),
    "imu_port": NAMES,
    "firmware": st.lists(NAMES, min_size=1, max_size=2),
    "image": st.lists(NAMES, min_size=1, max_size=2),
}


def walk_parser():
    """The parser of the subcommand alone."""
    commands = next(action for action in cli.parser()._actions if isinstance(action, argparse._SubParsersAction))
    return commands.choices["walk"]


VERBOSITY = {"-q", "--quiet", "-v", "--verbose"}  # of what is printed, not of the run
PARSER = walk_parser()


def test_every_option_of_walk_is_in_the_table():
    parsed = {text for action in PARSER._actions for text in action.option_strings} - {"-h", "--help", *VERBOSITY}
    assert parsed == {option.name for option in WALK}
    assert set(VALUES) == {option.key for option in WALK if option.of_run}


@settings(suppress_health_check=[HealthCheck.too_slow])  # on a busy machine
@given(st.fixed_dictionaries({}, optional=VALUES))
def test_the_command_asks_for_the_same_walk(chosen):
    given_options = PARSER.parse_args([])
    for name, value in chosen.items():
        setattr(given_options, name, value)
    stop = walk_options.stop_of(given_options) or StopRule(steps=100)
    words = shlex.split(walk_options.command_again(given_options, stop))
    assert words[:2] == ["ranger-sim", "walk"]
    again = PARSER.parse_args(words[2:])
    assert walk_options.stop_of(again) == stop
    assert walk_options.scenario_of(again) == walk_options.scenario_of(given_options)
    for option in WALK:
        if option.of_run and option not in walk_options.END:
            assert getattr(again, option.key) == getattr(given_options, option.key), option.name


def test_a_walk_that_was_interrupted_is_repeated_up_to_that_nanosecond():
    for time_ns in (50_000_000, 12_350_000_001, 110_942_123_456_789):
        words = shlex.split(walk_options.command_again(PARSER.parse_args([]), StopRule(time_s=time_ns * 1e-9)))
        assert round(PARSER.parse_args(words[2:]).time * 1e9) == time_ns


def test_options_that_only_choose_what_is_kept_are_not_of_the_run():
    kept = [
        "--out",
        "a",
        "--log",
        "full",
        "--json",
        "b",
        "--trace",
        "c.vcd",
        "--trace-last",
        "1s",
        "--trace-detail",
        "all",
        "--imu-offer",
        "pty",
    ]
    again = walk_options.command_again(PARSER.parse_args(["--steps", "5", *kept]), StopRule(steps=5))
    assert again == "ranger-sim walk --steps 5 --controller record-2011 --body ranger --seed 1"
    assert serial_options.OPTIONS[-1].name == "--imu-offer"
