"""Windings and bridges against their equations (EQUATIONS 10), integrated by scipy over what the bridge is at any time.

The bridge's state follows from the list of everything that was ever written to it: no queue, no state.
"""

import dataclasses
import math

import pytest
from scipy.integrate import solve_ivp

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.electrics.drive import DRIVEN, HELD_HIGH, HELD_LOW, HELD_OPEN, Drive
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, HIP_MOTOR, STEERING_MOTOR
from ranger_sim.plant.electrics.motor_unit import MotorUnit

STEP = 250_000
NEVER = 1 << 62


class Written:
    """All changes of one bridge, and what it is at a time by the last of each kind."""

    def __init__(self, watchdog_ns=10_000_000):
        self.watchdog_ns = watchdog_ns
        self.pwm, self.sides, self.edges = [(-1, (0, 0, 600))], [(-1, (True, True))], []
        self.held = {2: DRIVEN, 6: DRIVEN}

    def last(self, listed, time):
        return max((entry for entry in enumerate(listed) if entry[1][0] <= time), key=lambda e: (e[1][0], e[0]))[1][1]

    def powered(self, time):
        return any(edge <= time < edge + self.watchdog_ns for edge in self.edges)

    def at(self, time, held=True):
        """(duty, open, leads that switch, whether lead 2 does) at a time."""
        *match, period = self.last(self.pwm, time)
        conducts = self.powered(time) and all(self.last(self.sides, time))
        for place, leg in enumerate((2, 6)):
            if held and self.held[leg] != DRIVEN:
                conducts = conducts and self.held[leg] != HELD_OPEN
                match[place] = period if self.held[leg] == HELD_HIGH else 0
        if not conducts or period <= 0:
            return 0.0, not conducts, 0, False
        shares = [min(max(each / period, 0.0), 1.0) for each in match]
        switching = [0.0 < share < 1.0 for share in shares]
        return shares[0] - shares[1], False, sum(switching), switching[0]

    def changes(self, begin, end):
        """Times after `begin` and up to `end` at which it may change."""
        times = [time for time, _ in self.pwm + self.sides] + self.edges
        times += [edge + self.watchdog_ns for edge in self.edges]
        return sorted({time for time in times if begin < time < end} | {end})

    def matters(self, time):
        """Whether something is written or the power goes or comes at one of these times."""
        return any(time == when for when, _ in self.pwm + self.sides) or self.powered(time) != self.powered(time - 1)

    def losses(self, time):
        """How often it has lost its power up to a time."""
        ends = {edge + self.watchdog_ns for edge in self.edges if edge + self.watchdog_ns <= time}
        return sum(not self.powered(end) for end in ends)


def random_change(stream, written, drive, now):
    """One change within 0.4 ms from now on, in both."""
    time = now + 1 + stream.integer(8) * 50_000
    kind = stream.integer(10)
    if kind < 5:
        period = (600, 600, 480, 480, 0 if stream.integer(3) == 0 else 600)[kind]
        match = [(-5, 0, period, period + 9, *[stream.integer(600) for _ in range(4)])[stream.integer(8)] for _ in "26"]
        written.pwm.append((time, (*match, period)))
        drive.write_pwm(time, *match, period)
    elif kind < 7:
        sides = stream.integer(6) > 0, stream.integer(6) > 0
        written.sides.append((time, sides))
        drive.low_side(time, *sides)
    elif max(written.edges, default=now) <= now:  # a board's edges are milliseconds apart: one at most is still to come
        written.edges.append(time)
        drive.watchdog_edge(time)


def seen(drive):
    return drive.duty, drive.is_open, drive.switching_leads, drive.sensed_lead_switches


@pytest.mark.parametrize("seed", range(4))
def test_a_bridge_is_at_any_time_what_was_written_to_it(seed):
    """Changes out of order, many at once and at the same time, legs held, a watchdog of 300 us; looked at anywhere."""
    stream = RandomStream(seed, "bridge")
    drive, written = Drive(300_000), Written(300_000)
    states, now = set(), 0
    for _ in range(70):
        for _ in range((1, 2, 3, 5, 40)[stream.integer(5)]):
            random_change(stream, written, drive, now)
        if stream.integer(3) == 0:
            leg, state = 2 + 4 * stream.integer(2), (DRIVEN, DRIVEN, HELD_OPEN, HELD_LOW, HELD_HIGH)[stream.integer(5)]
            written.held[leg] = state
            drive.hold_leg(leg, state)
            assert seen(drive) == pytest.approx(written.at(now))
        ahead = written.changes(now, now + 1 + stream.integer(400_000))
        for now in ahead:
            if stream.integer(2):
                drive.apply(now - 1)
            drive.apply(now)
            duty, is_open, *_ = written.at(now, held=False)
            assert seen(drive) == pytest.approx(written.at(now))
            assert (drive.healthy_duty, drive.healthy_open) == pytest.approx((duty, is_open))
            size = abs(drive.duty)
            assert drive.ripple == pytest.approx((size * (1.0 - size)) ** 2)
            assert drive.powered == written.powered(now)
            assert drive.power_losses == written.losses(now)
            states.add((drive.is_open, drive.switching_leads, drive.sensed_lead_switches, drive.duty > 0.0))
            following = next(time for time in written.changes(now, NEVER) if time == NEVER or written.matters(time))
            assert now < drive.next_change_ns <= following or drive.next_change_ns > following == NEVER
    assert len(states) > 6 and drive.power_losses > 10


def test_the_next_change_is_the_first_of_queue_and_watchdog():
    drive = Drive(10_000)
    drive.watchdog_edge(100)
    assert drive.next_change_ns == 100
    drive.write_pwm(50, 1, 0, 600)
    assert drive.next_change_ns == 50
    drive.apply(50)
    assert drive.next_change_ns == 100 and drive.count == 1 and drive.mr2 == 1 and drive.is_open
    drive.apply(100)
    assert drive.next_change_ns == 10_100 and drive.power_off_ns == 10_100 and not drive.is_open
    drive.low_side(9_000, True, False)
    assert drive.next_change_ns == 9_000
    drive.watchdog_edge(200)  # it has power: that edge only lengthens it
    assert drive.next_change_ns == 9_000 and drive.power_off_ns == 10_200 and drive.count == 1
    drive.low_side(10_300, True, True)
    drive.apply(9_000)
    assert drive.next_change_ns == 10_200 and drive.is_open
    drive.watchdog_edge(400)
    assert drive.next_change_ns == 10_300 and drive.power_off_ns == 10_400
    drive.apply(10_300)
    assert drive.next_change_ns == 10_400 and not drive.is_open
    drive.apply(10_399)
    assert drive.powered
    drive.apply(10_400)
    assert not drive.powered and drive.next_change_ns > 1 << 61 and drive.power_losses == 1


BOOKS = ("winding_J", "series_J", "contact_J", "ripple_J", "gate_J", "diode_J", "mechanical_J", "drawn_J", "returned_J")


class Equations:
    """A motor by EQUATIONS 10.1-10.9 as they are printed, integrated numerically over each state of its bridge."""

    def __init__(self, parameters, mounting):
        self.p, self.mounting, self.amps = parameters, mounting, 0.0
        self.books = dict.fromkeys(BOOKS, 0.0)
        self.heat, self.warmed = 0.0, 0.0
        self.R, self.K = parameters.resistance_ohm, parameters.torque_constant_Nm_per_A

    def run(self, seconds, x, drop, R, L):
        """Integrals of I, |I| and I^2 with L dI/dt = x - R I - drop sgn I."""
        left, sums = seconds, [0.0, 0.0, 0.0]
        for _ in range(3):
            if left <= 1e-15 or (self.amps == 0.0 and abs(x) <= drop):
                break
            sense = math.copysign(1.0, self.amps if self.amps else x)

            def slopes(_, y, sense=sense):
                return (x - R * y[0] - drop * sense) / L, y[0], y[0] * y[0]

            def zero(t, y, sense=sense):
                return sense * y[0] if t > 1e-12 else 1.0

            zero.terminal, zero.direction = True, -1
            done = solve_ivp(
                slopes, (0.0, left), (self.amps, 0.0, 0.0), "DOP853", events=zero, rtol=1e-11, atol=1e-14
            )  # fmt: skip
            charge, square = done.y[1:, -1]
            sums = [sums[0] + charge, sums[1] + sense * charge, sums[2] + square]
            self.amps = 0.0 if done.t_events[0].size else float(done.y[0, -1])
            left -= done.t[-1]
        return sums

    def step(self, written, t0, t1, rate, volts, factor):
        """What one step adds to the books; (current, battery's current, drive's torque) of it."""
        p, R, books = self.p, self.R + self.p.series_resistance_ohm + self.p.bridge_resistance_ohm, self.books
        inductance = p.inductance_H(p.settling_frequency_hz)
        at_pwm = p.inductance_H(p.pwm_frequency_hz) * p.pwm_frequency_hz
        emf = self.mounting * p.gear * self.K * factor * rate
        turned, battery_As, begin = 0.0, 0.0, t0
        for end in written.changes(t0, t1):
            duty, is_open, leads, _ = written.at(begin)
            h = (end - begin) * 1e-9
            lossy = p.contact_drop_V + (volts + 2.0 * p.diode_drop_V if is_open else p.dead_time_fraction * volts)
            charge, size, square = self.run(h, -emf if is_open else duty * volts - emf, lossy, R, inductance)
            turned += charge
            active = leads > 0 if p.gate_scheme == "switching" else not is_open
            added = {
                "winding_J": self.R * square,
                "series_J": (R - self.R) * square,
                "contact_J": p.contact_drop_V * size,
                "diode_J": 2.0 * p.diode_drop_V * size if is_open else 0.0,
                "ripple_J": R * (volts * abs(duty) * (1.0 - abs(duty)) / at_pwm) ** 2 / 12.0 * h if leads else 0.0,
                "gate_J": active * p.gate_power_W * (volts / 30.0) * (p.pwm_frequency_hz / 100e3) * h,
            }
            battery_As += (added["ripple_J"] + added["gate_J"]) / volts
            battery_As += -size if is_open else duty * charge - p.dead_time_fraction * size
            for name, joule in added.items():
                books[name] += joule
            self.heat += added["winding_J"] + added["contact_J"] + added["ripple_J"] * self.R / R
            begin = end
        books["mechanical_J"] += emf * turned
        books["drawn_J" if battery_As >= 0.0 else "returned_J"] += abs(battery_As) * volts
        seconds = (t1 - t0) * 1e-9
        torque = self.mounting * p.gear * self.K * factor * turned / seconds
        return self.mounting * self.amps, battery_As / seconds, torque


DEAD = dataclasses.replace(HIP_MOTOR, dead_time_fraction=0.03, pwm_frequency_hz=80e3, settling_frequency_hz=30e3)
MOTORS = {
    "hip": (HIP_MOTOR, 1, 8.0),
    "mirrored ankle": (ANKLE_MOTOR, -1, 16.0),
    "steering": (STEERING_MOTOR, 1, 14.0),
    "dead time": (dataclasses.replace(DEAD, gate_power_W=0.5), -1, 8.0),
    "gates with the bridge's power": (dataclasses.replace(ANKLE_MOTOR, gate_scheme="powered"), 1, 8.0),
}


@pytest.mark.parametrize("name", MOTORS)
def test_every_figure_of_a_step_is_that_of_the_integrated_equations(name):
    """120 steps of changes anywhere: currents to 1e-8, sums to 1e-8 of themselves (the integration's 1e-11 a step)."""
    parameters, mounting, speed = MOTORS[name]
    unit, plain, stream = MotorUnit("m", parameters, mounting), Equations(parameters, mounting), RandomStream(4, name)
    written, kinds = Written(), set()
    for k in range(120):
        t0, t1 = k * STEP, (k + 1) * STEP
        if not 40 <= k < 84:  # it loses its power at step 80
            written.edges.append(t0)
            unit.drive.watchdog_edge(t0)
        for _ in range((0, 0, 1, 2)[stream.integer(4)] if k < 84 else 0):
            match = [(0, 600, stream.integer(601), stream.integer(120))[stream.integer(4)] for _ in "26"]
            written.pwm.append((t0 + stream.integer(STEP), (*match, 600)))
            unit.drive.write_pwm(written.pwm[-1][0], *match, 600)
        if stream.integer(12) == 0 or k == 84:
            sides = k == 84 or stream.integer(2) > 0, True
            written.sides.append((t0 + stream.integer(STEP), sides))
            unit.drive.low_side(written.sides[-1][0], *sides)
        rate = speed * (2.0 * stream.uniform() - 1.0)
        volts = 4.0 if 80 <= k < 84 else 20.0 + 8.0 * stream.uniform()
        factor = unit.angle_factor = 1.0 if k % 3 else 0.9
        unit.step_electrical(t0, t1, rate, volts)
        amps, battery_A, torque = plain.step(written, t0, t1, rate, volts, factor)
        close = dict(rel=1e-8, abs=1e-9)
        assert unit.current_A == pytest.approx(amps, **close), k
        assert unit.bridge_current_A == mounting * unit.current_A
        assert unit.battery_current_A == pytest.approx(battery_A, **close)
        assert unit.drive_Nm == pytest.approx(torque, **close)
        assert unit.mean_current_A * parameters.gear * unit.K * factor == pytest.approx(torque, **close)
        assert unit.coulomb_Nm == pytest.approx(
            parameters.load_friction * abs(torque) + parameters.constant_friction_Nm, **close
        )
        assert unit.viscous_Nms == parameters.viscous_friction_Nms
        for book, joule in plain.books.items():
            assert getattr(unit, book) == pytest.approx(joule, rel=1e-8, abs=1e-12), (k, book)
        assert unit.battery_J() == unit.drawn_J - unit.returned_J
        kinds.add((seen(unit.drive)[1:], amps > 0.0, amps < 0.0, battery_A > 0.0))
    assert unit.drive.power_losses == written.losses(120 * STEP) == 1
    assert min(plain.books[book] for book in BOOKS if book != "mechanical_J") > 0.0 and len(kinds) > 8


@pytest.mark.parametrize("parameters", [HIP_MOTOR, STEERING_MOTOR])
def test_winding_and_housing_warm_by_the_two_equations_of_heat(parameters):
    """8 times 8 ms, after each of which the mean power warms; copper and magnets follow."""
    parameters = dataclasses.replace(parameters, resistance_per_K=0.004, torque_constant_per_K=-0.002, air_C=20.0)
    unit, plain, written = MotorUnit("m", parameters), Equations(parameters, 1), Written(1 << 60)
    unit.rotor_temperature_C = winding = 60.0
    unit.housing_temperature_C = housing = 40.0
    written.edges.append(0)
    written.pwm.append((0, (500, 0, 600)))
    unit.drive.watchdog_ns = 1 << 60
    unit.drive.watchdog_edge(0)
    unit.drive.write_pwm(0, 500, 0, 600)
    for block in range(8):
        plain.heat = 0.0
        rate = 1.0 - 0.1 * block
        for k in range(32):
            t0 = (32 * block + k) * STEP
            assert unit.heat_s == pytest.approx(k * 250e-6, abs=1e-12)
            unit.step_electrical(t0, t0 + STEP, rate, 26.0)
            plain.step(written, t0, t0 + STEP, rate, 26.0, 1.0)
        watts = plain.heat / 8e-3
        assert unit.heat_W == pytest.approx(watts, rel=1e-8)
        p = parameters
        flows = (
            (watts - (winding - housing) / p.winding_to_housing_K_per_W) / p.winding_capacity_J_per_K,
            ((winding - housing) / p.winding_to_housing_K_per_W - (housing - 20.0) / p.housing_to_air_K_per_W)
            / p.housing_capacity_J_per_K,
        )
        winding, housing = winding + 8e-3 * flows[0], housing + 8e-3 * flows[1]
        assert (unit.rotor_temperature_C, unit.housing_temperature_C) == pytest.approx((winding, housing), rel=1e-10)
        plain.R = p.resistance_ohm * (1.0 + 0.004 * (winding - 25.0))
        plain.K = p.torque_constant_Nm_per_A * (1.0 - 0.002 * (housing - 25.0))
        assert (unit.winding_ohm, unit.K) == pytest.approx((plain.R, plain.K), rel=1e-10)
        # what was booked at one resistance stays booked
        for book, joule in plain.books.items():
            assert getattr(unit, book) == pytest.approx(joule, rel=1e-8, abs=1e-12), book
    assert unit.heat_s == 0.0


def test_a_motor_that_nothing_drives_warms_by_nothing_and_has_no_current():
    unit = MotorUnit("m", dataclasses.replace(HIP_MOTOR, air_C=20.0))
    unit.drive.watchdog_edge(0)
    unit.rotor_temperature_C = 30.0
    unit.current_A = unit.battery_current_A = 1.0
    for k in range(31):
        unit.step_electrical(k * STEP, (k + 1) * STEP, 0.5, 26.0)
    assert (unit.current_A, unit.battery_current_A, unit.drive_Nm, unit.coulomb_Nm) == (0.0, 0.0, 0.0, 0.1)
    assert unit.rotor_temperature_C == 30.0 and unit.heat_s == pytest.approx(31 * 250e-6)
    unit.step_electrical(31 * STEP, 32 * STEP, 0.5, 26.0)
    # 8 ms at 10 K over 2 K/W out of 10 J/K
    assert unit.rotor_temperature_C == pytest.approx(30.0 - 8e-3 * 5.0 / 10.0, rel=1e-12)
    assert unit.housing_temperature_C == pytest.approx(20.0 + 8e-3 * 5.0 / 65.0, rel=1e-12)
    assert unit.heat_s == 0.0


def test_time_that_does_not_pass_changes_nothing():
    unit = MotorUnit("m")
    unit.drive.watchdog_edge(0)
    unit.drive.write_pwm(0, 300, 0, 600)
    unit.step_electrical(0, STEP, 0.0, 26.0)
    before = unit.current_A, unit.drawn_J, unit.heat_s
    unit.step_electrical(STEP, STEP, 5.0, 10.0)
    unit.step_electrical(STEP, STEP - 1, 5.0, 10.0)
    assert (unit.current_A, unit.drawn_J, unit.heat_s) == before


@pytest.mark.parametrize("rate", [-3.0, -0.02, 0.0, 0.04, 5.0])
@pytest.mark.parametrize("amps", [-6.0, 0.0, 0.3])
def test_a_torque_is_that_of_the_equation(rate, amps):
    p = dataclasses.replace(HIP_MOTOR, load_friction=0.2, viscous_friction_Nms=0.03)
    unit = MotorUnit("m", p)
    unit.angle_factor = 1.1
    turn = 66.0 * 0.018 * 1.1 * amps
    expected = turn - (0.2 * abs(turn) + 0.1) * math.tanh(rate / 0.05) - 0.03 * rate
    assert unit.torque_Nm(amps, rate) == pytest.approx(expected, rel=1e-12, abs=1e-15)
    unit.load(amps)
    assert (unit.drive_Nm, unit.coulomb_Nm, unit.viscous_Nms) == pytest.approx((turn, 0.2 * abs(turn) + 0.1, 0.03))
