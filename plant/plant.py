"""Interface of any machine's body for the harness: steps of equal length, and sensors that show each of them.

Ranger's is plant/ranger.py. Your own machine is a subclass; plain Python is enough, at any speed:

    class Arm(Plant):
        def __init__(self):
            Plant.__init__(self, step_ns=250_000, voltages=1, samples={"angle_rad": "rad"})
            self.bridges = [Drive()]
            self.encoders = [IncrementalEncoder("arm", 1024)]

        def step(self):
            ...  # integrate over [time_ns, time_ns + step_ns]
            self.time_ns += self.step_ns
"""

import array

import cython

from ranger_sim.foundation.numbers import integers


@cython.cclass
class Plant:
    """A body that moves in steps of `step_ns`. Subclasses fill in `step` and `fill_sample`.

    Towards the boards: `bridges` (Bridge) that their PWM and pins drive; `encoders`, each with its `edges`
    (IncrementalEncoder); `analog_start` and `analog_end`, each voltage at the ends of the step, V, a straight line
    between; `words` of digital sensors, constant during a step.

    Towards the harness: `sample_names`, {name: unit} of the values that `fill_sample` writes; `fell`: it cannot
    continue, with the reason in `fall_cause`; `steps` and `distance_m`, for machines that walk.

    Towards faults, for those that a machine's places take: `encoder_rad`, `analog_line`, `analog_value`.
    """

    # fields read at every step come first, next to each other
    time_ns: cython.longlong
    step_ns: cython.longlong
    steps: cython.longlong
    distance_m: cython.double
    fell: cython.bint
    words: cython.longlong[::1]
    analog_start: cython.double[::1]
    analog_end: cython.double[::1]
    fall_cause: str
    bridges: list
    encoders: list
    sample_names: object

    def __init__(self, step_ns, start_ns=0, voltages=0, words=0, samples=None) -> None:
        self.step_ns = step_ns
        self.time_ns = start_ns
        self.bridges = []
        self.encoders = []
        self.analog_start = array.array("d", [0.0]) * max(1, voltages)
        self.analog_end = array.array("d", [0.0]) * max(1, voltages)
        self.words = integers(max(1, words))
        self.sample_names = samples if samples is not None else {}
        self.steps = 0
        self.distance_m = 0.0
        self.fell = False
        self.fall_cause = ""

    @cython.ccall
    def step(self) -> object:
        """Integrate over [time_ns, time_ns + step_ns], then show it: time_ns, edges, voltages, words."""
        raise NotImplementedError

    def encoder_rad(self, number) -> float:
        """The angle (rad) that encoder `number` measures now."""
        raise NotImplementedError

    def analog_line(self, number) -> tuple[float, float, float]:
        """(V at 0, V per unit, standard deviation of its noise in V) of the sensor behind voltage `number`."""
        raise NotImplementedError

    def analog_value(self, number) -> float:
        """Present reading of that sensor, in its unit."""
        raise NotImplementedError

    @cython.ccall
    def fill_sample(self, row: cython.double[::1]) -> object:
        """Write the values named in `sample_names` into `row`, in their order."""
        return None
