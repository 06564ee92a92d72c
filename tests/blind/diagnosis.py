"""The door to the diagnosis: (files, holdout, experiment) -> its JSON, as tests/blind/answers.py calls every method."""

from ranger_sim.sysid import readers
from ranger_sim.sysid.diagnose import diagnose as diagnose_tables
from ranger_sim.sysid.machines.motor_bench import MotorBench

MACHINES = {"motor-bench": MotorBench}


def diagnose(files, holdout, experiment):
    """What `ranger-sim diagnose --json` says, without its reports."""
    if experiment not in MACHINES:
        raise ValueError(f"there is no diagnosis of {experiment} yet")

    def tables(paths):
        datasets = [readers.read(path) for path in paths]
        return [dataset.table(dataset.channels) for dataset in datasets]

    return diagnose_tables(MACHINES[experiment](), tables(files), tables(holdout)).answer
