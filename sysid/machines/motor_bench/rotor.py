"""Effects that are periodic in the turn of the rotor or of the output."""

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Effect, Recording, Values
from ranger_sim.sysid.machines.forms import MOST_PERIODS, Shape, column

SAMPLES_A_WAVE = 4.0  # with fewer a sample's own interval and differences of samples change what a wave shows


def waves(r: Recording, gear: float, periods_per_turn: float, through_speed: bool = True) -> tuple[Array, Array]:
    """Cosine and sine of so many periods a turn of the rotor; nothing where samples do not follow them.

    through_speed: as much smaller as the speed's difference over two samples shows them.
    """
    advance = np.abs(periods_per_turn * gear * r.signals["w"]) * r.table.step_s  # rad of the wave in a sample
    size = np.where(advance < 2.0 * np.pi / SAMPLES_A_WAVE, 1.0, 0.0)
    if through_speed:
        size = size * np.sinc(advance / np.pi)
    angle = periods_per_turn * r.signals["angle"]
    return size * np.cos(angle), size * np.sin(angle)


def periodic(gear: float) -> list[Effect]:
    M = "mechanical"
    each = [{"periods_per_turn": float(n)} for n in range(1, MOST_PERIODS + 1)]

    def cogging(r: Recording, shape: Shape, _: Values) -> Columns:
        return {"mechanical": column(*waves(r, gear, shape["periods_per_turn"]))}

    def commutation(r: Recording, shape: Shape, v: Values) -> Columns:
        """K itself ripples: in the torque and in the voltage that the turning rotor makes."""
        k = v["torque_constant_Nm_per_A"]
        periods = shape["periods_per_turn"]
        return {
            "electric": column(*(k * r.signals["w"] * each for each in waves(r, gear, periods, through_speed=False))),
            "mechanical": column(*(k * r.signals["I"] * each for each in waves(r, gear, periods))),
        }

    def turn(r: Recording, shape: Shape, _: Values) -> Columns:
        angle = shape["periods_per_turn"] * r.signals["angle"] / gear
        return {"mechanical": column(np.cos(angle), np.sin(angle))}

    return [
        Effect("cogging", "hip_motor", M, ("cosine_Nm", "sine_Nm"), each, cogging, phase_is_free=True),
        Effect("commutation_ripple", "hip_motor", M, ("cosine", "sine"), each, commutation, phase_is_free=True),
        Effect("once_per_turn", "hip_joint", M, ("cosine_Nm", "sine_Nm"), each[:3], turn, phase_is_free=True),
    ]  # fmt: skip
