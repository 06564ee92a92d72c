"""The motor bench's diagnosis with one balance taken out of the machine: what a bound must refuse.

    python -m tests.blind.answers --data DIR/data --by tests.blind.deaf:without_E --out ANSWERS

The same diagnosis on the same recordings, whose machine has no equation of that letter.
"""

import dataclasses

from ranger_sim import diagnose
from ranger_sim.sysid.machines.motor_bench import MotorBench


class Without:
    """A machine without the equations of one letter; effects that show in no other are not looked for."""

    def __init__(self, machine, letter):
        self.machine, self.letter = machine, letter
        self.name = f"{machine.name} without balance {letter}"
        self.quantities, self.parameters = machine.quantities, machine.parameters

    def prepare(self, table):
        recording = self.machine.prepare(table)
        kept = {name: each for name, each in recording.equations.items() if each.letter != self.letter}
        return dataclasses.replace(recording, equations=kept)

    def generic(self, recording):
        there = self.machine.generic(recording)
        return {name: there[name] for name in recording.equations}

    def effects(self, recordings):
        nominal = {each.name: each.value for each in self.parameters}
        made = [self._heard(effect, nominal) for effect in self.machine.effects(recordings)]
        return [each for each in made if each.columns(recordings[0], each.shapes[0], nominal)]

    def _heard(self, effect, nominal):
        """An effect without its columns in equations that are gone; a parameter of these keeps its nominal value."""

        def columns(recording, shape, values):
            every = effect.columns(recording, shape, nominal | values)
            return {name: column for name, column in every.items() if name in recording.equations}

        return dataclasses.replace(effect, columns=columns)


WITHOUT = {letter: Without(MotorBench(), letter) for letter in "EMT"}
WITHOUT_E, WITHOUT_M, WITHOUT_T = WITHOUT.values()


def without_E(files, holdout, experiment):  # noqa: N802  (the balance's letter)
    return diagnose(files, WITHOUT_E, holdout=holdout).to_dict()


def without_M(files, holdout, experiment):  # noqa: N802
    return diagnose(files, WITHOUT_M, holdout=holdout).to_dict()


def without_T(files, holdout, experiment):  # noqa: N802
    return diagnose(files, WITHOUT_T, holdout=holdout).to_dict()
