# cython: cdivision=True
# (only doubles are divided, by durations and resistances above zero)
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
        self.heat_W = 0.0  # in the rotor, mean over the last 8 ms
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
        self.heat_J = 0.0  # in the rotor since its temperature was last computed, and the time since then
        self.heat_s = 0.0
        # of a whole step of `known_s` at `known_ohm`: time constant, e^(-t/tau) and two integrals of it
        self.known_s = 0.0
        self.known_ohm = 0.0
        self.tau_s = 0.0
        self.decay = 0.0
        self.decay_s = 0.0
        self.decay_squared_s = 0.0

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
        """Winding, bridge and heat from `t0` to `t1` (ns) at a constant joint rate and battery voltage.

        Pieces between changes of the bridge; in each the current runs to its final value, or to zero and on from
        there, and its integral, that of its size and that of its square are summed (EQUATIONS 10.2-10.7).
        """
        drive: Drive = self.drive
        now: cython.longlong = t0
        following: cython.longlong
        h: cython.double = (t1 - t0) * 1e-9
        R: cython.double = self.winding_ohm + self.series_ohm
        back_emf_V: cython.double = self.mounting * self.K * self.gear * rate_rad_s
        amps: cython.double = self.bridge_current_A
        open_bridge: cython.bint
        seconds: cython.double
        left: cython.double
        x: cython.double
        drop: cython.double
        d: cython.double
        sign: cython.double
        final: cython.double
        above: cython.double
        tau: cython.double
        e: cython.double
        e_s: cython.double
        ee_s: cython.double
        part: cython.double
        charge: cython.double
        absolute: cython.double
        energy: cython.double
        from_battery_As: cython.double = 0.0
        total_As: cython.double = 0.0
        size_As: cython.double = 0.0
        square_A2s: cython.double = 0.0
        ripple_J: cython.double = 0.0
        volt_seconds: cython.double = 0.0
        if t1 <= t0:
            return
        if drive.next_change_ns <= t0:
            drive.apply(t0)
        if amps == 0.0 and drive.switching_leads == 0 and drive.next_change_ns > t1:
            x = drive.duty * battery_V - back_emf_V
            if -self.contact_drop_V <= x <= self.contact_drop_V:
                self._rest(h, drive.duty * battery_V)
                return
        if h != self.known_s or R != self.known_ohm:
            self._know_step(h, R)
        tau = self.tau_s
        while now < t1:
            following = drive.next_change_ns
            if following > t1:
                following = t1
            seconds = (following - now) * 1e-9
            open_bridge = drive.is_open
            d = drive.duty
            if open_bridge:
                x = -back_emf_V
                drop = self.contact_drop_V + battery_V + 2.0 * self.diode_drop_V
            else:
                x = d * battery_V - back_emf_V
                drop = self.contact_drop_V + self.dead_time_fraction * battery_V
            charge = 0.0
            absolute = 0.0
            left = seconds
            while left > 0.0:
                # `sign`: side of zero the current is on or goes to; `final` and `above` are measured on that side
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
                final = (sign * x - drop) / R
                above = sign * amps - final
                if left == h:
                    e = self.decay
                    e_s = self.decay_s
                    ee_s = self.decay_squared_s
                else:
                    e = exp(-left / tau)
                    e_s = tau * (1.0 - e)
                    ee_s = 0.5 * tau * (1.0 - e * e)
                if final + above * e < 0.0:
                    # the current reaches zero inside: there e = -final / above
                    e = -final / above
                    e_s = tau * (1.0 - e)
                    ee_s = 0.5 * tau * (1.0 - e * e)
                    part = tau * log(above / -final)
                    if part > left:
                        part = left
                    left -= part
                    amps = 0.0
                else:
                    part = left
                    left = 0.0
                    amps = sign * (final + above * e)
                part *= final
                square_A2s += final * (part + 2.0 * above * e_s) + above * above * ee_s
                part += above * e_s
                charge += sign * part
                absolute += part
            total_As += charge
            size_As += absolute
            if open_bridge:
                from_battery_As -= absolute
                self.diode_J += 2.0 * self.diode_drop_V * absolute
            else:
                # the dead time's drop is the battery's own voltage, switched against the current: it goes back
                from_battery_As += d * charge - self.dead_time_fraction * absolute
                volt_seconds += d * battery_V * seconds
                if d < 0.0:
                    d = -d
                if d > 0.0:
                    energy = battery_V * d * (1.0 - d) * self.ripple_factor
                    ripple_J += energy * energy * (1.0 / 12.0) * R * seconds
                if drive.switching_leads > 0 and battery_V > 0.0:
                    energy = drive.switching_leads * self.gate_W_per_V * seconds
                    from_battery_As += energy
                    self.gate_J += energy * battery_V
            now = following
            if now == drive.next_change_ns:
                drive.apply(now)
        if ripple_J > 0.0:
            from_battery_As += ripple_J / battery_V
            self.ripple_J += ripple_J
        part = self.contact_drop_V * size_As
        self.contact_J += part
        self.mechanical_J += back_emf_V * total_As
        energy = self.winding_ohm * square_A2s
        self.winding_J += energy
        self.series_J += self.series_ohm * square_A2s
        self.bridge_current_A = amps
        self.current_A = self.mounting * amps
        self.mean_current_A = self.mounting * total_As / h
        self.battery_current_A = from_battery_As / h
        self.drive_voltage_V = volt_seconds / h
        x = from_battery_As * battery_V
        if x >= 0.0:
            self.drawn_J += x
        else:
            self.returned_J -= x
        # the ripple heats the winding and the series parts in proportion to their resistance
        self.heat_J += energy + part + ripple_J * self.winding_ohm / R
        self.heat_s += h
        if self.heat_s >= 0.008:
            self._heat()
        # the three torque numbers for the body: `load` of the mean current
        x = self.gear * self.K * self.mean_current_A
        self.drive_Nm = x
        self.coulomb_Nm = self.mu * (x if x > 0.0 else -x) + self.C0
        self.viscous_Nms = self.C1

    def _rest(self, h: cython.double, voltage_V: cython.double) -> cython.void:
        """A step of `h` seconds without current: the contact drop holds it at zero and no lead switches."""
        self.current_A = 0.0
        self.mean_current_A = 0.0
        self.battery_current_A = 0.0
        self.drive_voltage_V = voltage_V
        self.heat_s += h
        if self.heat_s >= 0.008:
            self._heat()
        self.drive_Nm = 0.0
        self.coulomb_Nm = self.C0
        self.viscous_Nms = self.C1

    def _heat(self) -> cython.void:
        """Warm the motor with the mean power since it was last warmed."""
        self.heat_W = self.heat_J / self.heat_s
        self._warm(self.heat_s)
        self.heat_J = 0.0
        self.heat_s = 0.0

    def _know_step(self, h: cython.double, R: cython.double) -> cython.void:
        """Keep what a step of `h` seconds at a loop resistance of `R` ohm needs of the exponential."""
        self.known_s = h
        self.known_ohm = R
        self.tau_s = self.inductance_H / R
        self.decay = exp(-h / self.tau_s)
        self.decay_s = self.tau_s * (1.0 - self.decay)
        self.decay_squared_s = 0.5 * self.tau_s * (1.0 - self.decay * self.decay)

    def _warm(self, h: cython.double) -> cython.void:
        """Winding and housing after `h` seconds of `heat_W`; R and K follow when their coefficients are set.

        Asked every 8 ms, less than a 600th of any winding's time constant: chosen by us.
        """
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
