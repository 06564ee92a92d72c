"""Our bus and the bit-level oracle of ISO 11898-1 agree on random scenarios and frames, in every bit."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.examples import examples

from . import oracle_comparison as comparison
from .bit_oracle import Frame

SEEDS = 27  # of each kind, 297 in all; `python -m tests.can_bus.oracle_comparison` does any number


@pytest.mark.parametrize("kind", comparison.KINDS)
def test_what_nodes_send_receive_and_count_is_what_the_standard_says(kind):
    for seed in range(SEEDS):
        assert comparison.differences(comparison.scenario_of(kind, seed)) == [], f"{kind}, seed {seed}"


def test_the_scenarios_hold_what_they_are_for():
    """Otherwise agreement would say nothing."""

    def outcomes(kind):
        for seed in range(SEEDS):
            scenario = comparison.scenario_of(kind, seed)
            yield scenario, *comparison.on_our_bus(scenario)

    def peak(outcome, counter):
        return max(each[counter] for node in outcome.counters for each in node)

    assert sum(len(seen) for _, outcome, _ in outcomes("clean") for seen in outcome.seen) > 10 * SEEDS
    assert sum(peak(outcome, 1) >= 128 for _, outcome, _ in outcomes("equal")) > SEEDS // 5  # passive by collisions
    assert sum(peak(outcome, 2) > 8 for _, outcome, _ in outcomes("noise")) > SEEDS // 2
    assert sum("bus-off" in outcome.states for _, outcome, _ in outcomes("off")) > SEEDS // 2
    back = 0
    for scenario, outcome, _ in outcomes("recovery"):
        back += sum(
            "on" == state and any(each[1:] == (0, 0) for each in moved[1:]) and max(scenario.counters[node]) >= 240
            for node, (state, moved) in enumerate(zip(outcome.states, outcome.counters, strict=True))
        )
    assert back > SEEDS // 3  # nodes that were thrown off and came back


@pytest.mark.parametrize("wrong", ["counters", "seen", "states"])
def test_a_disagreement_would_be_found(wrong, monkeypatch):
    scenario = comparison.scenario_of("errors", 1)
    ours, accepted = comparison.on_our_bus(scenario)
    if wrong == "counters":
        ours.counters[0].append((9, 1, 1))
    elif wrong == "seen":
        ours.seen[0].append((9, "sent"))
    else:
        ours.states[0] = "off"
    monkeypatch.setattr(comparison, "on_our_bus", lambda scenario: (ours, accepted))
    assert comparison.differences(scenario) == [wrong]


def test_lengths_and_crcs_of_frames_are_the_oracles():
    assert comparison.compare_frames(2000) == 0


@st.composite
def scenarios(draw):
    """Few nodes, few identifiers, wrong bits anywhere: hypothesis looks for the smallest that differs."""
    count = draw(st.integers(2, 3))
    frames = st.builds(
        Frame,
        st.sampled_from([0, 1, 0x2AA, 0x7FF]),
        st.binary(max_size=2),
        extended=st.booleans(),
        single_shot=st.booleans(),
        buffer=st.integers(1, 3),
    )
    request = st.tuples(st.integers(1, 150), st.integers(0, count - 1), frames)
    counter = st.tuples(st.sampled_from([0, 120, 127, 128, 248, 255]), st.sampled_from([0, 119, 127, 128]))
    return comparison.Scenario(
        count,
        800,
        tuple(draw(st.lists(request, min_size=1, max_size=6))),
        tuple(draw(st.lists(counter, min_size=count, max_size=count))),
        tuple(sorted(draw(st.sets(st.integers(2, 250), max_size=8)))),
        tuple((bit, node, comparison.OPERATING) for bit, node in draw(
            st.lists(st.tuples(st.integers(50, 300), st.integers(0, count - 1)), max_size=2)
        )),
    )  # fmt: skip


@settings(max_examples=examples(150))
@given(scenarios())
def test_no_scenario_differs(scenario):
    assert comparison.differences(scenario) == []


@settings(max_examples=examples(60))
@given(
    st.sampled_from(comparison.KINDS),
    st.integers(0, 10_000),
    st.lists(st.integers(300, 200_000), min_size=1, max_size=12),
)
def test_a_disturbed_bus_does_not_depend_on_how_time_is_cut(kind, seed, steps):
    """Nor on how far it looked ahead: `steps` are shorter and longer than bits and frames."""
    scenario = comparison.scenario_of(kind, seed)
    assert comparison.on_our_bus(scenario, steps) == comparison.on_our_bus(scenario)
