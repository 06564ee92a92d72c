"""Another simulator drives the body: `ranger-sim fmu body.fmu`, then this. Needs FMPy (pip install fmpy).

It prints when a robot that is let go without a controller falls, for three duties of the outer ankles' motor and two
masses.
"""

import sys

from fmpy import simulate_fmu

STEP_S = 0.002  # eight steps of the body, a slot of the main brain


def main() -> None:
    """A few runs of the unit."""
    unit = sys.argv[1] if len(sys.argv) > 1 else "body.fmu"
    for mass_kg in (9.91, 14.91):
        for counts in (0, 60, 120):  # of 600, for which lead 2 is at the battery's voltage
            found = simulate_fmu(
                unit,
                stop_time=5.0,
                output_interval=STEP_S,
                start_values={
                    "body.total_mass_kg": mass_kg,
                    "held.now": False,
                    "outer_ankle.watchdog": True,
                    "outer_ankle.match_2": counts,
                },
                output=["state.outer_A", "state.leg_outer_rad", "state.fell"],
            )
            print(
                f"{mass_kg:5.2f} kg, duty {counts / 600:.0%}: fell after {found['time'][-1]:.3f} s, "
                f"motor at most {max(abs(found['state.outer_A'])):.2f} A"
            )


if __name__ == "__main__":
    main()
