"""Hidden effects of three machines that a user wrote, in data of separate integrators: what is named, and how well.

    python -m tests.sysid.hidden_effects --seeds 3
    python -m tests.sysid.hidden_effects --only "elastic joint" --seeds 10 --short

A line for each machine and effect: how often it was named first, how often its 95 % interval holds the true value, the
median error of the value, and the processor time.
"""

import argparse
import dataclasses
import sys

import numpy as np

from ranger_sim.foundation.wallclock import process_cpu_s
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid import machines_of_a_user, other_machines


@dataclasses.dataclass(frozen=True)
class Case:
    """cause: what is hidden; names: causes that are right, each with its coefficient; true: its value."""

    make: object
    machine: type
    cause: str
    size: float
    names: tuple[tuple[str, str], ...]
    coefficient: str = ""
    true: float = 0.0

    @property
    def title(self):
        return f"{self.machine.name} {self.cause}"

    def found(self, seed, **more):
        run, other = (self.make(self.cause, self.size, each, **more) for each in (seed, seed + 100))
        return diagnose(self.machine(), [run], [other])

    def named(self, result):
        """The first cause, where it is a right one."""
        first = result.causes[0] if result.causes else None
        return first if first is not None and (first.name, first.at) in self.names else None


STAND = (other_machines.thrust_stand, machines_of_a_user.ThrustStand)
ROD = (other_machines.heated_rod, machines_of_a_user.HeatedRod)
SHORT = {"elastic-joint": {"seconds": 6.0}, "thrust-stand": {"seconds": 10.0}, "heated-rod": {}}
JOINT = (other_machines.elastic_joint, machines_of_a_user.ElasticJoint)
CASES = (
    Case(*STAND, "none", 0.0, ()),
    Case(*STAND, "heating", 0.4, (("resistance_heating", "winding"),), "ohm_per_A2", 0.145 * 0.4 / 100.0),
    Case(*STAND, "lag", 0.05, (("sensor_lag", "thrust_N"),), "lag_s", 0.05),
    Case(*STAND, "offset", 0.1, (("sensor_offset", "thrust_N"),), "offset_N", 0.1),
    Case(*STAND, "coulomb", 0.004, (("coulomb_friction", "w"), ("direction_friction", "w")), "coulomb_torque", 0.004),
    Case(*STAND, "warming", 1.0, (("parameter_drift", "b"),), "change_1e-5Nms", -2.1),
    Case(*STAND, "seizing", 0.5, (("parameter_drift", "b"),), "change_1e-5Nms", 1.05),
    Case(*STAND, "late", 0.2, (("input_lag", "V"),), "lag_s", 0.2),
    Case(*ROD, "none", 0.0, ()),
    Case(*ROD, "radiation", 2e-9, (("radiation", "hot end"),), "nW_per_K4", 2.0),
    Case(*ROD, "heater", 0.05, ()),  # what scales heater, capacities and conductances alike cannot be seen
    Case(*ROD, "drift", 1.0, (("sensor_drift", "cold_C"),), "drift_C_per_s", 1.0 / 6000.0),
    Case(*ROD, "fouling", 1e-4, (("parameter_drift", "h2"),)),
    Case(*ROD, "opening", 0.2, (("parameter_drift", "h2"),), "change_W_per_K", 0.07),
    Case(*ROD, "late", 10.0, (("input_lag", "P"),), "lag_s", 10.0),
    Case(*ROD, "late", 60.0, (("input_lag", "P"),), "lag_s", 60.0),
    Case(*JOINT, "none", 0.0, ()),
    Case(*JOINT, "cubic", 3000.0, (("stiffening", "gear"),), "Nm_per_rad3", 3000.0),
    Case(*JOINT, "gravity", 0.5, (("once_per_turn", "link_rate"),), "sine_torque", -0.5),
    Case(*JOINT, "drag", 0.02, (("drag", "link_rate"),), "quadratic_torque_s2", 0.02),
    Case(*JOINT, "softening", -0.5, (("parameter_drift", "K"),), "drift_Nm_per_rad_per_s", -0.5),
    Case(*JOINT, "slipping", 0.01, (("sensor_drift", "link_rad"),), "change_rad", 0.01),
    Case(*JOINT, "leaning", 0.0005, (("input_offset", "u"),), "change", 0.0005),
    Case(*JOINT, "cracking", -4.0, (("parameter_drift", "K"),), "change_Nm_per_rad", -4.0),
    Case(*JOINT, "scale", 0.02, (("sensor_scale", "link_rad"),), "share", 0.02),
)


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=2, help="of each case")
    options.add_argument("--first", type=int, default=1)
    options.add_argument("--only", default="", help="cases whose title has this")
    options.add_argument("--short", action="store_true", help="recordings of 6 and 10 s instead of 20 s")
    given = options.parse_args()
    for case in CASES:
        if given.only not in case.title:
            continue
        right = inside = 0
        errors, names, before = [], [], process_cpu_s()
        for seed in range(given.first, given.first + given.seeds):
            result = case.found(seed, **(SHORT[case.machine.name] if given.short else {})).result
            first = case.named(result)
            names.append(" + ".join(each.name for each in result.causes) or ("abstains" if result.detected else "-"))
            right += first is not None if case.names else not result.detected
            if first is not None and case.coefficient in first.parameters:
                value = first.parameters[case.coefficient]
                inside += value.ci95[0] <= case.true <= value.ci95[1]
                errors.append(abs(value.value / case.true - 1.0))
        took = (process_cpu_s() - before) / given.seeds
        middle = f"{np.median(errors):.1%}" if errors else ""
        sys.stdout.write(
            f"{case.title:26} {case.size:8g}  right {right}/{given.seeds}  interval {inside}/{len(errors)}  "
            f"error {middle:6} {took:5.1f} s  {', '.join(dict.fromkeys(names))}\n"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
