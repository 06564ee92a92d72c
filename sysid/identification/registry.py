"""The benches by name: columns of each recording, and the parameters that it determines alone."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence

from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.sysid.benches import ankle_sine, leg, motor, pulley, springs
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification import ankle as fit_ankle
from ranger_sim.sysid.identification import legs as fit_legs
from ranger_sim.sysid.identification import motor as fit_motor
from ranger_sim.sysid.identification import springs as fit_springs
from ranger_sim.sysid.identification.blocks import Block, solve
from ranger_sim.sysid.identification.coverage import Machine


@dataclasses.dataclass(frozen=True)
class Bench:
    """One experiment. columns: of its recording beside the stamps; record: by the virtual bench; blocks: its residual.

    finds: the appendix's names of what is asked; known_from: benches whose result this one needs (none: by itself).
    """

    name: str
    title: str
    appendix: str
    columns: tuple[str, ...]
    finds: tuple[str, ...]
    record: Callable[[Machine, int], Dataset]
    blocks: Callable[[Dataset, float], Sequence[Block]]
    known_from: tuple[str, ...] = ()


def _swings(data: Dataset, gear: float) -> list[Block]:
    return [fit_legs.period_block(swing) for swing in fit_legs.swings(data)]


BENCHES = {
    bench.name: bench
    for bench in (
        Bench(
            "stall",
            "Motor held: resistance and contact drop",
            "8.3.1, figure 28",
            ("voltage_V", "current_A"),
            ("R", "V_c"),
            lambda machine, seed: motor.stall(machine.motor, seed, machine.terms),
            lambda data, gear: [fit_motor.stalled_block(data)],
        ),
        Bench(
            "cantilever",
            "Motor against a brake: torque constant, and all of table 3 at once",
            "8.2, 8.3.2, figures 26, 29, 31",
            ("voltage_V", "current_A", "speed_rad_per_s", "torque_Nm"),
            fit_motor.TABLE_3,
            lambda machine, seed: motor.cantilever(machine.motor, seed, machine.terms),
            lambda data, gear: [fit_motor.cantilever_block(data, gear)],
        ),
        Bench(
            "pulley",
            "Motor and a hanging mass: friction",
            "8.4, figure 30",
            ("current_A", "mass_kg", "side", "tapped", "speed_rad_per_s"),
            ("K", "C_1", "C_0", "mu"),
            lambda machine, seed: pulley.pulley(machine.motor, seed, terms=machine.terms),
            lambda data, gear: [fit_motor.pulley_block(data, gear)],
        ),
        Bench(
            "level",
            "Leg held level: first moment of mass",
            "7.2, figure 23",
            ("force_N", "inner"),
            ("outer_cm", "inner_cm"),
            lambda machine, seed: leg.level(machine.body, seed),
            lambda data, gear: [fit_legs.level_block(data)],
        ),
        Bench(
            "hang",
            "Leg hanging: centre of mass ahead of the leg",
            "7.2, figure 24",
            ("angle_rad", "inner"),
            ("outer_wm", "inner_wm"),
            lambda machine, seed: leg.hang(machine.body, seed),
            lambda data, gear: [fit_legs.hang_block(data)],
            ("level",),
        ),
        Bench(
            "pendulum",
            "Leg swinging: moment of inertia about the hip",
            "7.2, eq. 29, 30",
            ("angle_rad", "inner"),
            ("outer_J_hip", "inner_J_hip"),
            lambda machine, seed: leg.pendulum(machine.body, seed),
            _swings,
            ("level", "hang"),
        ),
        Bench(
            "hip-spring",
            "Leg pulled: the hip's spring",
            "7.3, figure 25 a",
            ("angle_rad", "force_N", "side", "outward"),
            ("k_h",),
            lambda machine, seed: springs.hip_spring(machine.body, seed, terms=machine.terms),
            lambda data, gear: [fit_springs.hip_block(data)],
        ),
        Bench(
            "ankle-spring",
            "Foot pulled with the motor held: the ankle's cable",
            "7.3, figure 25 b",
            ("angle_rad", "force_N", "side"),
            ("k_s",),
            lambda machine, seed: springs.ankle_spring(machine.body, seed, machine.terms),
            lambda data, gear: [fit_springs.ankle_block(data)],
        ),
        Bench(
            "ankle-sine",
            "Ankle that tracks a sine: foot, return spring, friction",
            "the robot's logs of 2015",
            fit_ankle.COLUMNS + ("motor_current_A",),
            ("J_foot", "k_r", "return_Nm", "ankle_C_0"),
            lambda machine, seed: ankle_sine.ankle_sine(seed=seed, terms=machine.terms),
            lambda data, gear: fit_ankle.sine_blocks(data),
        ),
    )
}  # fmt: skip


OF_TABLES = tuple(name for name in BENCHES if name != "ankle-sine")  # what tables 2 and 3 come from


def bench_of(name: str) -> Bench:
    """The bench of this name; UserError names those that there are."""
    try:
        return BENCHES[name]
    except KeyError:
        raise UserError(unknown("bench", name, BENCHES)) from None


def alone(
    bench: Bench,
    data: Dataset,
    known: Iterable[Parameter] = (),
    earlier: Iterable[Fit] = (),
    gear: float = fit_motor.GEAR,
    tell: Callable[[str], None] | None = None,
) -> Fit:
    """What one recording says. known: values with their uncertainty from elsewhere, by the fit's names."""
    blocks = bench.blocks(data, gear)
    asked = {parameter.name: parameter for block in blocks for parameter in block.parameters}
    given = []
    for each in known:
        if each.name not in asked:
            raise UserError(f"{bench.name}: {unknown('parameter', each.name, asked)}")
        own = asked[each.name]
        given.append(dataclasses.replace(own, value=each.value, uncertainty=each.uncertainty, scale=own.step))
    return solve(blocks, given, earlier, tell)


def by_virtual_benches(
    bench: Bench, machine: Machine, seed: int, gear: float = fit_motor.GEAR, tell: Callable[[str], None] | None = None
) -> tuple[dict[str, Dataset], dict[str, Fit]]:
    """Recordings and fits of a bench and of those that it needs, in the paper's order."""
    recordings: dict[str, Dataset] = {}
    fits: dict[str, Fit] = {}
    for name in (*bench.known_from, bench.name):
        one = BENCHES[name]
        recordings[name] = one.record(machine, seed)
        # a bench has what the last of those before it found; that one has weighed in the others
        earlier = [fits[one.known_from[-1]]] if one.known_from else []
        fits[name] = alone(one, recordings[name], earlier=earlier, gear=gear, tell=tell)
    return recordings, fits
