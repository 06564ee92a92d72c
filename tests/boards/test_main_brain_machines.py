"""Leg, hip, foot and steering machines: what each state commands and what ends it (record parameters)."""

import pytest

from ranger_sim.boards.main_brain.command import variables_of
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import mb as table
from tests.boards.main_brain_bench import Bench

OFF = (0.0, 0.0, 0.0)


def close(command):
    """Single-precision words: seven digits."""
    return pytest.approx(command, rel=1e-6, abs=1e-6)


@pytest.fixture
def bench():
    return in_walk(Bench())


def in_walk(bench):
    """Walk mode entered, with estimates given by hand from now on; robot as in the start pose."""
    bench.set(E_SWING_LEG=1, MCH_ANGLE=0.35, MCFI_MOTOR_POSITION=2.1, MCFO_MOTOR_POSITION=1.8)
    bench.machines_only(UI_BUTTONS=2)
    bench.machines_only(UI_BUTTONS=0)
    return bench


def inner_strike(bench):
    bench.machines_only(E_SWING_LEG=0, E_T_AFTER_HS=0, E_LO_ANGLE=0.18, E_LI_ANGLE=-0.18, MCH_ANGLE=0.36)


def inner_stance_premid(bench):
    """Inner struck at A = 0.18; the outer foot flips up 40 ms later at A = 0.15."""
    inner_strike(bench)
    for _ in range(19):
        bench.machines_only()
    bench.machines_only(E_T_AFTER_HS=40, E_LI_ANGLE=-0.15, MCH_ANGLE=0.30, MCFO_RIGHT_ANKLE_RATE=-6.0)
    bench.set(MCFO_RIGHT_ANKLE_RATE=0.0)


def inner_stance_aftermid(bench, **values):
    inner_stance_premid(bench)
    bench.machines_only(E_T_AFTER_HS=340, E_LI_ANGLE=0.001, E_LO_ANGLE=-0.099, MCH_ANGLE=-0.10, **values)
    bench.machines_only()  # the hip machine sees the leg machine's new state one slot later


# --- leg machine --------------------------------------------------------------------------------------


def test_all_machines_begin_in_their_start_states(bench):
    assert bench.states() == ("walk", "LO_aftermid", "HI_starthold", "startflipdown", "startstance", "front")
    # presets of the walk's beginning
    assert bench.get("E_AM_L_ABSRATE") == pytest.approx(0.5)
    assert bench.get("E_AM_H_RATE") == pytest.approx(1.66)
    assert bench.get("FSM_RESET") == 2


def test_the_leg_machine_goes_round_in_the_order_of_a_stride(bench):
    seen = []

    def note(**values):
        bench.machines_only(**values)
        seen.append(bench.states()[1])

    note()
    note(E_SWING_LEG=0, E_T_AFTER_HS=0, E_LO_ANGLE=0.2, E_LI_ANGLE=-0.2, MCH_ANGLE=0.4)
    note(E_T_AFTER_HS=30, MCFO_RIGHT_ANKLE_RATE=-5.1)
    note(E_T_AFTER_HS=300, MCFO_RIGHT_ANKLE_RATE=0.0, E_LI_ANGLE=0.01, MCH_ANGLE=-0.1)
    note(E_SWING_LEG=1, E_T_AFTER_HS=0, E_LI_ANGLE=0.2, E_LO_ANGLE=-0.2, MCH_ANGLE=-0.4)
    note(E_T_AFTER_HS=30, MCFI_ANKLE_RATE=-5.1)
    note(E_T_AFTER_HS=300, MCFI_ANKLE_RATE=0.0, E_LO_ANGLE=0.01, MCH_ANGLE=0.1)
    assert seen == [
        "LO_aftermid",
        "LI_preswing",
        "LI_premid",
        "LI_aftermid",
        "LO_preswing",
        "LO_premid",
        "LO_aftermid",
    ]


def test_a_flip_rate_of_exactly_the_limit_does_not_end_double_stance(bench):
    inner_strike(bench)
    bench.machines_only(MCFO_RIGHT_ANKLE_RATE=-5.0)
    assert bench.states()[1] == "LI_preswing"


def test_mid_stance_figures_are_differences_averaged_over_both_legs(bench):
    inner_stance_aftermid(bench)
    # the outer legs' share are the presets:
    # v = (1000 * 0.15 / 300 + 0.5) / 2; alpha = (-h + 0) / 2; omega = ((0 - (-0.30)) * 1000 / 300 + 1.66) / 2
    assert bench.get("E_AM_L_ABSRATE") == pytest.approx(0.5 * (0.5 + 0.5), rel=1e-6)
    assert bench.get("E_AM_H_ANG") == pytest.approx(0.5 * (0.10 + 0.0), rel=1e-6)
    assert bench.get("E_AM_H_RATE") == pytest.approx(0.5 * ((0.0 + 0.30) * 1000.0 / 300.0 + 1.66), rel=1e-6)
    assert bench.get("E_AM_TIME") == pytest.approx(150.0)
    assert bench.get("E_PS_TIME") == pytest.approx(40.0)
    # rate during double stance: (0.18 - 0.15) * 1000 / 40, averaged with the other leg's 0
    assert bench.get("E_SS_L_ABSRATE") == pytest.approx(0.5 * 0.03 * 1000.0 / 40.0, rel=1e-5)


def second_stride_omega(quirks):
    bench = in_walk(Bench(quirks=quirks))
    inner_stance_aftermid(bench)
    bench.machines_only(E_SWING_LEG=1, E_T_AFTER_HS=0, E_LO_ANGLE=-0.2, E_LI_ANGLE=0.2, MCH_ANGLE=-0.4)
    bench.machines_only(E_T_AFTER_HS=40, MCFI_ANKLE_RATE=-6.0, MCH_ANGLE=-0.32)
    bench.machines_only(E_T_AFTER_HS=240, MCFI_ANKLE_RATE=0.0, E_LO_ANGLE=0.001, MCH_ANGLE=0.08)
    outer_first = bench.modes.leg.outer.mid_hip_rate
    bench.machines_only(E_SWING_LEG=0, E_T_AFTER_HS=0, E_LI_ANGLE=-0.2, E_LO_ANGLE=0.2, MCH_ANGLE=0.4)
    bench.machines_only(E_T_AFTER_HS=40, MCFO_RIGHT_ANKLE_RATE=-6.0, MCH_ANGLE=0.32)
    bench.machines_only(E_T_AFTER_HS=240, MCFO_RIGHT_ANKLE_RATE=0.0, E_LI_ANGLE=0.001, MCH_ANGLE=-0.06)
    return outer_first, bench.modes.leg.inner.mid_hip_rate


def test_the_hip_rate_uses_the_angle_of_the_same_legs_previous_mid_stance():
    outer, inner = second_stride_omega(Quirks())
    assert outer == pytest.approx((0.0 + 0.32) * 1000.0 / 200.0, rel=1e-6)  # no previous one
    assert inner == pytest.approx((0.10 + 0.32) * 1000.0 / 200.0, rel=1e-6)  # 0.10 of the first stride


def test_by_switch_the_hip_rate_uses_the_present_angle():
    outer, inner = second_stride_omega(Quirks(hip_mid_rate_of_previous_step=False))
    assert outer == pytest.approx((0.08 + 0.32) * 1000.0 / 200.0, rel=1e-6)
    assert inner == pytest.approx((0.06 + 0.32) * 1000.0 / 200.0, rel=1e-6)


@pytest.mark.parametrize("angle, published", [(-1.5, 1.5), (0.9, 0.01)])
def test_the_mid_stance_rate_is_kept_between_001_and_15(bench, angle, published):
    inner_strike(bench)
    bench.machines_only(E_T_AFTER_HS=40, E_LI_ANGLE=angle, MCFO_RIGHT_ANKLE_RATE=-6.0)
    bench.machines_only(E_T_AFTER_HS=340, E_LI_ANGLE=0.001)
    assert bench.get("E_AM_L_ABSRATE") == pytest.approx(published)


def test_after_an_early_strike_leg_and_hip_machine_stay_in_premid(bench):
    inner_stance_premid(bench)
    bench.machines_only(E_SWING_LEG=1, E_T_AFTER_HS=0, E_LI_ANGLE=-0.02, MCH_ANGLE=-0.1)
    assert bench.states()[1:3] == ("LI_premid", "HO_premid")


def test_mid_stance_soon_after_an_early_strike_is_taken_for_the_slowest(bench):
    inner_stance_premid(bench)  # single stance since 40 ms after the last strike
    bench.machines_only(E_SWING_LEG=1, E_T_AFTER_HS=0, E_LI_ANGLE=-0.02, MCH_ANGLE=-0.1)
    bench.machines_only(E_T_AFTER_HS=20, E_LI_ANGLE=0.001)
    assert bench.states()[1] == "LI_aftermid"
    # -20 ms: 0.15 rad in front of vertical give -7.5 rad/s
    assert bench.modes.leg.inner.mid_rate == pytest.approx(-7.5, rel=1e-6)
    assert bench.get("E_AM_L_ABSRATE") == pytest.approx(0.01)


def test_mid_stance_in_a_stopped_clock_does_not_divide_by_zero(bench):
    inner_strike(bench)
    bench.machines_only(E_T_AFTER_HS=40, E_LI_ANGLE=-0.15, MCFO_RIGHT_ANKLE_RATE=-6.0)
    bench.machines_only(E_T_AFTER_HS=40, E_LI_ANGLE=0.001)
    assert bench.get("E_AM_L_ABSRATE") == pytest.approx(1.5)


# --- hip machine ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("controller", ["record-2011", "reflex", "head-2015"])
def test_each_variable_of_a_machine_has_the_id_of_its_name(controller):
    bench = Bench(controller)
    modes = bench.modes
    for machine in (bench.estimator, modes, modes.leg, modes.hip, modes.inner_foot, modes.steering):
        names = variables_of(type(machine))
        assert names
        assert {name: getattr(machine, name) for name in names} == {name: getattr(table, name) for name in names}


def test_the_variables_of_the_hip_machine_are_its_48_fields_in_capitals(bench):
    names = variables_of(type(bench.modes.hip))
    assert len(names) == 48
    assert {"MCH_ANGLE", "DC3_H_AM_H_RATE2", "FSM_HIP"} <= set(names)


def test_the_start_hold_keeps_the_inner_legs_ahead(bench):
    assert bench.command("MCH") == close((30.0 * 0.35, 30.0, 3.0))


def test_the_hip_is_passive_in_double_stance(bench):
    inner_strike(bench)
    assert bench.states()[2] == "HO_preswing"
    assert bench.command("MCH") == OFF


@pytest.mark.parametrize("rate, current", [(0.0, -6.0), (-1.5, -1.5), (-2.0, 0.0), (-2.5, 0.0), (1.0, -9.0)])
def test_the_outer_swing_is_driven_towards_minus_two_rad_per_s_and_never_braked(bench, rate, current):
    inner_stance_premid(bench)
    bench.machines_only(E_MCH_ANG_RATE=rate)
    assert bench.states()[2] == "HO_premid"
    assert bench.command("MCH") == close((current, 2.0, 0.0))


def test_the_drive_of_the_swing_ends_300_ms_after_single_stance_began(bench):
    inner_stance_premid(bench)
    bench.machines_only(E_MCH_ANG_RATE=0.0, E_T_AFTER_HS=338)
    assert bench.command("MCH")[0] == close(-6.0)
    bench.machines_only(E_T_AFTER_HS=340)
    assert bench.command("MCH")[0] == 0.0


def test_the_inner_swing_is_the_mirror_without_the_outer_stiffness(bench):
    inner_stance_aftermid(bench, E_MCH_ANG_RATE=-1.0)
    bench.machines_only(E_SWING_LEG=1, E_T_AFTER_HS=0, E_LO_ANGLE=-0.2, E_LI_ANGLE=0.2, MCH_ANGLE=-0.4)
    assert bench.states()[2] == "HI_preswing"
    assert bench.command("MCH") == OFF
    bench.machines_only(E_T_AFTER_HS=40, MCFI_ANKLE_RATE=-6.0, E_MCH_ANG_RATE=0.5)
    assert bench.states()[2] == "HI_premid"
    assert bench.command("MCH") == close((3.0 * (2.0 - 0.5), 0.0, 0.0))


def slow_corrections(alpha, omega):
    return alpha + 0.3 * (omega - 1.66), 0.5 * alpha + 0.2 * (omega - 1.66)


def test_a_slow_mid_stance_corrects_by_the_slow_set_in_two_windows(bench):
    inner_stance_aftermid(bench, E_MCH_ANG_RATE=-5.0)  # beyond the target rate: no base current
    assert bench.states()[2] == "HO_aftermid"
    first, second = slow_corrections(bench.get("E_AM_H_ANG"), bench.get("E_AM_H_RATE"))
    currents = [bench.command("MCH")[0]]
    for _ in range(160):
        bench.machines_only()
        currents.append(bench.command("MCH")[0])
    # the leg machine's timer reads 4 ms in the slot in which the hip follows: 73 slots below 150 ms, 75 below 300 ms
    assert currents[:73] == close([-first] * 73)
    assert currents[73:148] == close([-second] * 75)
    assert currents[148:] == [0.0] * 13


@pytest.mark.parametrize("mode", [0.0, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("v", [0.3, 0.64, 0.66, 1.0])
def test_the_correction_follows_mode_and_speed(bench, mode, v):
    bench.set(D_H_ON=mode, DC3_H_AM_L_ABSRATE1=4.0, DC3_H_AM_H_RATE2=0.5)
    bench.set(E_AM_L_ABSRATE=v, E_AM_H_ANG=0.1, E_AM_H_RATE=2.0)
    bench.modes.hip.enter_aftermid()
    slow = mode == 2.0 or (mode == 1.0 and v < 0.65)
    if mode == 0.0:
        expected = (0.0, 0.0)
    elif slow:
        expected = slow_corrections(0.1, 2.0)
    else:
        expected = (-2.0 * 0.1 - 4.0 * (v - 0.72), -1.0 * 0.1 - 0.5 * (2.0 - 1.66))
    assert (bench.get("E_H_DI1"), bench.get("E_H_DI2")) == pytest.approx(expected, abs=1e-6)


def test_the_hip_waits_for_the_leg_machine_at_mid_stance(bench):
    inner_stance_premid(bench)
    bench.modes.leg.machine.set_state("stop")
    bench.machines_only(E_LI_ANGLE=0.01)
    assert bench.states()[2] == "HO_premid"


@pytest.mark.parametrize(
    "angle, v, rate, held",
    [
        (-0.25, 0.3, -1.0, True),  # far ahead in a slow step
        (-0.25, 0.5, -1.0, False),
        (-0.25, 0.5, 0.1, True),  # on its way back
        (-0.35, 0.5, 0.1, False),  # beyond 0.3 rad it is let swing back
        (-0.35, 0.3, 0.1, True),
        (0.1, 0.3, 0.1, False),  # still behind
    ],
)
def test_the_emergency_hold_of_the_outer_legs(bench, angle, v, rate, held):
    inner_stance_premid(bench)
    bench.machines_only(MCH_ANGLE=angle, E_AM_L_ABSRATE=v, E_MCH_ANG_RATE=rate)
    assert (bench.states()[2] == "HO_ehold") is held
    if held:
        assert bench.command("MCH") == close((-30.0 * 0.35, 30.0, 4.0))
        bench.machines_only(E_SWING_LEG=1, E_T_AFTER_HS=0)
        assert bench.states()[2] == "HI_preswing"


def test_the_emergency_hold_of_the_inner_legs_is_the_mirror(bench):
    bench.modes.hip.machine.set_state("HI_premid")
    bench.machines_only(MCH_ANGLE=0.25, E_AM_L_ABSRATE=0.5, E_MCH_ANG_RATE=-0.1)
    assert bench.states()[2] == "HI_ehold"
    assert bench.command("MCH") == close((30.0 * 0.35, 30.0, 4.0))


def test_mid_stance_comes_before_the_emergency_hold_once_the_leg_machine_has_reported_it(bench):
    inner_stance_premid(bench)
    bench.machines_only(E_T_AFTER_HS=340, E_LI_ANGLE=0.001, MCH_ANGLE=-0.15, E_MCH_ANG_RATE=-0.1)
    assert bench.states()[1:3] == ("LI_aftermid", "HO_premid")  # one slot behind
    bench.machines_only(E_MCH_ANG_RATE=0.1)
    assert bench.states()[2] == "HO_aftermid"
    bench.machines_only()
    assert bench.states()[2] == "HO_ehold"


def test_the_hip_follows_the_leg_machine_to_mid_stance_one_slot_later(bench):
    inner_stance_premid(bench)
    seen = []
    for _ in range(2):
        bench.machines_only(E_T_AFTER_HS=340, E_LI_ANGLE=0.001, MCH_ANGLE=-0.10, E_MCH_ANG_RATE=-1.0)
        seen.append((*bench.states()[1:3], bench.get("FSM_LEG")))
    assert seen == [("LI_aftermid", "HO_premid", 1), ("LI_aftermid", "HO_aftermid", 2)]


# --- foot machines --------------------------------------------------------------------------------------


def test_the_start_states_of_the_feet_follow_the_hip_angle_only(bench):
    bench.machines_only(MCH_ANGLE=0.30)
    assert bench.command("MCFI") == close((1.5 * (2.0 + 0.15), 1.5, 0.1))
    assert bench.command("MCFO") == close((30.0 * (2.0 - 0.15), 30.0, 0.3))


def test_the_first_push_of_the_outer_feet_is_skipped(bench):
    inner_strike(bench)
    assert bench.states()[3:5] == ("stance", "flipup")
    assert bench.command("MCFO") == close((1.5 * 0.2, 1.5, 0.1))


def test_a_standing_foot_holds_its_angle_to_the_floor(bench):
    inner_strike(bench)
    bench.machines_only(MCFI_MOTOR_POSITION=1.9, E_FI_ABSANG=1.95)
    assert bench.command("MCFI") == close((4.0 * (2.0 + 1.9 - 1.95), 4.0, 0.2))


def inner_stance_ready_to_push(bench):
    inner_strike(bench)
    bench.machines_only(MCH_ANGLE=-0.3, E_ANKLE_HEIGHT=0.03, E_FO_ABSANG=1.8, E_FI_ABSANG=2.0)
    assert bench.states()[3] == "stance"


@pytest.mark.parametrize(
    "height, other_foot, hip, pushes",
    [
        (0.0119, 1.71, -0.06, True),
        (0.0121, 1.71, -0.06, False),  # swing ankle still high
        (0.0119, 1.69, -0.06, False),  # swing foot not down yet
        (0.0119, 1.71, -0.04, False),  # own leg not behind yet
    ],
)
def test_a_push_begins_low_with_the_other_foot_down_and_the_leg_behind(bench, height, other_foot, hip, pushes):
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_ANKLE_HEIGHT=height, E_FO_ABSANG=other_foot, MCH_ANGLE=hip)
    assert (bench.states()[3] == "prepush") is pushes


def test_a_strike_begins_the_push_in_any_case_and_counts_it_as_missed(bench):
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_SWING_LEG=1)
    assert bench.states()[3] == "prepush"
    assert bench.get("E_FI_PP_MISSED") == 1


def test_the_push_of_a_fast_step_is_the_plain_one(bench):
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_ANKLE_HEIGHT=0.01, E_AM_L_ABSRATE=0.66, MCFI_MOTOR_POSITION=1.9)
    assert bench.command("MCFI") == close((10.0 * (2.2 + 1.9 - 2.0), 10.0, 0.0))


def test_the_push_of_a_slow_step_is_stronger_and_longer(bench):
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_ANKLE_HEIGHT=0.01, E_AM_L_ABSRATE=0.52, MCFI_MOTOR_POSITION=1.9)
    stiffness = 10.0 + 5.0 * 0.2
    assert bench.command("MCFI") == close((stiffness * (2.2 + 0.1 + 1.9 - 2.0), stiffness, 0.0))
    # fixed at entry
    bench.machines_only(E_AM_L_ABSRATE=1.0)
    assert bench.command("MCFI")[1] == close(stiffness)


def test_by_switch_the_slow_correction_waits_for_the_strike():
    bench = in_walk(Bench(quirks=Quirks(push_correction_after_strike=True)))
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_ANKLE_HEIGHT=0.01, E_AM_L_ABSRATE=0.52)
    assert bench.command("MCFI")[1] == close(10.0)
    bench.machines_only(E_SWING_LEG=1)
    assert bench.command("MCFI")[1] == close(11.0)


def test_by_parameter_pushes_are_never_corrected(bench):
    bench.set(D_F_ON=0.0)
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_ANKLE_HEIGHT=0.01, E_AM_L_ABSRATE=0.1)
    assert bench.command("MCFI")[1] == close(10.0)


def pushing(bench):
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_ANKLE_HEIGHT=0.01, E_AM_L_ABSRATE=0.66)
    assert bench.states()[3] == "prepush"


def test_the_push_ends_after_the_strike_and_half_its_angle(bench):
    pushing(bench)
    bench.machines_only(E_FI_ABSANG=2.15)
    assert bench.states()[3] == "prepush"  # turned, but no strike
    for _ in range(14):
        bench.machines_only(E_FI_ABSANG=2.05)
    bench.machines_only(E_SWING_LEG=1)
    assert bench.states()[3] == "prepush"  # struck, but turned by 0.05 of 0.1 rad only
    assert bench.get("E_FI_PP2HS_TIME") == 32  # 16 slots from the entry to that of the strike
    bench.machines_only(E_FI_ABSANG=2.11)
    assert bench.states()[3] == "prepush"  # the turn is that of the last main action
    bench.machines_only()
    assert bench.states()[3] == "afterpush"
    assert bench.command("MCFI") == OFF


def test_how_far_to_push_is_fixed_when_the_push_begins(bench):
    pushing(bench)
    bench.machines_only(P_F_PP_F_TANG=0.5, E_FI_ABSANG=2.11, MCFI_MOTOR_POSITION=1.9)
    assert bench.command("MCFI") == close((10.0 * (2.0 + 0.2 + 1.9 - 2.11), 10.0, 0.0))
    bench.machines_only(E_SWING_LEG=1)
    assert bench.states()[3] == "afterpush"


@pytest.mark.parametrize("variant, turned, ends", [(False, 0.151, True), (True, 0.151, False), (True, 0.201, True)])
def test_the_variant_of_april_2011_counts_the_correction_twice_when_it_ends_a_push(variant, turned, ends):
    bench = in_walk(Bench(quirks=Quirks(push_correction_after_strike=variant)))
    inner_stance_ready_to_push(bench)
    bench.machines_only(E_ANKLE_HEIGHT=0.01, E_AM_L_ABSRATE=0.52)  # 0.1 rad more
    # half of 0.2 + 0.1 rad, or of 0.2 + 0.1 + 0.1 rad
    for _ in range(3):
        bench.machines_only(E_SWING_LEG=1, E_FI_ABSANG=2.0)
    bench.machines_only(E_FI_ABSANG=2.0 + turned)
    assert bench.states()[3] == "prepush"
    bench.machines_only()
    assert (bench.states()[3] == "afterpush") is ends


def limp(bench):
    pushing(bench)
    bench.machines_only(E_SWING_LEG=1, E_FI_ABSANG=2.2, MCFI_MOTOR_POSITION=2.1, MCFI_MID_ANKLE_ANGLE=2.0)
    bench.machines_only()
    assert bench.states()[3] == "afterpush"


def test_flip_up_waits_until_the_cable_is_slack_enough(bench):
    limp(bench)
    bench.machines_only(MCFI_MID_ANKLE_ANGLE=2.02)
    assert bench.states()[3] == "afterpush"
    bench.machines_only(MCFI_MID_ANKLE_ANGLE=2.035)
    assert bench.states()[3] == "flipup"
    assert bench.command("MCFI") == close((1.5 * 0.2, 1.5, 0.1))


def test_flip_up_waits_for_30_ms_at_most(bench):
    limp(bench)
    slots = 0
    while bench.states()[3] == "afterpush":
        bench.machines_only()
        slots += 1
    assert slots == 15


def test_a_foot_flips_down_when_its_leg_is_ahead_and_stands_after_its_strike(bench):
    limp(bench)
    bench.machines_only(MCFI_MID_ANKLE_ANGLE=2.1)
    bench.machines_only(MCH_ANGLE=0.09)
    assert bench.states()[3] == "flipup"
    bench.machines_only(MCH_ANGLE=0.11, MCFI_MOTOR_POSITION=0.3, E_FI_ABSANG=0.4)
    assert bench.states()[3] == "flipdown"
    assert bench.command("MCFI") == close((1.5 * (2.0 + 0.3 - 0.4), 1.5, 0.1))
    bench.machines_only(E_SWING_LEG=0)
    assert bench.states()[3] == "stance"


def test_the_outer_foot_is_the_mirror_of_the_inner_one(bench):
    bench.modes.outer_foot.machine.set_state("stance")
    bench.set(E_SWING_LEG=1, E_ANKLE_HEIGHT=0.011, E_FI_ABSANG=1.8, E_FO_ABSANG=2.0, MCFO_MOTOR_POSITION=1.9)
    bench.machines_only(MCH_ANGLE=0.04, E_AM_L_ABSRATE=0.7)
    assert bench.states()[4] == "stance"
    bench.machines_only(MCH_ANGLE=0.06)
    assert bench.states()[4] == "prepush"
    assert bench.command("MCFO") == close((10.0 * (2.2 + 1.9 - 2.0), 10.0, 0.0))
    bench.machines_only(E_SWING_LEG=0, E_FO_ABSANG=2.2, MCFO_RIGHT_ANKLE_ANGLE=1.9)
    bench.machines_only()
    assert bench.states()[4] == "afterpush"
    bench.machines_only()
    assert bench.states()[4] == "flipup"
    bench.machines_only(MCH_ANGLE=-0.11)
    assert bench.states()[4] == "flipdown"
    bench.machines_only(E_SWING_LEG=1)
    assert bench.states()[4] == "stance"


# --- steering -------------------------------------------------------------------------------------------


def steer_through_a_stride(bench, width):
    """Duty counts sent in front, stance, back, swing, front again and stance again."""
    sent = []
    for values in (
        {"MCH_ANGLE": 0.3, "E_SWING_LEG": 1},
        {"E_SWING_LEG": 0},
        {"MCH_ANGLE": 0.05},
        {"E_SWING_LEG": 1, "MCH_ANGLE": -0.3},
        {"MCH_ANGLE": -0.05},
        {"MCH_ANGLE": 0.3},
        {"E_SWING_LEG": 0},
    ):
        bench.machines_only(UI_RC_0=width, **values)
        sent.append((bench.states()[5], bench.get("MCSI_COMMAND_CURRENT")))
    return sent


def test_a_turned_stick_twists_one_way_in_the_air_and_the_other_on_the_ground(bench):
    sent = steer_through_a_stride(bench, 97_500.0)  # 4e-5 * 97500 - 3.4 = 0.5
    assert sent == [
        ("front", 0.0),
        ("stance", 0.0),
        ("back", 0.0),
        ("swing", pytest.approx(37.5, abs=1e-4)),
        ("front", pytest.approx(37.5, abs=1e-4)),
        ("front", pytest.approx(37.5, abs=1e-4)),
        ("stance", pytest.approx(-37.5, abs=1e-4)),
    ]
    assert bench.get("MCSI_SHUTDOWN") == 0


@pytest.mark.parametrize("width, command", [(0.0, 0.0), (85_000.0, 0.0), (1e6, 1.0), (60_000.0, -1.0)])
def test_the_stick_is_centred_at_85000_clipped_and_straight_when_the_radio_is_silent(bench, width, command):
    bench.set(UI_RC_0=width)
    assert bench.modes.steering.radio_command() == pytest.approx(command, abs=1e-9)


def test_within_the_dead_band_the_motor_gets_no_duty_and_by_parameter_is_not_shut_down(bench):
    bench.set(D_S_SHUT_DOWN=0.0)
    sent = steer_through_a_stride(bench, 85_400.0)  # 0.016
    assert {counts for _, counts in sent} == {0.0}
    assert bench.get("MCSI_SHUTDOWN") == 0


def test_in_the_record_walks_set_the_dead_band_shuts_the_motor_down_as_on_the_robot(bench):
    assert bench.get("D_S_SHUT_DOWN") == 1.0
    steer_through_a_stride(bench, 85_000.0)
    assert bench.get("MCSI_SHUTDOWN") == 1
    steer_through_a_stride(bench, 97_500.0)
    assert bench.get("MCSI_SHUTDOWN") == 0


def test_within_the_dead_band_the_count_goes_on_being_sent_to_a_motor_that_is_shut_down(bench):
    sent = steer_through_a_stride(bench, 85_250.0)  # 0.01 of 75 counts
    assert [counts for state, counts in sent if state == "swing"] == [pytest.approx(0.75, abs=1e-4)]
    assert sent[-1][1] == pytest.approx(-0.75, abs=1e-4)
    assert bench.get("MCSI_SHUTDOWN") == 1


def test_the_dead_band_ends_where_its_limit_is_reached(bench):
    bench.set(P_S_RC_DEADBAND=0.5)
    steer_through_a_stride(bench, 97_500.0)  # 0.5
    assert bench.get("E_RC_STEER") == 0.5
    assert bench.get("MCSI_SHUTDOWN") == 0
