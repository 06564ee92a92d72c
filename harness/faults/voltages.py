"""Faults of analog inputs: another voltage at the converter's pin than the sensor gives.

A pin's voltage is a straight line over a step of the plant. Values are in the unit of what the sensor measures and go
through the sensor's line to the pin, as in the plant (`Plant.analog_line`).
"""

from ranger_sim.harness.faults.sensor import SignalFault

# of NoiseSource's normal numbers (plant/sensors/noise.py); a plant with wider noise sets a wider limit
MOST_DEVIATIONS = 3.7


class VoltageFault(SignalFault):
    """A signal instead of what the sensor on one analog input measures. A machine makes modes of it for what its
    sensors measure: `mode_classes(VoltageFault, kind, quantity)` of sensor.py.
    """

    def connect(self) -> None:
        self.voltage: int = self.place.details["voltage"]
        self.check_range()
        self.zero_V, self.slope_V, self.noise_V = self.robot.plant.analog_line(self.voltage)
        self.started = False
        self.true_end_V = 0.0  # at the end of the latest step, as the sensor gives it
        self.shown_end_V = 0.0

    def check_range(self) -> None:
        """UserError for limits that the sensor never reaches."""

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.signal = self.new_signal()
        self.started = False

    def after(self, start_ns: int, end_ns: int) -> None:
        plant, place = self.robot.plant, self.voltage
        starts, ends = plant.analog_start, plant.analog_end
        if not self.started:
            self.started = True
            self.signal.begin(self.value(starts[place]), start_ns)
            self.shown_end_V = self._instead(starts[place], start_ns)
        self.true_end_V = ends[place]
        starts[place] = self.shown_end_V
        self.shown_end_V = self._instead(self.true_end_V, end_ns)
        ends[place] = self.shown_end_V

    def value(self, volts: float) -> float:
        """What the sensor measures at this voltage."""
        return (volts - self.zero_V) / self.slope_V

    def _instead(self, volts: float, now_ns: int) -> float:
        """The voltage that replaces the sensor's."""
        true = self.value(volts)
        shown = self.signal.shown(true, now_ns)
        if shown == true:
            return volts
        self.note(now_ns, shown - true)
        return self.zero_V + self.slope_V * shown

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether the voltage matches the plant's present state, except the sensor's noise."""
        plant, place = self.robot.plant, self.voltage
        if self.started:
            plant.analog_start[place] = self.true_end_V
            self.started = False
        expected_V = self.zero_V + self.slope_V * plant.analog_value(place)
        noise_V = MOST_DEVIATIONS * self.noise_V + 1e-9
        return bool(abs(plant.analog_end[place] - expected_V) <= noise_V)
