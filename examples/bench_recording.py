"""Two recordings to try `ranger-sim diagnose` on: the virtual motor bench, with a fault that you choose.

    python examples/bench_recording.py                  # run1.csv, run2.csv: a rotor that cogs
    python examples/bench_recording.py my-model.toml    # the [[term]] tables of a file of yours (plant/terms.py)
    ranger-sim diagnose run1.csv --holdout run2.csv --experiment motor-bench --out found

The second run has another course of voltage and brake. The bench's instruments have noise and counts.
"""

import pathlib
import sys

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import terms
from ranger_sim.sysid.benches.bench_terms import BenchTerms
from ranger_sim.sysid.benches.motor import BENCH_MOTOR
from ranger_sim.sysid.benches.motor_run import SECONDS, motor_run

COGGING = {"form": "cogging", "at": "hip_motor", "amplitude_Nm": 0.1, "periods_per_turn": 7.0, "phase_rad": 0.7}


def written(path: pathlib.Path, seed: int, fault: BenchTerms, seconds: float = SECONDS) -> None:
    """One run as a text table."""
    channels = motor_run(BENCH_MOTOR, seed, fault, seconds).channels
    time_s = channels["voltage_V"].time_s
    rows = np.column_stack([time_s, *(channel.value for channel in channels.values())])
    np.savetxt(path, rows, "%.9g", ",", header=",".join(["t_s", *channels]), comments="")


def main(arguments: list[str], folder: pathlib.Path = pathlib.Path(), seconds: float = SECONDS) -> int:
    """Writes both runs into `folder`; exit code 2 and a line for a model file that is wrong."""
    try:
        model = terms.load(arguments[0]) if arguments else terms.Model([COGGING])
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    fault = BenchTerms(model.terms)
    for each in fault.not_of_bench("motor-run"):
        print(f"{each} has no part in this bench", file=sys.stderr)
    for seed in (1, 2):
        written(folder / f"run{seed}.csv", seed, fault, seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
