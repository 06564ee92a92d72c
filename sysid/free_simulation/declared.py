"""What a machine given by its simulator declares: its names, and the methods that a user writes."""

import abc
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation.integration import Quantities
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording
from ranger_sim.sysid.free_simulation.terms import Joint, Output, Port, Term, on
from ranger_sim.sysid.machine import Known, Quantity


class DeclaredMachine(abc.ABC):
    """A `Machine` (sysid/machine.py) that is an ordinary differential equation with measured inputs.

    A subclass defines the names below and the methods `inputs`, `first_guess`, `step`, `observe`, `terms`; and `loose`,
    `extra_signals` and `looked_over` when it needs them. All of these take and return arrays of any one shape: samples,
    and stacks of samples for the differences; they must work element by element.
    """

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Known, ...]
    states: tuple[str, ...]
    outputs: tuple[Output, ...]
    ports: tuple[Port, ...] = ()
    joints: tuple[Joint, ...] = ()  # where friction is sought, without a port or a term
    free_candidates: bool = True  # what every machine can have (candidates.py), next to its own terms
    impossible: Collection[str] = ()  # causes among these that this machine is known not to have
    # Inputs with noise, by name: its standard deviation, or None for the channel's own estimate
    noisy_inputs: Mapping[str, float | None] = {}
    # From one sample to the next inputs and ports are straight lines, but for those that a converter holds, and for
    # inputs that stay at a value and jump, in these data
    held_inputs: Collection[str] = ()
    mean_inputs: Collection[str] = ()  # a row has the mean of the step that ends there, as an averaging logger writes
    parts: int = 2  # steps from one sample to the next, each with the inputs of its own middle
    horizon_s: float = float("inf")  # after this time the state is free again: shorter for a model with large errors
    shortest_s: float | None = None  # least duration of a usable recording; None: 2 s, or of a fast one 400 rows
    window_s: float = 2.0  # over which the gain is measured in free simulation, or 50 samples

    @abc.abstractmethod
    def inputs(self, table: Table) -> dict[str, Array]:
        """Inputs of the simulator, (n,) by name: measured channels, or a target that its law follows."""

    @abc.abstractmethod
    def first_guess(self, table: Table) -> dict[str, Array]:
        """Rough states, (n,) by name: a measured angle and its smoothed slope are enough."""

    @abc.abstractmethod
    def step(self, x: Quantities, u: Quantities, p: Quantities, step_s: float) -> Quantities:
        """The states after a step, a sample or a part of it. u: inputs and ports in the step's middle."""

    @abc.abstractmethod
    def observe(self, x: Quantities, u: Quantities, p: Quantities) -> Quantities:
        """The outputs, by channel."""

    def terms(self, recordings: Sequence[SimulatedRecording]) -> list[Term]:
        """Candidate causes of this machine alone, with grids that suit these recordings."""
        return []

    def loose(self, x: Quantities, u: Quantities, p: Quantities, step_s: float) -> Quantities:
        """Deviations of states per step that the law leaves open, by name: where dry friction holds, for example."""
        return {}

    def extra_signals(self, along: dict[str, Array], table: Table) -> dict[str, Array]:
        """More signals along the trajectory for `terms`."""
        return {}

    def counts(self, along: Quantities, table: Table) -> dict[str, np.ndarray]:
        """By output, (n,): False for samples that carry no information on it; an output not listed always counts."""
        return {}

    def looked_over(self, recording: SimulatedRecording) -> dict[str, dict[str, Array]]:
        """For ports and equations, the signals over which a misfit is sought without a cause in mind."""
        everything = {name: recording.signals[name] for name in (*self.states, "t")}
        places = [each.name for each in self.ports] or [on(each.rate) for each in self.joints]
        return {each: everything for each in places or [each.channel for each in self.outputs]}
