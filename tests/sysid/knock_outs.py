"""True terms left out of real recordings at graded shares: is each named, with which value, and what does it gain.

    python -m tests.sysid.knock_outs

Recordings: joints 1 and 4 of a UR10e (RANGER_SIM_DATA, or where the tests find them). A share of 1 leaves the whole of
joint 4's gravity out of the model; at 0 it is in the model, and nothing is to be named. Joint 1 has a friction that
bends with speed, which its model lacks.
"""

import sys

from tests.sysid.robot_joint import HeavyJoint, Joint
from tests.sysid.test_terms_left_out import GRAVITY_A, diagnosed

CASES = (
    *(("joint4", share, Joint, f"{share * GRAVITY_A:.4f} A") for share in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)),
    ("joint4", 1.0, HeavyJoint, "in the model"),
    ("joint1", 1.0, Joint, "friction bends"),
)


def main():
    sys.stdout.write("recording | left out | named first | value | held-out error before, after, black box\n")
    for name, share, machine, true in CASES:
        answer, error = diagnosed(name, share, machine)
        causes = answer["causes"]
        named = " + ".join(each["name"] for each in causes) or ("abstains" if answer["detected"] else "nothing")
        size = ""
        if causes:
            values = [
                f"{key} {each['value']:.3f} ({each['ci95'][0]:.3f} to {each['ci95'][1]:.3f})"
                for key, each in causes[0]["parameters"].items()
            ]
            size = values[0]
        errors = ", ".join(f"{100.0 * error[each]:.2f} %" for each in ("before", "after", "black_box") if error[each])
        sys.stdout.write(f"{name} | {true} | {named} | {size} | {errors}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
