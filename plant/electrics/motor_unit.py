# cython: cdivision=True
# (only doubles are divided, by durations and resistances above zero)
"""A brushed motor with its drive: winding current in closed form, friction at the joint, heat, power balance.

Everything seen from outside is in the joint's sense: a positive current turns the joint positively. `mounting` (+1 or
-1) is the motor's orientation: with -1 a positive bridge voltage turns the joint negatively (the outer ankle is
mirrored, robot.md N4.1, N4.2).

Electrical (appendix eq. 32 with the inductance added; EQUATIONS 10.1-10.7):

    V = L dI/dt + R I + V_c sgn(I) + K G w

K may ripple with the rotor's angle: then it does on both sides, in V as in T, or the shaft would take another power
than the winding gives (EQUATIONS 10.10). `turn` sets its mean over the coming step.

On one side of zero this is linear, so the current is an exponential towards (V - K G w -/+ V_c) / R and is
integrated exactly, together with its square, until it reaches zero; there it stays while |V - K G w| < V_c.
The speed w is constant over a call. An open bridge is the same equation with V = 0 and the drop
V_c + V_battery + 2 V_diode: the winding pushes its current back into the battery through two diodes.

Mechanical (appendix eq. 33, 35, 36): T = G K I - (mu G K |I| + C_0) tanh(w / epsilon) - C_1 w, without the
rotor's inertia, which the body carries. tanh instead of sgn lets a stuck joint creep: below friction F a load T
moves it with epsilon atanh(T / F), that is 0.027 rad/s at half of the friction with epsilon = 0.05 rad/s.

Losses of the PWM: a triangular ripple of V_b d (1 - d) / (L f) from peak to peak heats the loop by
R (V_b d (1 - d) / (L f))^2 / 12, with the inductance at the PWM frequency. The MOSFETs' drive takes
gate_power_W V_b / 30 V f / 100 kHz for the board, while a lead switches or as long as the bridge has power
(`gate_scheme`). The electronics' 5.15 W are measured at the router board, which feeds everything "except for the
motors and motor drivers" (appendix 3.8), so the gates' power and ripple losses come on top and are drawn from the
battery here.
"""

import cython
from cython.cimports.libc.math import exp, log, sin

from ranger_sim.foundation.numbers import reals
from ranger_sim.plant.electrics.drive import Drive
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.plant.mechanics.friction import smoothed_sign


@cython.final
@cython.cclass
class MotorUnit:
    """One motor with its bridge. `parameters`: MotorParameters; `mounting`: +1 or -1.

    After `step_electrical`: `mean_current_A` and `current_A` (end of the step) in the joint's sense;
    `battery_current_A`, mean drawn from the battery, negative when the motor feeds it; `drive_Nm`,
    `coulomb_Nm`, `viscous_Nms` for the body: torque = drive - coulomb tanh(rate / epsilon) - viscous rate.
    Sums since power-up in J: battery_J = drawn_J - returned_J = mechanical + winding + series + contact + ripple
    + gate + diode + change of magnetic energy.

    More than 40 fields, because the lines of a step use both the winding's numbers and its sums: in a separate object
    the sums would cost a look-up in every line.
    """

    # fields read at every step come first, next to each other
    drive: Drive
    mounting: cython.double
    gear: cython.double
    K: cython.double
    angle_factor: cython.double
    winding_ohm: cython.double
    series_ohm: cython.double
    contact_drop_V: cython.double
    dead_time_fraction: cython.double
    bridge_current_A: cython.double
    known_s: cython.double
    known_ohm: cython.double
    per_s: cython.double
    per_ohm: cython.double
    decay: cython.double
    decay_s: cython.double
    decay_squared_s: cython.double
    switching_gate_A: cython.double
    powered_gate_A: cython.double
    ripple_per_ohm2: cython.double
    mu: cython.double
    C0: cython.double
    # results of a step
    heat_s: cython.double
    size_As: cython.double
    square_A2s: cython.double
    mechanical_J: cython.double
    drawn_J: cython.double
    returned_J: cython.double
    ripple_J: cython.double
    gate_J: cython.double
    current_A: cython.double
    battery_current_A: cython.double
    drive_Nm: cython.double
    coulomb_Nm: cython.double
    viscous_Nms: cython.double
    # the rest is read every few steps, or by the body alone
    tau_s: cython.double
    diode_drop_V: cython.double
    diode_J: cython.double
    total_As: cython.double
    from_battery_As: cython.double
    heat_matters: cython.bint
    inductance_H: cython.double
    C1: cython.double
    inverse_smoothing: cython.double
    resistance_per_K: cython.double
    torque_constant_per_K: cython.double
    G_wh: cython.double
    G_ha: cython.double
    inverse_C_w: cython.double
    inverse_C_h: cython.double
    air_C: cython.double
    rotor_temperature_C: cython.double
    housing_temperature_C: cython.double
    heat_W: cython.double
    drawn_before_J: cython.double
    warmed_As: cython.double
    warmed_A2s: cython.double
    warmed_J: cython.double
    warmed_ripple_J: cython.double
    ripples: cython.double[::1]
    name: str
    parameters: object

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
        self.K = p.torque_constant_Nm_per_A  # at the present temperature, its mean over a turn of the rotor
        self.angle_factor = 1.0  # factor of K at the rotor's position, 1 for a motor without ripple
        self.inductance_H = p.inductance_H(p.settling_frequency_hz)
        # of EQUATIONS 10.6, without voltage, resistance and duty
        self.ripple_per_ohm2 = 1.0 / (12.0 * (p.inductance_H(p.pwm_frequency_hz) * p.pwm_frequency_hz) ** 2)
        # what the MOSFETs' drive takes from the battery while a lead switches, and while the bridge has power
        gate_A = p.gate_power_W / 30.0 * (p.pwm_frequency_hz / 100e3)
        self.switching_gate_A = gate_A if p.gate_scheme == "switching" else 0.0
        self.powered_gate_A = gate_A if p.gate_scheme == "powered" else 0.0
        self.diode_drop_V = p.diode_drop_V
        self.dead_time_fraction = p.dead_time_fraction
        self.mu = p.load_friction
        self.C0 = p.constant_friction_Nm
        self.C1 = p.viscous_friction_Nms
        self.inverse_smoothing = 1.0 / p.friction_smoothing_rad_s
        self.resistance_per_K = p.resistance_per_K
        self.torque_constant_per_K = p.torque_constant_per_K
        self.ripples = reals([])  # of each: part of K, periods per turn of the rotor, phase (rad)
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
        self.battery_current_A = 0.0
        self.heat_W = 0.0  # in the rotor, mean over the last 8 ms
        self.drive_Nm = 0.0
        self.coulomb_Nm = p.constant_friction_Nm
        self.viscous_Nms = p.viscous_friction_Nms

        self.drawn_J = 0.0
        self.drawn_before_J = 0.0  # until the robot was let go; kept by plant/ranger.py
        self.returned_J = 0.0
        self.mechanical_J = 0.0  # K G w I, before friction
        self.ripple_J = 0.0
        self.gate_J = 0.0
        self.diode_J = 0.0
        # since its temperature was last computed: time, and integrals of the current's size and of its square
        self.heat_s = 0.0
        self.size_As = 0.0
        self.square_A2s = 0.0
        # of all the time before: these integrals, heat of the winding and the ripple
        self.warmed_As = 0.0
        self.warmed_A2s = 0.0
        self.warmed_J = 0.0
        self.warmed_ripple_J = 0.0
        # of a step in pieces: charge through the winding in the joint's sense, charge from the battery
        self.total_As = 0.0
        self.from_battery_As = 0.0
        # of a whole step of `known_s` at `known_ohm`: time constant, e^(-t/tau) and two integrals of it
        self.known_s = 0.0
        self.known_ohm = 0.0
        self.per_s = 0.0  # one over each
        self.per_ohm = 0.0
        self.tau_s = 0.0
        self.decay = 0.0
        self.decay_s = 0.0
        self.decay_squared_s = 0.0

    @cython.ccall
    @cython.exceptval(check=False)
    def magnetic_J(self) -> cython.double:
        """Energy in winding and inductor now."""
        return 0.5 * self.inductance_H * self.bridge_current_A * self.bridge_current_A

    @cython.ccall
    @cython.exceptval(check=False)
    def battery_J(self) -> cython.double:
        """Energy taken from the battery since power-up, less what was given back."""
        return self.drawn_J - self.returned_J

    def add_ripple(self, fraction, periods_per_turn, phase_rad) -> None:
        """Add a ripple of K by this fraction, with this phase at rotor angle 0."""
        self.ripples = reals(list(self.ripples) + [fraction, periods_per_turn, phase_rad])

    @cython.ccall
    def turn(self, angle_rad: cython.double, rate_rad_s: cython.double, seconds: cython.double) -> cython.void:
        """Set K for a step that begins at this angle of the joint: its mean over the rotor's motion."""
        half: cython.double = 0.5 * self.gear * rate_rad_s * seconds
        middle: cython.double = self.gear * angle_rad + half
        factor: cython.double = 1.0
        amplitude: cython.double
        half_phase: cython.double
        i: cython.Py_ssize_t
        for i in range(0, len(self.ripples), 3):
            amplitude = self.ripples[i]
            half_phase = self.ripples[i + 1] * half
            # below, the mean of a sine about its middle is the middle, to 1e-9
            if half_phase > 1e-4 or half_phase < -1e-4:
                amplitude *= sin(half_phase) / half_phase
            factor += amplitude * sin(self.ripples[i + 1] * middle + self.ripples[i + 2])
        self.angle_factor = factor

    @cython.ccall
    @cython.exceptval(check=False)
    def torque_Nm(self, current_A: cython.double, rate_rad_s: cython.double) -> cython.double:
        """Torque at the joint for a current and a joint rate, without the rotor's inertia."""
        GKI: cython.double = self.gear * self.K * self.angle_factor * current_A
        load: cython.double = GKI if GKI > 0.0 else -GKI
        return (
            GKI - (self.mu * load + self.C0) * smoothed_sign(rate_rad_s * self.inverse_smoothing) - self.C1 * rate_rad_s
        )

    @cython.ccall
    def load(self, current_A: cython.double) -> cython.void:
        """Set the three torque numbers for the body from a current in the joint's sense."""
        GKI: cython.double = self.gear * self.K * self.angle_factor * current_A
        self.drive_Nm = GKI
        self.coulomb_Nm = self.mu * (GKI if GKI > 0.0 else -GKI) + self.C0
        self.viscous_Nms = self.C1

    @cython.ccall
    def step_electrical(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        rate_rad_s: cython.double,
        battery_V: cython.double,
    ) -> cython.void:
        """Winding, bridge and heat from `t0` to `t1` (ns) at a constant joint rate and battery voltage.

        Computed here if the bridge does not change and the current stays on its side of zero, which is nearly always
        so; otherwise in pieces (EQUATIONS 10.2-10.7).
        """
        drive: Drive = self.drive
        if t1 <= t0:
            return
        if drive.next_change_ns <= t0:  # before anything else: it is a call
            drive.apply(t0)
        h: cython.double = (t1 - t0) * 1e-9
        R: cython.double = self.winding_ohm + self.series_ohm
        GK: cython.double = self.mounting * self.gear * self.K * self.angle_factor
        contact_V: cython.double = self.contact_drop_V
        back_emf_V: cython.double = GK * rate_rad_s
        bridge_A: cython.double = self.bridge_current_A
        duty: cython.double = drive.duty
        driving_V: cython.double
        drop_V: cython.double
        sign: cython.double
        final_A: cython.double
        above_A: cython.double
        end_A: cython.double = -1.0  # size of the current at the end of the step; below 0: it crosses zero before
        steady_As: cython.double
        decaying_As: cython.double
        size_As: cython.double
        total_As: cython.double
        ripple_As: cython.double
        gate_As: cython.double
        from_battery_As: cython.double = 0.0
        from_battery_J: cython.double
        mean_Nm: cython.double
        if bridge_A == 0.0 and drive.switching_leads == 0 and drive.next_change_ns > t1:
            driving_V = duty * battery_V - back_emf_V
            if -contact_V <= driving_V <= contact_V:
                # nothing drives a current through the contacts and no lead switches: the MOSFETs' drive at most
                if self.current_A != 0.0 or self.drive_Nm != 0.0:
                    self.current_A = 0.0
                    self.load(0.0)
                self.battery_current_A = 0.0 if drive.is_open else self.powered_gate_A
                if self.battery_current_A > 0.0:
                    from_battery_J = self.battery_current_A * h * battery_V
                    self.gate_J += from_battery_J
                    self.drawn_J += from_battery_J
                self.heat_s += h
                if self.heat_s >= 0.008:
                    self._heat()
                return
        if h != self.known_s or R != self.known_ohm:
            self._know_step(h, R)
        if drive.next_change_ns > t1:
            if drive.is_open:
                driving_V = -back_emf_V
                drop_V = contact_V + battery_V + 2.0 * self.diode_drop_V
            else:
                driving_V = duty * battery_V - back_emf_V
                drop_V = contact_V + self.dead_time_fraction * battery_V
            # `sign`: side of zero the current is on or goes to; `final_A` and `above_A` are measured on that side
            if bridge_A > 0.0 or bridge_A == 0.0 and driving_V > drop_V:
                sign = 1.0
            elif bridge_A < 0.0 or driving_V < -drop_V:
                sign = -1.0
            else:
                sign = 0.0
            if sign != 0.0:
                final_A = (sign * driving_V - drop_V) * self.per_ohm
                above_A = sign * bridge_A - final_A
                end_A = final_A + above_A * self.decay
        if end_A >= 0.0:
            bridge_A = sign * end_A
            steady_As = h * final_A
            decaying_As = above_A * self.decay_s
            size_As = steady_As + decaying_As
            total_As = sign * size_As
            self.square_A2s += final_A * (steady_As + 2.0 * decaying_As) + above_A * above_A * self.decay_squared_s
            self.size_As += size_As
            if drive.is_open:
                from_battery_As -= size_As
                self.diode_J += 2.0 * self.diode_drop_V * size_As
            else:
                # the dead time's drop is the battery's own voltage, switched against the current: it goes back
                from_battery_As += duty * total_As - self.dead_time_fraction * size_As
                ripple_As = 0.0
                gate_As = self.powered_gate_A * h
                if drive.switching_leads > 0:
                    ripple_As = battery_V * R * self.ripple_per_ohm2 * drive.ripple * h
                    gate_As += self.switching_gate_A * h
                    self.ripple_J += ripple_As * battery_V
                self.gate_J += gate_As * battery_V
                from_battery_As += ripple_As + gate_As
        else:
            self._step_in_pieces(t0, t1, back_emf_V, battery_V)
            bridge_A = self.bridge_current_A
            total_As = self.total_As
            from_battery_As = self.from_battery_As
        self.bridge_current_A = bridge_A
        self.current_A = self.mounting * bridge_A
        self.battery_current_A = from_battery_As * self.per_s
        self.mechanical_J += back_emf_V * total_As
        from_battery_J = from_battery_As * battery_V
        if from_battery_J >= 0.0:
            self.drawn_J += from_battery_J
        else:
            self.returned_J -= from_battery_J
        self.heat_s += h
        if self.heat_s >= 0.008:
            self._heat()
        # the torque numbers for the body: `load` of the mean current
        mean_Nm = GK * total_As * self.per_s
        self.drive_Nm = mean_Nm
        self.coulomb_Nm = self.mu * (mean_Nm if mean_Nm > 0.0 else -mean_Nm) + self.C0

    @cython.cfunc
    def _step_in_pieces(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        back_emf_V: cython.double,
        battery_V: cython.double,
    ) -> cython.void:
        """`step_electrical` over changes of the bridge and zeros of the current: leaves the current, `total_As` and
        `from_battery_As`, and counts the heat's integrals and the energies of ripple, gates and diodes.

        Pieces between changes of the bridge; in each the current runs to its final value, or to zero and on from
        there, and its integral, that of its size and that of its square are summed (EQUATIONS 10.2-10.7).
        """
        drive: Drive = self.drive
        now: cython.longlong = t0
        following: cython.longlong
        h: cython.double = self.known_s
        R: cython.double = self.known_ohm
        tau: cython.double = self.tau_s
        contact_V: cython.double = self.contact_drop_V
        bridge_A: cython.double = self.bridge_current_A
        between_changes_s: cython.double
        left_s: cython.double
        piece_s: cython.double
        driving_V: cython.double
        drop_V: cython.double
        duty: cython.double
        sign: cython.double
        final_A: cython.double
        above_A: cython.double
        end_A: cython.double
        decay: cython.double
        decay_s: cython.double
        decay_squared_s: cython.double
        steady_As: cython.double
        piece_As: cython.double
        signed_As: cython.double
        unsigned_As: cython.double
        ripple_As: cython.double
        gate_As: cython.double
        from_battery_As: cython.double = 0.0
        total_As: cython.double = 0.0
        size_As: cython.double = 0.0
        square_A2s: cython.double = 0.0
        while now < t1:
            following = drive.next_change_ns
            if following > t1:
                following = t1
            between_changes_s = (following - now) * 1e-9
            duty = drive.duty
            if drive.is_open:
                driving_V = -back_emf_V
                drop_V = contact_V + battery_V + 2.0 * self.diode_drop_V
            else:
                driving_V = duty * battery_V - back_emf_V
                drop_V = contact_V + self.dead_time_fraction * battery_V
            signed_As = 0.0
            unsigned_As = 0.0
            left_s = between_changes_s
            while left_s > 0.0:
                # `sign`: side of zero the current is on or goes to; `final_A` and `above_A` are measured on that side
                if bridge_A > 0.0:
                    sign = 1.0
                elif bridge_A < 0.0:
                    sign = -1.0
                elif driving_V > drop_V:
                    sign = 1.0
                elif driving_V < -drop_V:
                    sign = -1.0
                else:
                    break  # the contact drop holds the current at zero
                final_A = (sign * driving_V - drop_V) * self.per_ohm
                above_A = sign * bridge_A - final_A
                if left_s == h:
                    decay = self.decay
                    decay_s = self.decay_s
                    decay_squared_s = self.decay_squared_s
                else:
                    decay = exp(-left_s / tau)
                    decay_s = tau * (1.0 - decay)
                    decay_squared_s = 0.5 * tau * (1.0 - decay * decay)
                end_A = final_A + above_A * decay
                if end_A >= 0.0:
                    bridge_A = sign * end_A
                    piece_s = left_s
                    left_s = 0.0
                else:
                    # the current reaches zero inside: there the decay is -final / above
                    decay = -final_A / above_A
                    decay_s = tau * (1.0 - decay)
                    decay_squared_s = 0.5 * tau * (1.0 - decay * decay)
                    piece_s = tau * log(above_A / -final_A)
                    if piece_s > left_s:
                        piece_s = left_s
                    left_s -= piece_s
                    bridge_A = 0.0
                steady_As = final_A * piece_s
                square_A2s += final_A * (steady_As + 2.0 * above_A * decay_s) + above_A * above_A * decay_squared_s
                piece_As = steady_As + above_A * decay_s
                signed_As += sign * piece_As
                unsigned_As += piece_As
            total_As += signed_As
            size_As += unsigned_As
            if drive.is_open:
                from_battery_As -= unsigned_As
                self.diode_J += 2.0 * self.diode_drop_V * unsigned_As
            else:
                # the dead time's drop is the battery's own voltage, switched against the current: it goes back
                from_battery_As += duty * signed_As - self.dead_time_fraction * unsigned_As
                ripple_As = 0.0
                gate_As = self.powered_gate_A * between_changes_s
                if drive.switching_leads > 0:
                    ripple_As = battery_V * R * self.ripple_per_ohm2 * drive.ripple * between_changes_s
                    gate_As += self.switching_gate_A * between_changes_s
                    self.ripple_J += ripple_As * battery_V
                self.gate_J += gate_As * battery_V
                from_battery_As += ripple_As + gate_As
            now = following
            if now == drive.next_change_ns:
                drive.apply(now)
        self.bridge_current_A = bridge_A
        self.total_As = total_As
        self.from_battery_As = from_battery_As
        self.size_As += size_As
        self.square_A2s += square_A2s

    @property
    def mean_current_A(self) -> float:
        """Mean of the last step, in the joint's sense."""
        return self.drive_Nm / (self.gear * self.K * self.angle_factor)

    @property
    def contact_J(self) -> float:
        """Heat at the brushes."""
        return self.contact_drop_V * (self.warmed_As + self.size_As)

    @property
    def series_J(self) -> float:
        """Heat in the inductor, the bridge and other series resistance."""
        return self.series_ohm * (self.warmed_A2s + self.square_A2s)

    @property
    def winding_J(self) -> float:
        """Heat in the winding without its share of the ripple's."""
        return self.warmed_J + self.winding_ohm * self.square_A2s

    @cython.cfunc
    def _heat(self) -> cython.void:
        """Warm the motor with the mean power since it was last warmed: winding, brushes, its share of the ripple.

        The ripple heats the winding and the series parts in proportion to their resistance.
        """
        winding_J: cython.double = self.winding_ohm * self.square_A2s
        ripple_J: cython.double = (self.ripple_J - self.warmed_ripple_J) * self.winding_ohm
        ripple_J /= self.winding_ohm + self.series_ohm
        self.heat_W = (winding_J + self.contact_drop_V * self.size_As + ripple_J) / self.heat_s
        self.warmed_J += winding_J
        self.warmed_A2s += self.square_A2s
        self.warmed_As += self.size_As
        self.warmed_ripple_J = self.ripple_J
        self.square_A2s = 0.0
        self.size_As = 0.0
        self._warm(self.heat_s)
        self.heat_s = 0.0

    @cython.cfunc
    def _know_step(self, h: cython.double, R: cython.double) -> cython.void:
        """Keep the exponentials for a step of `h` seconds at a loop resistance of `R` ohm."""
        self.known_s = h
        self.known_ohm = R
        self.per_s = 1.0 / h
        self.per_ohm = 1.0 / R
        self.tau_s = self.inductance_H / R
        self.decay = exp(-h / self.tau_s)
        self.decay_s = self.tau_s * (1.0 - self.decay)
        self.decay_squared_s = 0.5 * self.tau_s * (1.0 - self.decay * self.decay)

    @cython.ccall
    def _warm(self, h: cython.double) -> cython.void:
        """Winding and housing after `h` seconds of `heat_W`; R and K follow when their coefficients are set.

        Called every 8 ms, less than a 600th of any winding's time constant: chosen by us.
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
