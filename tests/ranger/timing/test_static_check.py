"""The check before anything runs: sums worked out by hand, and no run of the robot goes beyond them."""

import contextlib
import math

import pytest

from ranger_sim.firmware_sim.scheduler import Occasional, Task, Wait
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger import wiring
from ranger_sim.ranger.board_programs import BOARD_CLASSES
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.timing import robot_figures, static_check
from ranger_sim.ranger.timing.static_check import FITS, OVERRUNS, check
from tests.firmware_sim.board import TICK_CYCLES, Log


def checked(**table):
    log = Log()
    log.start(**{name: task(log) if callable(task) else task for name, task in table.items()})
    return check(log.chip)


def test_a_row_adds_costs_limits_and_one_tick():
    bound = checked(rows=lambda log: ((log.task("a", 600, limit=700), log.task("b", 1200, limit=1300)), ()))
    first, second = bound.rows
    assert (first.cost, first.worst, first.limits, first.interrupts, first.slot) == (1800, 2000, 2000, 85, 30_000)
    assert first.margin == pytest.approx(1 - (2000 + TICK_CYCLES) / 30_000)
    assert (second.cost, second.worst, second.verdict) == (0, 0, FITS)


@pytest.mark.parametrize("limit, verdict", [(30_000 - TICK_CYCLES, FITS), (30_000 - TICK_CYCLES + 1, OVERRUNS)])
def test_a_row_fits_up_to_its_whole_slot(limit, verdict):
    bound = checked(every=lambda log: (log.task("a", 600, limit=limit),))
    assert bound.rows[0].verdict == verdict and bound.fits == (verdict == FITS)


def test_a_function_without_a_limit_counts_its_cost():
    (bound,) = checked(every=lambda log: (log.task("a", 600),)).functions
    assert (bound.worst, bound.limit) == (600, 0)


def test_of_an_occasional_list_the_dearest_entry_counts():
    bound = checked(
        rows=lambda log: ((Occasional([log.task("x", 100, limit=200), log.task("y", 50, limit=900)]),), ()),
    )
    assert (bound.rows[0].cost, bound.rows[0].worst) == (20 + 100, 20 + 900)
    assert [(each.name, each.place) for each in bound.functions] == [
        ("occasional", "row 0"),
        ("x", "row 0, in turn"),
        ("y", "row 0, in turn"),
    ]


@pytest.mark.parametrize("work, total", [(900, 100 + 1000), (2000, 100 + 2000 + 10)])
def test_a_wait_ends_with_its_conversions_and_not_after_what_ran_meanwhile(work, total):
    bound = checked(
        every=lambda log: (
            log.task("adcx_convert_all", 100, limit=100),
            log.task("work", work, limit=work),
            Wait(lambda: True, cost=10, limit=1000, name="wait"),
        )
    )
    assert bound.rows[0].worst == total


def test_functions_come_in_the_order_of_the_firmwares_table():
    bound = checked(
        every=lambda log: (log.task("first", 1), log.task("second", 1)),
        rows=lambda log: ((log.task("row 0", 1),), (log.task("row 1", 1),)),
        last=lambda log: (log.task("last", 1),),
    )
    assert [each.name for each in bound.functions] == ["first", "second", "row 0", "row 1", "last"]
    assert [each.place for each in bound.functions] == ["every slot", "every slot", "row 0", "row 1", "every slot"]


@pytest.fixture(scope="module")
def robot():
    with contextlib.closing(Ranger()) as made:
        yield made


def test_edges_are_those_of_the_motors_top_speed(robot):
    # 512 lines, both edges, 105 turns/s: 107,520 edges/s, 53.8 in 0.5 ms; joints behind 34:1 and 66:1 with 2048 lines
    assert check(robot.board("MCFI")).edges == {"encoder_edge_0": 54, "encoder_edge_2": 7}
    assert check(robot.board("MCH")).edges == {"encoder_edge_0": 4, "encoder_edge_2": 21}
    assert check(robot.board("MCSI")).edges == {}


def test_a_stated_rate_of_edges_takes_the_place_of_the_top_speed(robot):
    board = robot.board("MCFI")
    none = check(board, edges_per_s=0.0)
    assert set(none.edges.values()) == {0}
    rate = check(board, edges_per_s=20_000.0)
    assert set(rate.edges.values()) == {11}
    # per edge the interrupt, 94 cycles, and 48 of the decoder; two encoders
    assert rate.rows[0].worst - none.rows[0].worst == 2 * 11 * 48
    assert rate.rows[0].interrupts - none.rows[0].interrupts == 2 * 11 * 94
    for wrong in (-1.0, math.nan, math.inf):
        with pytest.raises(UserError, match="edges per second: a number of 0 or more"):
            check(board, edges_per_s=wrong)


def test_a_full_bus_brings_as_many_frames_as_the_wire_can_carry(robot):
    # 111 bits at 3 Mbit/s are 37 us: 13 whole frames in 0.5 ms, and one whose end falls into it
    assert check(robot.board("MCH"), full_bus=True).frames == {"can1": 14}
    assert check(robot.board("MCH")).frames["can1"] < 14


@pytest.mark.parametrize("name", BOARD_CLASSES)
def test_every_listened_source_has_a_number_of_services_with_its_reason(robot, name):
    for each in check(robot.board(name)).interrupts:
        assert each.why and (each.times > 0 or each.name in ("can_error", "can error"))


@pytest.mark.parametrize("name", BOARD_CLASSES)
def test_no_run_goes_beyond_what_is_possible(name):
    """The oracle is the emulator itself. The first slots are not usual: the main brain sends every command once."""
    with contextlib.closing(Ranger()) as robot:
        bound = check(robot.board(name))
        robot.run_for(0.1)
        view = robot.slots(name)
        robot.run_for(0.6)
        possible = {each.name: each.worst for each in bound.functions}
        for function, ran in view.functions.items():
            assert ran.most <= possible[function], function
        for row in bound.rows:
            if len(view.of_row(row.row)):
                assert view.of_row(row.row).worst().cycles <= row.worst + row.interrupts
        most = {each.name: (each.times, each.cycles) for each in bound.interrupts}
        for slot in view:
            counted = {}
            for ran in slot.interrupts:
                counted[ran.name] = counted.get(ran.name, 0) + 1
                assert ran.cycles <= most[ran.name][1], ran.name
            for source, times in counted.items():
                assert times <= most[source][0], source


def test_the_robots_figures_are_of_functions_that_our_tables_have(robot):
    for name, functions in robot_figures.INSTRUCTIONS.items():
        assert functions.keys() <= {task.name for task in robot.board(name).legend().tasks}
    assert robot_figures.cycles_of("MCH", "motor_encoder_rezero") == (7080, 7520)
    assert robot_figures.cycles_of("MCH", "can_transmit") is None
    assert robot_figures.cycles_of("CSR", "send_time") is None
    assert static_check.MOTOR_GEAR.keys() == {wire.board for wire in wiring.ENCODERS}


def test_a_task_that_a_user_put_in_is_checked_as_it_is_now():
    with contextlib.closing(Ranger()) as robot:
        before = check(robot.board("MCH")).rows[0].worst
        robot.replace("MCH", "mc_compliant_control", lambda: None, cost=20_000, limit=22_100)
        after = check(robot.board("MCH"))
        assert after.rows[0].worst == before + 20_000 and after.rows[0].verdict == OVERRUNS
    assert isinstance(Task(lambda: None), Task)
