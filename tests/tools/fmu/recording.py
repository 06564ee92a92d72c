"""What the boards put out and the sensors showed in every step of a walk, as the unit's inputs and outputs.

Read from the plant itself, between its steps; shares nothing with tools/fmu but the names.
"""

import contextlib

from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.plant.electrics.drive import PWM_WRITE, ROW, WATCHDOG_EDGE
from ranger_sim.plant.wiring_points import ANALOG_NAMES, ENCODER_NAMES, MOTOR_NAMES, WORD_NAMES
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario


class Recorder(StepWatch):
    """`inputs` and `outputs`: a dictionary for each step."""

    def __init__(self, robot):
        super().__init__()
        self.robot = robot
        self.inputs, self.outputs = [], []
        self.writes, self.edges, self.off_ns = {}, {}, {}
        self.held = True

    def before_step(self, now_ns):
        self.held = not self.robot.operator.released
        for name, drive in zip(MOTOR_NAMES, self.robot.plant.bridges, strict=True):
            registers, delay_ns, off_ns = (drive.mr2, drive.mr6, drive.mr0), 0, drive.power_off_ns
            for row in range(0, ROW * drive.count, ROW):
                time, kind, *numbers = drive.changes[row : row + ROW]
                if kind == PWM_WRITE:
                    registers, delay_ns = numbers, max(0, time - now_ns)
                elif kind == WATCHDOG_EDGE:
                    off_ns = time + drive.watchdog_ns
            self.writes[name] = (*registers, delay_ns * 1e-9)
            moved = off_ns != self.off_ns.get(name, 0)
            self.off_ns[name] = off_ns
            self.edges[name] = (moved, (off_ns - drive.watchdog_ns - now_ns) * 1e-9 if moved else 0.0)

    def after_step(self, start_ns, end_ns):
        plant = self.robot.plant
        inputs = {"held.now": self.held, "imu.mode": plant.imu.mode}
        for name, drive in zip(MOTOR_NAMES, plant.bridges, strict=True):
            for key, value in zip(("match_2", "match_6", "period", "delay_s"), self.writes[name], strict=True):
                inputs[f"{name}.{key}"] = value
            inputs[f"{name}.low_side_2"], inputs[f"{name}.low_side_6"] = drive.enable2, drive.enable6
            inputs[f"{name}.watchdog"], inputs[f"{name}.watchdog_delay_s"] = self.edges[name]
        outputs = {f"sensor.{name}_V": volts for name, volts in zip(ANALOG_NAMES, plant.analog_end, strict=True)}
        outputs |= {f"sensor.{name}": word for name, word in zip(WORD_NAMES, plant.words, strict=True)}
        outputs |= {f"sensor.{n}_edges": each.cell for n, each in zip(ENCODER_NAMES, plant.encoders, strict=True)}
        outputs |= {"sensor.imu_roll_rad": plant.imu.roll, "sensor.imu_rate_x_rad_s": plant.imu.rate_x}
        outputs |= {f"state.{name}": value for name, value in self.robot.quantities().items()}
        outputs |= {"state.distance_m": plant.distance_m, "state.fell": plant.fell}
        self.inputs.append(inputs)
        self.outputs.append(outputs)


def recorded(scenario: Scenario, seconds: float):
    """(inputs, outputs) of the walk's first seconds, and its steps."""
    with contextlib.closing(Ranger(scenario)) as robot:
        recorder = Recorder(robot)
        robot.loop.watchers.append(recorder)
        robot.run_for(seconds)
        return recorder.inputs, recorder.outputs, robot.steps
