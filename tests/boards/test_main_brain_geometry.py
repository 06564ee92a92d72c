"""The floor-reset geometry against the exact pose of two round feet on a level floor."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.boards.main_brain.geometry import FloorGeometry

ROBOT = (0.23, 0.176, 0.168, 0.114)  # inner radius, ankle to centre; outer
APPENDIX = (0.2, 0.11, 0.2, 0.11)
RANGER = (0.2, 0.146, 0.2, 0.146)


def geometry(feet):
    floor = FloorGeometry()
    floor.inner_radius_m, floor.inner_ankle_m, floor.outer_radius_m, floor.outer_ankle_m = feet
    return floor


def height_difference(feet, outer_leg, hip, outer_ankle, inner_ankle):
    """Hip height over the outer foot's contact less that over the inner foot's; 0 on a level floor."""
    inner_radius, inner_centre, outer_radius, outer_centre = feet
    inner_leg = outer_leg - hip
    over_outer = outer_radius - outer_centre * math.cos(outer_leg + outer_ankle) + 0.96 * math.cos(outer_leg)
    over_inner = inner_radius - inner_centre * math.cos(inner_leg + inner_ankle) + 0.96 * math.cos(inner_leg)
    return over_outer - over_inner


@pytest.mark.parametrize("feet", [ROBOT, APPENDIX, RANGER])
@given(
    hip=st.floats(0.1, 0.6),
    inner_ahead=st.booleans(),
    outer_ankle=st.floats(-0.5, 0.8),
    inner_ankle=st.floats(-0.5, 0.8),
)
def test_the_solved_pose_puts_both_feet_on_one_level(feet, hip, inner_ahead, outer_ankle, inner_ankle):
    floor = geometry(feet)
    hip = hip if inner_ahead else -hip
    if not floor.solve(hip, outer_ankle, inner_ankle):
        return
    outer_leg = floor.rear_leg if inner_ahead else floor.front_leg
    # the formula is exact; only rounding remains
    assert abs(height_difference(feet, outer_leg, hip, outer_ankle, inner_ankle)) < 1e-12
    front_ankle, rear_ankle = (inner_ankle, outer_ankle) if inner_ahead else (outer_ankle, inner_ankle)
    assert floor.front_foot == pytest.approx(floor.front_leg + front_ankle, abs=1e-15)
    assert floor.rear_foot == pytest.approx(floor.rear_leg + rear_ankle, abs=1e-15)
    assert floor.rear_leg - floor.front_leg == pytest.approx(abs(hip), abs=1e-15)
    assert floor.ankle_distance_m == pytest.approx(1.92 * math.sin(abs(hip) / 2.0), abs=1e-15)


def test_equal_feet_held_alike_stand_symmetrically():
    floor = geometry(APPENDIX)
    # with equal foot angles to the floor both ankles are equally high, so the legs lean alike: a = F - leg
    assert floor.solve(0.4, 0.25 - 0.2, 0.25 + 0.2)
    assert (floor.rear_leg, floor.front_leg) == pytest.approx((0.2, -0.2), abs=1e-15)
    assert floor.ankle_distance_m == pytest.approx(1.92 * math.sin(0.2), abs=1e-15)


def test_feet_side_by_side_have_no_pose():
    assert not geometry(APPENDIX).solve(0.04, 0.0, 0.0)
    assert not geometry(APPENDIX).solve(-0.04, 0.0, 0.0)
