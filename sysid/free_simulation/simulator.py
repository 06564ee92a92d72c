"""A machine's steps and outputs, of all samples of a recording at once, and their derivatives by differences."""

import copy
import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation.declared import DeclaredMachine
from ranger_sim.sysid.free_simulation.integration import Quantities
from ranger_sim.sysid.free_simulation.predictor import Jacobians
from ranger_sim.sysid.free_simulation.terms import Port, into, on, shown

NUDGE = 1e-6  # of a quantity's size: step of a central difference


@dataclasses.dataclass(frozen=True)
class Numerics:
    """How a simulator steps: parts of a sample; inputs that are held, and on cubics; share of what is open at
    standstill."""

    parts: int
    held: frozenset[str]
    curved: frozenset[str]
    open_share: float = 1.0

    @property
    def held_ports(self) -> frozenset[str]:
        """Ports of the inputs that are held."""
        return frozenset(into(name) for name in self.held)


class Simulator:
    """A machine on the inputs of one recording.

    n samples, s states, i noisy inputs, p parameters, o outputs, q ports: the machine's own and those that the engine
    adds at every output, input and joint.
    """

    def __init__(self, machine: DeclaredMachine, table: Table, inputs: Mapping[str, Array]) -> None:
        """inputs: (n,) by name."""
        self.machine, self.table, self.step_s = machine, table, table.step_s
        self.inputs = inputs
        held = {*machine.held_inputs, *(name for name in inputs if signals.stays(table, inputs[name]))}
        curved = {name for name in inputs if name not in held and signals.is_smooth(table, inputs[name])}
        self.numerics = Numerics(machine.parts, frozenset(held), frozenset(curved))
        self.inside = np.zeros(len(table))  # 1 where a step has neighbours on both sides in its run
        for run in table.runs:
            self.inside[run.start + 1 : run.stop - 2] = 1.0
        self.names = [known.name for known in machine.parameters]
        self.noisy = list(machine.noisy_inputs)
        self.ports = (*machine.ports, *_own_ports(machine, list(inputs)))

    def stepping(self, numerics: Numerics) -> "Simulator":
        """The same with other numerics."""
        new = copy.copy(self)
        new.numerics = numerics
        return new

    def is_held(self) -> np.ndarray:
        """(q,) flags: the port of an input that is held."""
        return np.array([port.name in self.numerics.held_ports for port in self.ports], dtype=bool)

    def at(self, x: Array, u: Array, p: Array, ports: Array) -> tuple[Array, Array]:
        """(f, h) as (m, n, s) and (m, n, o). x: (m, n, s), u: (m, n, i), p: (m, n or 1, p), ports: (m, n or 1, q)."""
        machine = self.machine
        shape = np.broadcast_shapes(x.shape[:2], u.shape[:2], p.shape[:2], ports.shape[:2])
        states = {name: x[..., i] for i, name in enumerate(machine.states)}
        values = {name: p[..., i] for i, name in enumerate(self.names)}
        given = {name: column[None] for name, column in self.inputs.items()}
        given |= {name: u[..., i] for i, name in enumerate(self.noisy)}
        at_ports = {each.name: ports[..., i] for i, each in enumerate(self.ports)}
        given = {name: column + at_ports[into(name)] for name, column in given.items()}
        given |= at_ports
        between = {name: self._between_samples(name, c) for name, c in given.items()}
        after: Quantities = states
        for part in range(self.numerics.parts):
            share = (part + 0.5) / self.numerics.parts
            middle = {name: at(share) for name, at in between.items()}
            after = dict(machine.step(after, middle, values, self.step_s / self.numerics.parts))
            for joint in machine.joints:
                inertia = values[joint.inertia] if isinstance(joint.inertia, str) else joint.inertia or 1.0
                after[joint.rate] = (
                    after[joint.rate] + middle[on(joint.rate)] * self.step_s / self.numerics.parts / inertia
                )
        seen = dict(machine.observe(states, given, values))
        for each in machine.outputs:
            seen[each.channel] = seen[each.channel] + at_ports[shown(each.channel)]
        f = np.stack([np.broadcast_to(after[name], shape) for name in machine.states], axis=-1)
        h = np.stack([np.broadcast_to(seen[each.channel], shape) for each in machine.outputs], axis=-1)
        return f, h

    def _between_samples(self, name: str, c: Array) -> Callable[[float], Array]:
        """An input or port between its samples (m, n), at a share of the way to the next: held, on a cubic through its
        neighbours where the samples lie on one, or on a straight line."""
        if name in self.numerics.held or name in self.numerics.held_ports:
            return lambda share: c
        after = np.concatenate((c[:, 1:], c[:, -1:]), axis=1)
        if name not in self.numerics.curved:
            return lambda share: c + share * (after - c)
        before, second = (
            np.concatenate(each, axis=1) for each in ((c[:, :1], c[:, :-1]), (after[:, 1:], after[:, -1:]))
        )
        inside = self.inside if c.shape[1] > 1 else np.zeros(1)
        bend = after - 2.0 * c + before, second - 2.0 * after + c

        def at(share: float) -> Array:
            rest = 1.0 - share
            curve = (rest * (rest * rest - 1.0) * bend[0] + share * (share * share - 1.0) * bend[1]) / 6.0
            return np.asarray(c + share * (after - c) + inside * curve)

        return at

    def linearised(self, x: Array, u: Array, p: Array, ports: Array, sizes: tuple[Array, Array, Array]) -> Jacobians:
        """By central differences. x: (n, s), u: (n, i), p: (p,), ports: (n or 1, q); sizes: of x, u and p."""
        given = [x[None], u[None], p[None, None], ports[None]]
        f, h = self.at(*given)

        def derivative(which: int, sizes: Array, some: Sequence[int]) -> tuple[Array, Array]:
            if not len(some):
                return np.zeros((*f.shape[1:], 0)), np.zeros((*h.shape[1:], 0))
            columns = []
            for number in some:
                nudge = NUDGE * sizes[number]
                up, down = given[which].copy(), given[which].copy()
                up[..., number] += nudge
                down[..., number] -= nudge
                high = self.at(*(up if i == which else each for i, each in enumerate(given)))
                low = self.at(*(down if i == which else each for i, each in enumerate(given)))
                columns.append([(a[0] - b[0]) / (2.0 * NUDGE * sizes[number]) for a, b in zip(high, low, strict=True)])
            return np.stack([a for a, _ in columns], axis=-1), np.stack([b for _, b in columns], axis=-1)

        (f_x, h_x), (f_u, h_u), (f_p, h_p) = (
            derivative(which, each, range(len(each))) for which, each in enumerate(sizes)
        )
        # What the engine adds itself is known: an output's port moves it alone, a noisy input's as its noise does.
        f_q, h_q = np.zeros((*f.shape[1:], len(self.ports))), np.zeros((*h.shape[1:], len(self.ports)))
        names = [each.name for each in self.ports]
        for number, each in enumerate(self.machine.outputs):
            h_q[:, number, names.index(shown(each.channel))] = 1.0
        for number, name in enumerate(self.noisy):
            place = names.index(into(name))
            f_q[:, :, place], h_q[:, :, place] = f_u[:, :, number], h_u[:, :, number]
        known = {shown(each.channel) for each in self.machine.outputs} | {into(name) for name in self.noisy}
        rest = [number for number, name in enumerate(names) if name not in known]
        f_q[:, :, rest], h_q[:, :, rest] = derivative(3, np.ones(len(names)), rest)
        return Jacobians(f[0], h[0], f_x, f_u, f_p, f_q, h_x, h_u, h_p, h_q)


def _own_ports(machine: DeclaredMachine, inputs: Sequence[str]) -> list[Port]:
    """The ports that the engine adds to a machine."""
    made = [Port(shown(each.channel), each.unit, "sensor") for each in machine.outputs]
    made += [Port(into(name), "", "input") for name in inputs]
    return made + [Port(on(each.rate), "", "mechanical") for each in machine.joints]
