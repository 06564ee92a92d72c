"""Error configurations, ended faults and faults of a given length."""

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults.error_sets import ErrorConfiguration, ErrorPort, ErrorSet
from ranger_sim.harness.faults.ranger_catalogue import CATALOGUE
from tests.harness.faults.bench import PlantBench


class Armed(PlantBench):
    """A bench that arms faults that are made, as Ranger does."""

    def arm(self, fault):
        fault.arm(self)
        self.faults.append(fault)
        return fault


FROZEN = ErrorSet("frozen", ("MCH.joint_encoder:stuck", "MCH.absolute_encoder:offset"), trigger="10 ms")
HEALTHY = ErrorSet("healthy", (), trigger="20 ms")
OFF = ErrorSet("off", ("MCH.absolute_encoder:offset,offset=-50", "MCFO.left_foot:offset"))


def port_of(bench, *sets):
    port = ErrorPort(bench)
    port.set_configuration(ErrorConfiguration("of this test", sets))
    return port


def test_sets_become_active_by_their_conditions_and_an_empty_one_clears():
    bench = Armed()
    port = port_of(bench, FROZEN, HEALTHY)
    port.activate()
    bench.step(40)
    assert port.active_set is None
    bench.step(2)
    assert port.active_set == FROZEN
    first = list(port.active_errors)
    assert [fault.active for fault in first] == [True, True]
    bench.step(45)
    assert port.active_set == HEALTHY
    assert port.active_errors == []
    assert [fault.ended_ns for fault in first] == [20_000_000] * 2  # with the step that the trigger begins
    assert all(fault.cleared_ns > 0 for fault in first)


def test_a_set_waits_for_the_manual_trigger_and_takes_a_place_that_the_last_one_had():
    bench = Armed()
    port = port_of(bench, ErrorSet("now", ("MCH.absolute_encoder:offset",)), OFF)
    port.activate()
    bench.step(40)
    assert port.active_set is None
    port.trigger()
    bench.step(4)
    (first,) = port.active_errors
    assert first.active
    port.trigger()
    bench.step(10)
    assert port.active_set == OFF
    assert first.cleared_ns > 0
    assert [fault.largest_difference for fault in port.active_errors] == [-50, 0.5]
    with pytest.raises(UserError, match="no set left"):
        port.trigger()


def test_deactivating_ends_every_fault_of_the_configuration():
    bench = Armed()
    port = port_of(bench, FROZEN)
    port.activate()
    bench.step(60)
    faults = list(port.active_errors)
    port.deactivate()
    bench.step(10)
    assert port.active_set is None
    assert all(fault.cleared_ns > 0 for fault in faults)
    assert bench.loop.watchers == []


def test_a_configuration_that_is_activated_again_acts_again_when_all_places_are_clear():
    bench = Armed()
    port = port_of(bench, ErrorSet("now", ("MCH.absolute_encoder:offset",)))
    made = []
    for _ in range(2):
        port.activate()
        port.trigger()
        bench.step(6)
        made += port.active_errors
        port.deactivate()
    bench.step(4)
    first, second = made
    assert first.acted and second.acted
    assert second.activated_ns >= first.cleared_ns > 0 and second.cleared_ns > 0
    with pytest.raises(UserError, match="nothing to trigger before a configuration is activated"):
        port.trigger()


def test_a_set_whose_faults_had_no_time_to_begin_does_not_keep_the_next_one_waiting():
    bench = Armed()
    port = port_of(bench, ErrorSet("short", ("MCH.absolute_encoder:offset",)), OFF)
    port.activate()
    port.trigger()
    bench.step(1)
    port.trigger()
    bench.step(4)
    assert port.active_set == OFF and all(fault.acted for fault in port.active_errors)
    assert len(port.active_errors) == 2 and port.leaving == []


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        ((ErrorSet("a", ("MCH.joint_encoder:stuk",)),), "unknown mode 'stuk'"),
        ((ErrorSet("a", ("MCH.joint_encoder:stuck@3 s",)),), "its set says when it begins"),
        ((ErrorSet("a", (), trigger="stp 3"),), "reads like"),
    ],
)
def test_mistakes_are_told_when_the_configuration_is_set(sets, words):
    with pytest.raises(UserError, match=words):
        port_of(Armed(), *sets)


def test_a_configuration_is_activated_once_and_not_before_it_is_there():
    bench = Armed()
    with pytest.raises(UserError, match="no configuration"):
        ErrorPort(bench).activate()
    port = port_of(bench, FROZEN)
    port.activate()
    with pytest.raises(UserError, match="active already"):
        port.activate()
    with pytest.raises(UserError, match="deactivate"):
        port.set_configuration(ErrorConfiguration("another", ()))


def test_a_fault_of_a_length_ends_so_long_after_it_began():
    bench = PlantBench()
    fault = bench.inject("MCH.absolute_encoder", "offset", "10 ms", "+3 ms")
    bench.step(80)
    assert (fault.activated_ns, fault.ended_ns) == (10_000_000, 13_000_000)
    assert CATALOGUE.typed("MCH.absolute_encoder:offset@10 ms..+3 ms").text() == (
        "MCH.absolute_encoder:offset@10 ms..+3 ms"
    )
    with pytest.raises(UserError, match="its length '3'"):
        bench.inject("MCH.absolute_encoder", "offset", until="+3")


def test_a_fault_that_is_stopped_by_hand_ends_with_the_next_step_and_one_that_waits_never_begins():
    bench = PlantBench()
    fault = bench.inject("MCH.absolute_encoder", "offset")
    waiting = bench.inject("UI.imu", "stuck", "1 h")
    bench.step(8)
    fault.stop()
    waiting.stop()
    bench.step(4)
    assert (fault.ended_ns, fault.cleared_ns) == (2_000_000, 2_250_000)
    assert waiting.activated_ns == -1
    assert bench.loop.watchers == []
