"""Record of a walk as seen from outside: counts, last values and sums; memory does not grow with the walk."""

import array
from typing import Any

RING = 4096  # strikes kept for later drawing; chosen by us: 41 minutes of walking, 160 kB


class WalkRecord:
    """Strikes, lift-offs, distances and oddities of one walk. Times are ns since power-up, lengths m.

    A step is counted when a foot meets the floor ahead of the other one, in turn. `step_length_m` is its gain: the
    distance of this foot's contact point from the previous strike's. The first step counts from the place where the
    robot was put down. `touches` and `lift_offs` count all of them.

    Oddities: `bounces` (the leading foot left the floor and returned), `recontacts` (a foot touched out of turn),
    `brushes` and `scuffs` (the swing foot's sole touched the floor before, after it passed the stance foot), `flights`
    (no foot on the floor), `slides` (a standing foot began to slide), `jams` (it could not: impulses stopped it),
    `lead_lifts`, `tensile_strikes` (the rule of the strike required a pull on the trailing foot; `tensile_impulse_Ns`
    the last, `_min_Ns` the worst).

    More than 40 fields, because each of them is one figure of the summary and they are counted by the same few events.
    """

    def __init__(self) -> None:
        self.strike_times_ns = array.array("q", [0]) * RING
        self.strike_durations_ns = array.array("q", [0]) * RING
        self.strike_legs = array.array("q", [0]) * RING
        self.strike_lengths_m = array.array("d", [0.0]) * RING
        self.strike_xs_m = array.array("d", [0.0]) * RING
        self.strike_heights_m = array.array("d", [0.0]) * RING
        self.begin(0, 0.0)

    def begin(self, time_ns: int, contact_x: float) -> None:
        """Reset the record: the robot is put down at `contact_x`."""
        self.begin_ns = time_ns
        self.start_x = contact_x
        self.last_x = contact_x
        self.steps = 0
        self.strike_time_ns = time_ns
        self.strike_leg = -1
        self.touch_time_ns = -1
        self.lift_off_time_ns = -1
        self.step_length_m = 0.0
        self.step_time_ns = 0
        self.distance_m = 0.0
        self.double_stance_ns = 0
        self.clearance_m = 0.0
        self.min_clearance_m = 1.0
        self.strike_foot_rad = 0.0
        self.impulse_stance = (0.0, 0.0)
        self.impulse_swing = (0.0, 0.0)
        self.strike_loss_J = 0.0
        self.tensile_impulse_Ns = 0.0
        self.tensile_impulse_min_Ns = 0.0
        self.tensile_strikes = 0
        self.touches = 0
        self.lift_offs = 0
        self.bounces = 0
        self.recontacts = 0
        self.brushes = 0
        self.scuffs = 0
        self.flights = 0
        self.slides = 0
        self.jams = 0
        self.lead_lifts = 0
        self.fell = False
        self.fall_cause = ""
        self.fall_time_ns = -1
        # sums from the 6th step on, for means and deviations (the first five steps are the start)
        self.counted = 0
        self.length_sum = 0.0
        self.length_squares = 0.0
        self.time_sum_s = 0.0
        self.time_squares = 0.0
        self.double_stance_sum_s = 0.0

    def touch(
        self,
        time_ns: Any,
        leg: int,
        strike: Any,
        ahead: Any,
        x: Any,
        foot_rad: Any,
        impulses: Any,
        loss_J: float,
        double: Any,
        gap: Any,
        height: Any,
    ) -> None:
        """A foot met the floor. `impulses`: stance x, y, swing x, y in N s; `gap`: lowest clearance at passing;
        `height`: of the foothold."""
        self.touch_time_ns = time_ns
        self.touches += 1
        if not strike:
            if leg == self.strike_leg and ahead > 0.0:
                self.bounces += 1
            else:
                self.recontacts += 1
            return
        self.impulse_stance = impulses[:2]
        self.impulse_swing = impulses[2:]
        self.strike_loss_J = loss_J
        if double and impulses[1] < 0.0:
            self.tensile_strikes += 1
            self.tensile_impulse_Ns = impulses[1]
            self.tensile_impulse_min_Ns = min(self.tensile_impulse_min_Ns, impulses[1])
        self.step_length_m = x - self.last_x
        self.step_time_ns = time_ns - self.strike_time_ns
        self.distance_m = x - self.start_x
        self.last_x = x
        self.strike_times_ns[self.steps % RING] = time_ns
        self.strike_durations_ns[self.steps % RING] = self.step_time_ns
        self.strike_legs[self.steps % RING] = leg
        self.strike_lengths_m[self.steps % RING] = self.step_length_m
        self.strike_xs_m[self.steps % RING] = x
        self.strike_heights_m[self.steps % RING] = height
        self.strike_time_ns = time_ns
        self.strike_leg = leg
        self.strike_foot_rad = foot_rad
        self.clearance_m = gap
        if self.steps > 0:  # the first step starts anywhere in the swing
            self.min_clearance_m = min(self.min_clearance_m, gap)
        self.steps += 1
        if self.steps > 5:
            seconds = self.step_time_ns * 1e-9
            self.counted += 1
            self.length_sum += self.step_length_m
            self.length_squares += self.step_length_m * self.step_length_m
            self.time_sum_s += seconds
            self.time_squares += seconds * seconds

    def brush(self, passed: Any) -> None:
        """The swing foot's sole touched the floor, before or after it passed the stance foot."""
        if passed:
            self.scuffs += 1
        else:
            self.brushes += 1

    def leave(self, time_ns: int, leg: int, flight: Any) -> None:
        """A foot left the floor, other than by a strike of the other one."""
        self.lift_offs += 1
        if flight:
            self.flights += 1
        if leg == self.strike_leg:
            self.lead_lifts += 1
        elif self.steps > 0 and self.lift_off_time_ns < self.strike_time_ns:
            self.lift_off_time_ns = time_ns
            self.double_stance_ns = time_ns - self.strike_time_ns
            if self.steps > 5:
                self.double_stance_sum_s += self.double_stance_ns * 1e-9

    def fall(self, time_ns: int, cause: str) -> None:
        self.fell = True
        self.fall_cause = cause
        self.fall_time_ns = time_ns

    def mean_step_length_m(self) -> float | None:
        """Mean without the first five steps; None without others, as for all these figures."""
        return self.length_sum / self.counted if self.counted else None

    def mean_step_time_s(self) -> float | None:
        return self.time_sum_s / self.counted if self.counted else None

    def mean_double_stance_s(self) -> float | None:
        return self.double_stance_sum_s / self.counted if self.counted else None

    def step_length_deviation_m(self) -> float | None:
        """Standard deviation of the step length without the first five steps; None for fewer than two others."""
        return self._deviation(self.length_sum, self.length_squares)

    def step_time_deviation_s(self) -> float | None:
        return self._deviation(self.time_sum_s, self.time_squares)

    def _deviation(self, total: float, squares: float) -> float | None:
        if self.counted < 2:
            return None
        mean = total / self.counted
        return max(0.0, squares / self.counted - mean * mean) ** 0.5
