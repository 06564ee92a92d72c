"""A machine's steps and outputs, of all samples of a recording at once, and their derivatives by differences."""

import copy
import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation.declared import DeclaredMachine
from ranger_sim.sysid.free_simulation.integration import Quantities
from ranger_sim.sysid.free_simulation.predictor import Jacobians, forcing
from ranger_sim.sysid.free_simulation.recording import Way
from ranger_sim.sysid.free_simulation.terms import Joint, Port, into, of, on, shown
from ranger_sim.sysid.machine import PARAMETER

NUDGE = 1e-6  # of a quantity's size: step of a central difference


@dataclasses.dataclass(frozen=True)
class Numerics:
    """How a simulator steps: parts of a sample; inputs that are held, on cubics, and means of the step that ends at
    their row; inputs of which it is not known where in a step they jump, and those that another clock stamps than the
    outputs, so that a row next to a jump may show them before it or after it; share of what is open at standstill."""

    parts: int
    held: frozenset[str]
    curved: frozenset[str]
    means: frozenset[str] = frozenset()
    unsure: frozenset[str] = frozenset()
    apart: frozenset[str] = frozenset()
    open_share: float = 1.0

    @property
    def held_ports(self) -> frozenset[str]:
        """Ports of the inputs that are held."""
        return frozenset(into(name) for name in self.held)

    @property
    def mean_ports(self) -> frozenset[str]:
        """Ports of the inputs whose rows are means."""
        return frozenset(into(name) for name in self.means)

    @property
    def open_jumps(self) -> frozenset[str]:
        """Inputs of which a jump's place or row is not known."""
        return self.unsure | self.apart

    def between(self, name: str) -> Way:
        """How an input goes from a row to the next."""
        ways = ((self.held, Way.HELD), (self.means, Way.MEAN), (self.curved, Way.CUBIC))
        return next((way for names, way in ways if name in names), Way.LINE)

    def way(self, name: str) -> str:
        """The same in words, with what is not known of its jumps."""
        found = self.between(name).value
        found += ", jumps anywhere inside a step" if name in self.unsure else ""
        return found + (", jumps a row earlier or later than the outputs" if name in self.apart else "")


@dataclasses.dataclass(frozen=True)
class Driven:
    """Inputs and ports, (1, n) or one number for all samples, by name: at the samples, and in the middle of each part
    of a step."""

    samples: Quantities
    middles: list[dict[str, Array]]


class Simulator:
    """A machine on the inputs of one recording.

    n samples, s states, i noisy inputs, p parameters, o outputs, q ports: the machine's own and those that the engine
    adds at every output, input and joint.
    """

    def __init__(self, machine: DeclaredMachine, table: Table, inputs: dict[str, Array]) -> None:
        """inputs: (n,) by name."""
        self.machine, self.table, self.step_s = machine, table, table.step_s
        self.inputs = inputs
        known = {*machine.held_inputs, *machine.mean_inputs}
        self.staying = {name for name in inputs if signals.stays(table, inputs[name])} - known
        held = {*machine.held_inputs, *self.staying}
        settled = held | known
        curved = {name for name in inputs if name not in settled and signals.is_smooth(table, inputs[name])}
        self.curving = frozenset(curved)  # as they look; a controller may still hold them from row to row
        self.numerics = Numerics(machine.parts, frozenset(held), self.curving, frozenset(machine.mean_inputs))
        self.open_ways = [name for name in inputs if name not in settled and name not in curved]
        self.inside = np.zeros(len(table))  # 1 where a step has neighbours on both sides in its run
        for run in table.runs:
            self.inside[run.start + 1 : run.stop - 2] = 1.0
        self.jumps = {name: signals.jumps(table, inputs[name]) for name in inputs}
        self.names = [known.name for known in machine.parameters]
        self.noisy = list(machine.noisy_inputs)
        self.ports = (*machine.ports, *_own_ports(machine, list(inputs)))

    def stepping(self, numerics: Numerics) -> "Simulator":
        """The same with other numerics."""
        new = copy.copy(self)
        new.numerics = numerics
        return new

    @property
    def held_ports(self) -> frozenset[int]:
        """Numbers of the ports of the inputs that are held."""
        return self._numbers(self.numerics.held_ports)

    @property
    def mean_ports(self) -> frozenset[int]:
        """Numbers of the ports of the inputs whose rows are means."""
        return self._numbers(self.numerics.mean_ports)

    def forcing(self, lin: Jacobians, entering: Mapping[int, Array]) -> tuple[Array, Array]:
        """((n, s, k), (n, o, k)) forcings of what enters, (n, k) by number of its port."""
        return forcing(lin, entering, self.held_ports, self.mean_ports)

    def _numbers(self, names: frozenset[str]) -> frozenset[int]:
        return frozenset(number for number, port in enumerate(self.ports) if port.name in names)

    def shown_at_once(self, u: Array, p: Array) -> list[str]:
        """Inputs that jump and that an output shows in the same row. u: (n, i), p: (p,)."""
        nothing = np.zeros((len(self.table), len(self.ports)))
        states = {name: np.zeros((1, len(self.table))) for name in self.machine.states}
        values = {name: p[None, None, i] for i, name in enumerate(self.names)}
        found = []
        for number, port in enumerate(self.ports):
            name = next((each for each in self.inputs if into(each) == port.name), "")
            if not name or not np.any(self.jumps[name]):
                continue
            moved = nothing.copy()
            moved[:, number] = 1.0
            with np.errstate(all="ignore"):
                plain, other = (self.machine.observe(states, self.driven(u, each).samples, values)
                                for each in (nothing, moved))  # fmt: skip
            if any(not np.array_equal(plain[each], other[each], equal_nan=True) for each in plain):
                found.append(name)
        return found

    def ways(self, at_once: Sequence[str] = ()) -> list[Numerics]:
        """This way between samples first, and others for each input of which the data do not show it.

        at_once: inputs that jump and that an output shows in the same row; their clock may be another one.

        Known are inputs that the machine holds. A smooth one is on a cubic, or a controller that computes it once a row
        holds it. One that stays at a value and jumps is held, or jumps
        between the rows: a step of a slow log is somewhere before the row that first shows it, half a row on average.
        Of the others the row may be a point of straight lines, held until the next row, or the mean of the step that
        ends there; where they jump, the place of the jump inside a step may be open.
        """
        now, made = self.numerics, [self.numerics]
        for name in sorted(self.staying):
            alone = frozenset({name})
            held = dataclasses.replace(now, held=now.held | alone, unsure=now.unsure - alone)
            between = dataclasses.replace(now, held=now.held - alone, unsure=now.unsure | alone)
            made += [each for each in (held, between) if each != now]
        made += [dataclasses.replace(now, held=now.held ^ {name}) for name in sorted(self.curving)]
        for name in self.open_ways:
            alone = frozenset({name})
            lines = dataclasses.replace(now, held=now.held - alone, means=now.means - alone, unsure=now.unsure - alone)
            some = [lines, dataclasses.replace(lines, held=lines.held | alone)]
            some.append(dataclasses.replace(lines, means=lines.means | alone))
            if np.any(self.jumps[name]):
                some += [dataclasses.replace(each, unsure=lines.unsure | alone) for each in some]
            made += [each for each in some if each != now]
        return made + [dataclasses.replace(now, apart=now.apart ^ {name}) for name in at_once]

    def driven(self, u: Array, ports: Array) -> Driven:
        """Inputs and ports. u: (n, i), ports: (n, q)."""
        given = {name: column[None] for name, column in self.inputs.items()}
        given |= {name: u[None, :, i] for i, name in enumerate(self.noisy)}
        # what is the same at all samples, as nothing at most ports, is one number
        at_ports = {
            each.name: ports[None, :1, i] if np.all(ports[:, i] == ports[0, i]) else ports[None, :, i]
            for i, each in enumerate(self.ports)
        }
        given = {name: column + at_ports[into(name)] for name, column in given.items()}
        given |= at_ports
        between = {name: self._between_samples(name, c) for name, c in given.items()}
        shares = [(part + 0.5) / self.numerics.parts for part in range(self.numerics.parts)]
        middles = [{name: at(share) for name, at in between.items()} for share in shares]
        for joint in self.machine.joints:
            if joint.drive:
                for each in (given, *middles):
                    each[joint.drive] = each[joint.drive] + each[on(joint.rate)]
        return Driven(given, middles)

    def at(self, x: Array, p: Array, driven: Driven) -> tuple[Array, Array]:
        """(f, h) as (n, s) and (n, o). x: (n, s), p: (p,)."""
        machine, shape = self.machine, (1, len(x))
        states = {name: x[None, :, i] for i, name in enumerate(machine.states)}
        known = {name: p[None, None, i] for i, name in enumerate(self.names)}
        after: Quantities = states
        part_s = self.step_s / self.numerics.parts
        for middle in driven.middles:
            values = {name: value + middle[of(name)] for name, value in known.items()}
            # half of a joint's push before the step and half after it: the position gets its share
            pushed = {joint.rate: 0.5 * part_s * middle[on(joint.rate)] / self._inertia(joint, values)
                      for joint in machine.joints if not joint.drive}  # fmt: skip
            before = {**after, **{name: after[name] + push for name, push in pushed.items()}}
            after = {
                name: np.broadcast_to(each, shape)
                for name, each in machine.step(before, middle, values, part_s).items()
            }
            after |= {name: after[name] + push for name, push in pushed.items()}
        values = {name: value + driven.samples[of(name)] for name, value in known.items()}
        seen = dict(machine.observe(states, driven.samples, values))
        for each in machine.outputs:
            seen[each.channel] = seen[each.channel] + driven.samples[shown(each.channel)]
        f = np.stack([after[name][0] for name in machine.states], axis=-1)
        h = np.stack([np.broadcast_to(seen[each.channel], shape)[0] for each in machine.outputs], axis=-1)
        return f, h

    def _inertia(self, joint: Joint, values: Quantities) -> Array | float:
        return values[joint.inertia] if isinstance(joint.inertia, str) else joint.inertia or 1.0

    def _between_samples(self, name: str, c: Array) -> Callable[[float], Array]:
        """An input or port between its samples (m, n), at a share of the way to the next: held, on a cubic through its
        neighbours where the samples lie on one, or on a straight line."""
        if name in self.numerics.held or name in self.numerics.held_ports:
            return lambda share: c
        after = np.concatenate((c[:, 1:], c[:, -1:]), axis=1)
        if name in self.numerics.means or name in self.numerics.mean_ports:
            return lambda share: after
        rise = after - c
        if name not in self.numerics.curved:
            return lambda share: c + share * rise
        before, second = (
            np.concatenate(each, axis=1) for each in ((c[:, :1], c[:, :-1]), (after[:, 1:], after[:, -1:]))
        )
        inside = self.inside if c.shape[1] > 1 else np.zeros(1)
        bend = after - 2.0 * c + before, second - 2.0 * after + c

        def at(share: float) -> Array:
            rest = 1.0 - share
            curve = (rest * (rest * rest - 1.0) * bend[0] + share * (share * share - 1.0) * bend[1]) / 6.0
            return np.asarray(c + share * rise + inside * curve)

        return at

    def linearised(
        self,
        x: Array,
        u: Array,
        p: Array,
        ports: Array,
        sizes: tuple[Array, Array, Array],
        by: Iterable[int],
        central: bool = True,
    ) -> Jacobians:
        """By central differences, or by simple ones at half the price. x: (n, s), u: (n, i), p: (p,), ports: (n, q);
        sizes: of x, u and p.

        by: numbers of the ports that have derivatives; those of the others are 0.
        """
        driven = self.driven(u, ports)
        f, h = self.at(x, p, driven)

        def derivative(which: int, size: float, number: int) -> tuple[Array, Array]:
            """By x, p, u or a port."""
            ends = []
            for nudge in (NUDGE * size, -NUDGE * size)[: 1 + central]:
                given = [x, p, u, ports]
                given[which] = given[which].copy()
                given[which][..., number] += nudge
                there = driven if which < 2 else self.driven(given[2], given[3])
                ends.append(self.at(given[0], given[1], there))
            (f_up, h_up), (f_down, h_down) = ends if central else (*ends, (f, h))
            width = (1 + central) * NUDGE * size
            return (f_up - f_down) / width, (h_up - h_down) / width

        def stacked(which: int, sizes: Array) -> tuple[Array, Array]:
            f_by, h_by = np.zeros((*f.shape, len(sizes))), np.zeros((*h.shape, len(sizes)))
            for number, size in enumerate(sizes):
                f_by[:, :, number], h_by[:, :, number] = derivative(which, size, number)
            return f_by, h_by

        (f_x, h_x), (f_u, h_u), (f_p, h_p) = stacked(0, sizes[0]), stacked(2, sizes[1]), stacked(1, sizes[2])
        f_q, h_q = np.zeros((*f.shape, len(self.ports))), np.zeros((*h.shape, len(self.ports)))
        outputs = {shown(each.channel): number for number, each in enumerate(self.machine.outputs)}
        noisy = {into(name): number for number, name in enumerate(self.noisy)}
        own = {of(name): number for number, name in enumerate(self.names)}
        for number in by:
            name = self.ports[number].name
            # what the engine adds itself is known: an output's port moves it alone, a noisy input's as its noise does,
            # and a parameter's as the parameter
            if name in outputs:
                h_q[:, outputs[name], number] = 1.0
            elif name in noisy:
                f_q[:, :, number], h_q[:, :, number] = f_u[:, :, noisy[name]], h_u[:, :, noisy[name]]
            elif name in own:
                f_q[:, :, number], h_q[:, :, number] = f_p[:, :, own[name]], h_p[:, :, own[name]]
            else:
                f_q[:, :, number], h_q[:, :, number] = derivative(3, 1.0, number)
        return Jacobians(f, h, f_x, f_u, f_p, f_q, h_x, h_u, h_p, h_q)


def _own_ports(machine: DeclaredMachine, inputs: Sequence[str]) -> list[Port]:
    """The ports that the engine adds to a machine."""
    made = [Port(shown(each.channel), each.unit, "sensor") for each in machine.outputs]
    made += [Port(into(name), "", "input") for name in inputs]
    made += [Port(on(each.rate), "", "mechanical") for each in machine.joints]
    return made + [Port(of(each.name), each.unit, PARAMETER) for each in machine.parameters]
