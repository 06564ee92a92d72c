"""Observations of a walk in addition to its events (plant/walking/watch.py): extremes, times, limits of a fall."""

import math

import cython


@cython.final
@cython.cclass
class Observed:
    """Restarts when the robot is let go; read by plant/walking/watch.py, the summary of a walk, and tests."""

    foothold_due: cython.bint
    brushing: cython.bint
    passing_gap: cython.double
    scuff_time_s: cython.double
    brush_s: cython.double
    released_s: cython.double
    friction_ratio_max: cython.double
    slip_s: cython.double
    normal_force_min: cython.double
    pull_s: cython.double
    fall_lean: cython.double
    fall_height: cython.double
    fall_split: cython.double
    stall_s: cython.double

    def __init__(self) -> None:
        self.foothold_due = False  # the swing foot has not passed the stance foot yet
        self.brushing = False  # the swing foot's sole is on the floor, and has been counted
        self.brush_s = 0.0  # s with the swing foot's sole on the floor
        self.scuff_time_s = -1.0
        self.passing_gap = 1.0  # m, lowest clearance while the swing foot passes
        self.friction_ratio_max = 0.0  # worst |F_x| / F_y of the walk
        self.slip_s = 0.0  # s that a foot slides, or needs more than the floor's friction
        self.normal_force_min = math.inf  # N, lowest of a standing foot; below 0 a pull that lift-off could not answer
        self.pull_s = 0.0  # s with a pull of more than 1 N
        self.released_s = 0.0  # when the robot was let go, or made its last step
        # the fall rules, see EQUATIONS 16
        self.fall_lean = 0.6  # rad
        self.fall_height = 0.65  # of the leg length
        self.fall_split = 1.2  # rad between the legs
        self.stall_s = 3.0

    @cython.ccall
    def begin(self, time_s: cython.double) -> cython.void:
        """The robot is let go at this time of the body."""
        self.released_s = time_s
        self.foothold_due = True
        self.scuff_time_s = -1.0
        self.passing_gap = 1.0
        self.friction_ratio_max = 0.0
        self.slip_s = 0.0
        self.normal_force_min = math.inf
        self.pull_s = 0.0
        self.brushing = False
        self.brush_s = 0.0
