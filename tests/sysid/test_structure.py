"""Structural detectability and isolability: examples worked by hand, and every small system against brute force."""

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.sysid.structure import isolable, overdetermined
from tests.examples import examples


def system(**equations):
    return {name: frozenset(unknowns.split()) for name, unknowns in equations.items()}


# A DC motor on a bench with its sensors: current i, speed w, angle q, acceleration's torque t, load l.
MOTOR = system(
    electric="i w", mechanic="w t l", torque="i t", angle="q w", see_i="i", see_w="w", see_q="q", see_t="t"
)  # fmt: skip


def test_an_equation_too_many_is_overdetermined_and_its_sensors_with_it():
    assert overdetermined(system(a="x", b="x")) == {"a", "b"}
    assert overdetermined(system(a="x", b="x y")) == set()
    assert overdetermined(system(a="x", b="x y", c="y", d="z")) == {"a", "b", "c"}
    assert overdetermined(system(a="", b="x")) == {"a"}
    assert overdetermined({}) == set()


def test_a_motor_by_hand():
    # The load is in the mechanic equation only, so nothing contradicts that one; all others are in loops.
    assert overdetermined(MOTOR) == set(MOTOR) - {"mechanic"}
    faults = {name: [name] for name in MOTOR}
    told = isolable(MOTOR, faults)
    assert "mechanic" not in told
    # angle and see_q: w is known twice more, q only by these two: whoever of them fails, the other falls with it.
    assert "see_q" not in told["angle"] and "angle" not in told["see_q"]
    # the same for the torque and its sensor
    assert "see_t" not in told["torque"] and "torque" not in told["see_t"]
    # without the electric equation i is tied to w no more, but q and w stay a loop
    assert told["see_q"] >= {"electric", "see_i", "torque", "see_t"}
    assert told["see_i"] >= {"angle", "see_q", "electric"} - {"electric"}


def test_a_second_sensor_separates_what_one_could_not():
    twice = MOTOR | system(see_q2="q")
    told = isolable(twice, {name: [name] for name in twice})
    assert "see_q" in told["see_q2"] and "see_q" in told["angle"] and "angle" in told["see_q"]


def test_a_fault_in_two_equations_is_reported_by_either():
    told = isolable(MOTOR, {"both": ["electric", "torque"], "see_t": ["see_t"], "see_q": ["see_q"]})
    assert told["both"] == {"see_t", "see_q"}  # without see_t the electric equation still shows it
    assert "both" in told["see_q"] and "both" not in told["see_t"]


def brute_force(equations):
    """An equation is over-determined when it lies in a smallest set with one equation more than unknowns.

    Found by trying all subsets: of those with the largest surplus of equations over unknowns, the smallest.
    """
    names = list(equations)
    best = (0, 0, set())
    for size in range(len(names) + 1):
        for chosen in itertools.combinations(names, size):
            unknowns = set().union(*(equations[name] for name in chosen)) if chosen else set()
            surplus = size - len(unknowns)
            if surplus > best[0]:
                best = (surplus, size, set(chosen))
    return best[2]


@settings(max_examples=examples(200))
@given(st.lists(st.frozensets(st.sampled_from("uvwxy"), max_size=3), max_size=8))
def test_every_small_system_is_as_brute_force_finds_it(unknowns):
    equations = {f"e{k}": each for k, each in enumerate(unknowns)}
    assert overdetermined(equations) == brute_force(equations)


# The example of an electric motor that comes with the FaultDiagnosisToolbox (Frisk, Krysander; version 0.12.5), its
# derivatives counted as their unknowns, and which faults that program says cannot be told apart.
TOOLBOX_MOTOR = system(
    electric="i w", torque="i Tm", acceleration="w T", balance="T Tm Tl", see_i="i", see_w="w", see_T="T"
)  # fmt: skip
TOOLBOX_FAULTS = {"fR": ["electric"], "fi": ["see_i"], "fw": ["see_w"], "fT": ["see_T"]}
TOOLBOX_TOGETHER = {"fR": {"fR", "fi"}, "fi": {"fR", "fi"}, "fw": {"fw"}, "fT": {"fT"}}
# The same program on the motor above: every fault is in one equation of the same name.
TOOLBOX_ON_OURS = {
    "electric": {"electric"},
    "torque": {"torque", "see_t"},
    "angle": {"angle", "see_q"},
    "see_i": {"see_i"},
    "see_w": {"see_w"},
    "see_q": {"angle", "see_q"},
    "see_t": {"torque", "see_t"},
}


def test_the_same_as_the_fault_diagnosis_toolbox_says():
    told = isolable(MOTOR, {name: [name] for name in MOTOR})
    assert {fault: set(told) - others for fault, others in told.items()} == TOOLBOX_ON_OURS
    told = isolable(TOOLBOX_MOTOR, TOOLBOX_FAULTS)
    assert {fault: set(told) - others for fault, others in told.items()} == TOOLBOX_TOGETHER
