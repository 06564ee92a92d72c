"""python -m dev.body_speed: processor time of `MujocoBody` compared with bare MuJoCo, in turn in one process.

Both have the same timestep of 500 us and no input; the body has a drive, an encoder and a current at each actuator.
Prints a row for each model: simulated seconds per second of processor, the better of three turns.
"""

import pathlib
import sys

import mujoco

from ranger_sim.foundation import wallclock
from ranger_sim.harness.bodies.mapping import Drive, Encoder, Mapping, Voltage
from ranger_sim.harness.bodies.mujoco_body import STEP_NS, MujocoBody

ROBOTS = pathlib.Path(__file__).resolve().parents[1] / "examples" / "robots"
SECONDS, TURNS = 2.0, 3


def used_s(step, count: int) -> float:  # type: ignore[no-untyped-def]
    """Processor seconds of `count` steps."""
    started = wallclock.process_cpu_s()
    for _ in range(count):
        step()
    return wallclock.process_cpu_s() - started


def main() -> int:
    """The command."""
    count = round(SECONDS / (STEP_NS * 1e-9))
    for file in sorted(ROBOTS.glob("*.xml")):
        bare, shown = [], []
        for _ in range(TURNS):
            model = mujoco.MjModel.from_xml_path(str(file))
            model.opt.timestep = STEP_NS * 1e-9
            data = mujoco.MjData(model)
            actuators = [model.actuator(number) for number in range(model.nu)]
            joints = [model.joint(int(each.trnid[0])).name for each in actuators]
            names = [each.name for each in actuators]
            wires = Mapping([Drive(each) for each in names], [Encoder(each) for each in joints],
                            [Voltage(each, V_per_unit=0.1) for each in names])  # fmt: skip
            bare.append(used_s(lambda model=model, data=data: mujoco.mj_step(model, data), count))
            shown.append(used_s(MujocoBody(file, wires).step, count))
        alone, body = SECONDS / min(bare), SECONDS / min(shown)
        print(f"{file.stem:10} {len(names):2} actuators  bare {alone:6.0f}  body {body:6.0f}  {alone / body:.1f} x")
    return 0


if __name__ == "__main__":
    sys.exit(main())
