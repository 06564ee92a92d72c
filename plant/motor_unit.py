"""A brushed motor with its drive: winding current in closed form, friction at the joint, heat, power balance.

Everything seen from outside is in the joint's sense: a positive current turns the joint positively. `mounting`
(+1 or -1) says how the motor sits: with -1 a positive bridge voltage turns the joint negatively (the outer
ankle is mirrored, facts network-and-boards 4.1, 4.2).

Electrical (appendix eq. 32 with the inductance added; EQUATIONS 10.1-10.7):

    V = L dI/dt + R I + V_c sgn(I) + K G w

On one side of zero this is linear, so the current is an exponential towards (V - K G w -/+ V_c) / R and is
integrated exactly, together with its square, until it reaches zero; there it stays while |V - K G w| < V_c.
The speed w is constant over a call. An open bridge is the same equation with V = 0 and the drop
V_c + V_battery + 2 V_diode: the winding pushes its current back into the battery through two diodes.

Mechanical (appendix eq. 33, 35, 36): T = G K I - (mu G K |I| + C_0) tanh(w / epsilon) - C_1 w, without the
rotor's inertia, which the body carries. tanh instead of sgn lets a stuck joint creep: below friction F a load T
moves it with epsilon atanh(T / F), that is 0.027 rad/s at half of the friction with epsilon = 0.05 rad/s.

Losses of the PWM: a triangular ripple of V_b d (1 - d) / (L f) from peak to peak heats the loop by
R (V_b d (1 - d) / (L f))^2 / 12, with the inductance at the PWM frequency. The gate drive takes 0.3 W at 30 V
and 100 kHz for each lead that switches. The electronics' 5.15 W are measured at the router board, which feeds
everything "except for the motors and motor drivers" (appendix 3.8), so gate and ripple losses come on top and
are drawn from the battery here.
"""

import cython

from plant.drive import Drive
from plant.motor_parameters import MotorParameters

if not cython.compiled:
    from math import exp, log, tanh


class MotorUnit:
    """One motor with its bridge. `parameters`: MotorParameters; `mounting`: +1 or -1.

    After `step_electrical`: `mean_current_A` and `current_A` (end of the step) in the joint's sense;
    `battery_current_A`, mean drawn from the battery, negative when the motor feeds it; `drive_Nm`,
    `coulomb_Nm`, `viscous_Nms` for the body: torque = drive - coulomb tanh(rate / epsilon) - viscous rate.
    Sums since power-up in J: battery_J = drawn_J - returned_J = mechanical + winding + series + contact + ripple
    + gate + diode + change of magnetic energy.
    """

    def __init__(self, name, parameters=None, mounting=1) -> None:
        p = parameters if parameters is not None else MotorParameters()
        self.name = name
        self.parameters = p
        self.mounting = mounting
        self.drive = Drive(p.watchdog_ns)
        self.gear = p.gear
        self.contact_drop_V = p.contact_drop_V
        self.winding_ohm = p.resistance_ohm  # at the present temperature
        self.series_ohm = p.series_resistance_ohm + p.bridge_resistance_ohm
        self.K = p.torque_constant_Nm_per_A  # at the present temperature
        self.inductance_H = p.inductance_H(p.settling_frequency_hz)
        self.ripple_factor = 1.0 / (p.inductance_H(p.pwm_frequency_hz) * p.pwm_frequency_hz)
        self.gate_W_per_V = p.gate_power_W / 30.0 * (p.pwm_frequency_hz / 100e3)
        self.diode_drop_V = p.diode_drop_V
        self.dead_time_fraction = p.dead_time_fraction
        self.mu = p.load_friction
        self.C0 = p.constant_friction_Nm
        self.C1 = p.viscous_friction_Nms
        self.inverse_smoothing = 1.0 / p.friction_smoothing_rad_s
        self.resistance_per_K = p.resistance_per_K
        self.torque_constant_per_K = p.torque_constant_per_K
        self.heat_matters = p.resistance_per_K != 0.0 or p.torque_constant_per_K != 0.0
        self.G_wh = 1.0 / p.winding_to_housing_K_per_W
        self.G_ha = 1.0 / p.housing_to_air_K_per_W
        self.inverse_C_w = 1.0 / p.winding_capacity_J_per_K
        self.inverse_C_h = 1.0 / p.housing_capacity_J_per_K
        self.air_C = p.air_C
        self.rotor_temperature_C = p.air_C
        self.housing_temperature_C = p.air_C

        self.bridge_current_A = 0.0  # in the bridge's sense
        self.current_A = 0.0
        self.mean_current_A = 0.0
        self.battery_current_A = 0.0
        self.heat_W = 0.0  # in the rotor, mean over the step
        self.drive_voltage_V = 0.0  # mean over the step, in the bridge's sense
        self.drive_Nm = 0.0
        self.coulomb_Nm = p.constant_friction_Nm
        self.viscous_Nms = p.viscous_friction_Nms

        self.drawn_J = 0.0
        self.drawn_before_J = 0.0  # until the robot was let go; kept by plant/ranger.py
        self.returned_J = 0.0
        self.mechanical_J = 0.0  # K G w I, before friction
        self.winding_J = 0.0
        self.series_J = 0.0
        self.contact_J = 0.0
        self.ripple_J = 0.0
        self.gate_J = 0.0
        self.diode_J = 0.0
        # integrals over the running step
        self.charge_As = 0.0  # of I
        self.absolute_As = 0.0  # of |I|
        self.square_A2s = 0.0  # of I^2
        self.last_duration_s = 0.0
        self.decay = 0.0
        self.decay_rate = 0.0

    def magnetic_J(self) -> cython.double:
        """Energy in winding and inductor now."""
        return 0.5 * self.inductance_H * self.bridge_current_A * self.bridge_current_A

    def battery_J(self) -> cython.double:
        """Energy taken from the battery since power-up, less what was given back."""
        return self.drawn_J - self.returned_J

    def torque_Nm(self, current_A: cython.double, rate_rad_s: cython.double) -> cython.double:
        """Torque at the joint for a current and a joint rate, without the rotor's inertia."""
        GKI: cython.double = self.gear * self.K * current_A
        load: cython.double = GKI if GKI > 0.0 else -GKI
        return GKI - (self.mu * load + self.C0) * tanh(rate_rad_s * self.inverse_smoothing) - self.C1 * rate_rad_s

    def load(self, current_A: cython.double) -> cython.void:
        """Set the three torque numbers for the body from a current in the joint's sense."""
        GKI: cython.double = self.gear * self.K * current_A
        self.drive_Nm = GKI
        self.coulomb_Nm = self.mu * (GKI if GKI > 0.0 else -GKI) + self.C0
        self.viscous_Nms = self.C1

    def step_electrical(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        rate_rad_s: cython.double,
        battery_V: cython.double,
    ) -> cython.void:
        """Winding, bridge and heat from `t0` to `t1` (ns) at a constant joint rate and battery voltage."""
        now: cython.longlong = t0
        following: cython.longlong
        h: cython.double = (t1 - t0) * 1e-9
        seconds: cython.double
        back_emf_V: cython.double
        V: cython.double
        drop: cython.double
        d: cython.double
        ripple: cython.double
        charge: cython.double
        absolute: cython.double
        square: cython.double
        energy: cython.double
        from_battery_As: cython.double = 0.0
        total_As: cython.double = 0.0
        total_A2s: cython.double = 0.0
        ripple_J: cython.double = 0.0
        contact_J: cython.double = 0.0
        volt_seconds: cython.double = 0.0
        if t1 <= t0:
            return
        self.drive.apply(t0)
        back_emf_V = self.mounting * self.K * self.gear * rate_rad_s
        while now < t1:
            following = self.drive.next_change_ns
            if following > t1:
                following = t1
            seconds = (following - now) * 1e-9
            if self.drive.is_open:
                self._current(seconds, -back_emf_V, self.contact_drop_V + battery_V + 2.0 * self.diode_drop_V)
                charge = self.charge_As
                absolute = self.absolute_As
                square = self.square_A2s
                from_battery_As -= absolute
                self.diode_J += 2.0 * self.diode_drop_V * absolute
            else:
                d = self.drive.duty
                V = d * battery_V
                drop = self.contact_drop_V
                if self.dead_time_fraction > 0.0:
                    drop += self.dead_time_fraction * battery_V
                self._current(seconds, V - back_emf_V, drop)
                charge = self.charge_As
                absolute = self.absolute_As
                square = self.square_A2s
                from_battery_As += d * charge
                volt_seconds += V * seconds
                if self.dead_time_fraction > 0.0:
                    # the drop is the battery's own voltage, switched against the current: it goes back
                    from_battery_As -= self.dead_time_fraction * absolute
                if d < 0.0:
                    d = -d
                if d > 0.0:
                    ripple = battery_V * d * (1.0 - d) * self.ripple_factor
                    energy = ripple * ripple * (1.0 / 12.0) * (self.winding_ohm + self.series_ohm) * seconds
                    self.ripple_J += energy
                    ripple_J += energy
                if self.drive.switching_leads > 0 and battery_V > 0.0:
                    energy = self.drive.switching_leads * self.gate_W_per_V * battery_V * seconds
                    self.gate_J += energy
                    from_battery_As += energy / battery_V
            energy = self.contact_drop_V * absolute
            self.contact_J += energy
            contact_J += energy
            self.mechanical_J += back_emf_V * charge
            total_As += charge
            total_A2s += square
            now = following
            if now < t1 or now == self.drive.next_change_ns:
                self.drive.apply(now)
        if ripple_J > 0.0:
            from_battery_As += ripple_J / battery_V
        energy = self.winding_ohm * total_A2s
        self.winding_J += energy
        self.series_J += self.series_ohm * total_A2s
        # the ripple heats the winding and the series parts in proportion to their resistance
        self.heat_W = (energy + contact_J + ripple_J * self.winding_ohm / (self.winding_ohm + self.series_ohm)) / h
        self.current_A = self.mounting * self.bridge_current_A
        self.mean_current_A = self.mounting * total_As / h
        self.battery_current_A = from_battery_As / h
        self.drive_voltage_V = volt_seconds / h
        energy = from_battery_As * battery_V
        if energy >= 0.0:
            self.drawn_J += energy
        else:
            self.returned_J -= energy
        self._warm(h)
        self.load(self.mean_current_A)

    def _current(self, seconds: cython.double, x: cython.double, drop: cython.double) -> cython.void:
        """Bridge current over `seconds` with x = V - K G w; leaves the integrals of I, |I| and I^2."""
        R: cython.double = self.winding_ohm + self.series_ohm
        tau: cython.double
        amps: cython.double = self.bridge_current_A
        left: cython.double = seconds
        final: cython.double
        start: cython.double
        crossing: cython.double
        e: cython.double
        part: cython.double
        sign: cython.double
        charge: cython.double = 0.0
        absolute: cython.double = 0.0
        square: cython.double = 0.0
        while left > 0.0:
            # `sign`: side of zero the current is on or goes to; start and final are measured on that side
            if amps > 0.0:
                sign = 1.0
            elif amps < 0.0:
                sign = -1.0
            elif x > drop:
                sign = 1.0
            elif x < -drop:
                sign = -1.0
            else:
                break  # the contact drop holds the current at zero
            tau = self.inductance_H / R
            start = sign * amps
            final = (sign * x - drop) / R
            crossing = left
            if final < 0.0:
                e = exp(-left / tau) if left != self.last_duration_s or R != self.decay_rate else self.decay
                if final + (start - final) * e < 0.0:
                    crossing = tau * log((start - final) / -final)
            if crossing < left:
                # the current reaches zero inside: there e = -final / (start - final)
                e = -final / (start - final)
                left -= crossing
                amps = 0.0
            else:
                if left == self.last_duration_s and R == self.decay_rate:
                    e = self.decay
                else:
                    e = exp(-left / tau)
                    self.last_duration_s = left
                    self.decay_rate = R
                    self.decay = e
                crossing = left
                left = 0.0
                amps = sign * (final + (start - final) * e)
                if sign * amps < 0.0:
                    amps = 0.0
            part = final * crossing + (start - final) * tau * (1.0 - e)
            charge += sign * part
            absolute += part
            square += (
                final * final * crossing
                + 2.0 * final * (start - final) * tau * (1.0 - e)
                + (start - final) * (start - final) * (0.5 * tau) * (1.0 - e * e)
            )
        self.bridge_current_A = amps
        self.charge_As = charge
        self.absolute_As = absolute
        self.square_A2s = square

    def _warm(self, h: cython.double) -> cython.void:
        """Winding and housing temperature; R and K follow when their coefficients are set."""
        inward: cython.double = (self.rotor_temperature_C - self.housing_temperature_C) * self.G_wh
        outward: cython.double = (self.housing_temperature_C - self.air_C) * self.G_ha
        self.rotor_temperature_C += (self.heat_W - inward) * h * self.inverse_C_w
        self.housing_temperature_C += (inward - outward) * h * self.inverse_C_h
        if self.heat_matters:
            self.winding_ohm = self.parameters.resistance_ohm * (
                1.0 + self.resistance_per_K * (self.rotor_temperature_C - 25.0)
            )
            self.K = self.parameters.torque_constant_Nm_per_A * (
                1.0 + self.torque_constant_per_K * (self.housing_temperature_C - 25.0)
            )
