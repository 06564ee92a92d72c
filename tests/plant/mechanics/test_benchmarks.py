"""The appendix's section 6 and the running plant's own accuracy."""

import numpy as np
import pytest

from tests.plant.mechanics import benchmarks as bm


@pytest.fixture(scope="module")
def wheel():
    return bm.fixed_point(bm.wheel_step, (0.5, -0.45))


@pytest.fixture(scope="module")
def walker():
    return bm.fixed_point(bm.simplest_step, (0.2003, -0.1998, 0.4006, -0.0158))


def test_the_rimless_wheel_rolls_as_its_analytic_solution(wheel):
    assert wheel == pytest.approx(bm.WHEEL_FIXED_POINT, abs=1e-12)


def test_the_rimless_wheel_has_its_analytic_eigenvalue(wheel):
    J = bm.jacobian(bm.wheel_step, wheel, 1e-5)
    # truncation h^2 = 1e-10 times third derivatives of order 1
    assert bm.largest_eigenvalue(J).real == pytest.approx(bm.WHEEL_EIGENVALUE, abs=2e-10)


def test_the_simplest_walker_has_the_published_fixed_point(walker):
    assert walker == pytest.approx(bm.SIMPLEST_FIXED_POINT, abs=1e-11)


def test_the_simplest_walker_has_the_published_eigenvalues(walker):
    """The appendix differentiates with steps of 1e-5, whose truncation is 2e-7: same digits by the same method."""
    found = bm.largest_eigenvalue(bm.jacobian(bm.simplest_step, walker, 1e-5))
    # fixed points agree to 1e-13, divided by the step: 1e-8; plus the truncation's own change, below 1e-9
    assert found == pytest.approx(bm.SIMPLEST_EIGENVALUE, abs=2e-9)
    appendix = complex(-0.190106213101483, 0.557586570259502)
    assert abs(found - appendix) < 3e-8  # noise of differences whose map is good to 1e-13


def test_the_true_eigenvalue_is_the_one_without_truncation(walker):
    found = bm.largest_eigenvalue(bm.richardson(bm.simplest_step, walker, 2e-4))
    # h^4 truncation left by one extrapolation at 2e-4, measured against Richardson of robot.md P2: 3e-8
    assert found == pytest.approx(bm.SIMPLEST_EIGENVALUE_TRUE, abs=6e-8)
    assert abs(found - bm.SIMPLEST_EIGENVALUE) > 1e-7


def test_only_two_directions_of_the_simplest_walker_survive_a_step(walker):
    values = np.abs(np.linalg.eigvals(bm.jacobian(bm.simplest_step, walker, 1e-5)))
    # q1 and q3 after a strike are bound, and q3' follows q1': two eigenvalues are zero up to difference noise
    assert sorted(values)[:2] == pytest.approx([0.0, 0.0], abs=1e-4)
