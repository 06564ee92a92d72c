"""What each experiment calls its channels, and under which names files have them.

The names are those of `ranger-sim diagnose`; a file's own names are recognised where they are listed here, and named
by hand otherwise (`--map old=new`).
"""

import dataclasses
from collections.abc import Mapping, Sequence

from ranger_sim.foundation.user_error import DataError, unknown
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Channel, Dataset, Repair
from ranger_sim.sysid.machine import Quantity

WRITTEN_SAMPLES = 3  # the robot's log has a first and a last sample of what no board ever wrote


@dataclasses.dataclass(frozen=True)
class Name:
    """One channel of an experiment. needed: without it the experiment says nothing.

    also: what files call it; behind a minus what counts the other way round.
    """

    name: str
    unit: str
    meaning: str
    needed: bool = False
    also: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True)
class Experiment:
    """An experiment by name: what is done in it, and its channels."""

    name: str
    meaning: str
    channels: tuple[Name, ...]

    def __getitem__(self, name: str) -> Name:
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise DataError(f"{self.name}: {unknown('channel', name, (channel.name for channel in self.channels))}")


def _leg_names() -> tuple[Name, ...]:
    """The channels of a walk; `also`: variables of the robot's table (datatable/master/variables.csv)."""
    return (
        Name("hip_angle_rad", "rad", "inner leg against outer leg, positive ahead", also=("MCH_ANGLE",)),
        Name("hip_rate_rad_per_s", "rad/s", "its rate, by the incremental encoder", also=("MCH_ANG_RATE",)),
        Name("hip_motor_angle_rad", "rad", "hip motor's shaft over the gear", also=("MCH_MOTOR_POSITION",)),
        Name("hip_motor_rate_rad_per_s", "rad/s", "its rate", also=("MCH_MOTOR_VELOCITY",)),
        Name("outer_ankle_angle_rad", "rad", "outer ankle, 0 at the upper stop", also=("MCFO_RIGHT_ANKLE_ANGLE",)),
        Name("outer_ankle_rate_rad_per_s", "rad/s", "its rate", also=("MCFO_RIGHT_ANKLE_RATE",)),
        Name("outer_motor_angle_rad", "rad", "outer ankle motor over the gear", also=("MCFO_MOTOR_POSITION",)),
        Name("outer_motor_rate_rad_per_s", "rad/s", "its rate", also=("MCFO_MOTOR_VELOCITY",)),
        Name("inner_ankle_angle_rad", "rad", "inner ankle, 0 at the upper stop", also=("MCFI_MID_ANKLE_ANGLE",)),
        Name("inner_ankle_rate_rad_per_s", "rad/s", "its rate", also=("MCFI_ANKLE_RATE", "MCFI_MID_ANKLE_RATE")),
        Name("inner_motor_angle_rad", "rad", "inner ankle motor over the gear", also=("MCFI_MOTOR_POSITION",)),
        Name("inner_motor_rate_rad_per_s", "rad/s", "its rate", also=("MCFI_MOTOR_VELOCITY",)),
        Name(
            "outer_leg_angle_rad",
            "rad",
            "outer leg against the vertical, positive leaning forward",
            also=("outer_leg_abs_angle_gyro_rad", "-UI_ROLL"),
        ),
        Name("outer_leg_rate_rad_per_s", "rad/s", "its rate, by the gyro", also=("-UI_ANG_RATE_X",)),
        Name("hip_current_A", "A", "hip motor", also=("MCH_MOTOR_CURRENT",)),
        Name("outer_ankle_current_A", "A", "outer ankle motor", also=("MCFO_MOTOR_CURRENT",)),
        Name("inner_ankle_current_A", "A", "inner ankle motor", also=("MCFI_MOTOR_CURRENT",)),
        Name("hip_voltage_V", "V", "mean voltage at the hip motor"),
        Name("outer_ankle_voltage_V", "V", "mean voltage at the outer ankle motor"),
        Name("inner_ankle_voltage_V", "V", "mean voltage at the inner ankle motor"),
        Name("battery_voltage_V", "V", "supply as the hip board measures it", also=("MCH_BATT_VOLTAGE",)),
        Name("battery_current_A", "A", "supply current of all boards together"),
        Name("hip_battery_power_W", "W", "what the hip's stage takes", also=("MCH_BATT_POWER",)),
        Name("outer_ankle_battery_power_W", "W", "what the outer ankle's stage takes", also=("MCFO_BATT_POWER",)),
        Name("inner_ankle_battery_power_W", "W", "what the inner ankle's stage takes", also=("MCFI_BATT_POWER",)),
        Name("outer_contact", "", "outer feet on the ground, 0 or 1", also=("MCFO_LEFT_HS",)),
        Name("inner_contact", "", "inner feet on the ground, 0 or 1", also=("MCFI_RIGHT_HS",)),
        Name("walk_state", "", "state of the walking machine, by its number", also=("walk_fsm_state", "FSM_LEG")),
    )


_ALL = (
    Experiment(
        "motor-bench",
        "a motor with gearbox drives an inertia; speed and torque at the gearbox's output",
        (
            Name("voltage_V", "V", "mean voltage at the motor", True),
            Name("current_A", "A", "motor current", True, ("motor_current_A",)),
            Name("speed_rad_per_s", "rad/s", "of the gearbox's output", True),
            Name("torque_Nm", "Nm", "of the load on the gearbox's output, by a load cell", True),
            Name("temperature_C", "C", "of the motor's housing"),
            Name("motor_angle_rad", "rad", "of the motor's shaft"),
        ),
    ),
    Experiment(
        "leg-swing",
        "one leg swings about the held hip, driven by the hip motor or free",
        (
            Name("hip_angle_rad", "rad", "angle of the swinging leg", True),
            Name("current_A", "A", "hip motor", True, ("hip_current_A", "motor_current_A", "MCH_MOTOR_CURRENT")),
            Name("voltage_V", "V", "mean voltage at the hip motor", False, ("hip_voltage_V",)),
        ),
    ),
    Experiment(
        "ankle",
        "the robot hangs, an ankle follows a sine under the board's compliant law",
        (
            Name("joint_angle_rad", "rad", "ankle joint", True, ("ankle_angle_inner_rad", "inner_ankle_angle_rad")),
            Name("joint_rate_rad_per_s", "rad/s", "its rate, by the incremental encoder"),
            Name("motor_angle_rad", "rad", "motor's shaft over the gear: what the board feeds back"),
            Name("current_A", "A", "motor current", False, ("motor_current_A",)),
            Name("target_angle_rad", "rad", "angle asked for"),
            Name("target_rate_rad_per_s", "rad/s", "rate asked for"),
            Name("command_current_A", "A", "current at angle 0 and rate 0", False, ("cmd_ref_current_A",)),
            Name("command_stiffness_A_per_rad", "A/rad", "gain on the angle", False, ("cmd_stiffness_A_per_rad",)),
            Name("command_dampness_A_s_per_rad", "A s/rad", "gain on the rate", False, ("cmd_dampness_A_s_per_rad",)),
        ),
    ),
    Experiment("walk", "the robot walks; any of its channels", _leg_names()),
    Experiment(
        "positioning",
        "a motor moves a mass along a straight line under a position controller",
        (
            Name("position_m", "m", "of the mass", True, ("position_measured_m",)),
            Name("voltage_V", "V", "command to the drive, in proportion to its force", True,
                 ("motor_voltage_command_V",)),
            Name("reference_m", "m", "position asked for", False, ("position_reference_m",)),
            Name("pulse_N", "N", "known force in addition to the motor's", False, ("injected_force_pulse_N",)),
        ),
    ),
)  # fmt: skip
EXPERIMENTS = {experiment.name: experiment for experiment in _ALL}


def experiment(name: str) -> Experiment:
    """The experiment of this name; UserError with all names when there is none."""
    if name not in EXPERIMENTS:
        raise DataError(unknown("experiment", name, EXPERIMENTS))
    return EXPERIMENTS[name]


def named_for(dataset: Dataset, name: str) -> Dataset:
    """The dataset with its channels called as the experiment calls them; others keep their names.

    UserError when a needed channel is missing, or one has another unit.
    """
    wanted = experiment(name)
    found = {}
    repairs: list[Repair] = []
    renamed: dict[str, str] = {}  # {in the file: in the experiment}
    for expected in wanted.channels:
        names = (expected.name, *expected.also)
        source = next((each for each in names if _is_there(dataset, each, expected.name)), None)
        if source is None:
            if expected.needed:
                there = ", ".join(dataset.channels) or "none"
                raise DataError(
                    f"{dataset.name}: {wanted.name} needs {expected.name} ({expected.meaning}); there are {there}; "
                    f"--map NAME={expected.name} names it"
                )
            continue
        channel = dataset[source.removeprefix("-")]
        if channel.unit and channel.unit.replace(" ", "") != expected.unit.replace(" ", ""):
            raise DataError(f"{dataset.name}: {source} is in {channel.unit}, {expected.name} is in {expected.unit}")
        value = channel.value
        if source.startswith("-"):
            value = -value
            text = f"{channel.name} counts the other way round: its sign is turned"
            repairs.append(Repair(expected.name, "sign", len(value), text))
        if channel.name != expected.name:
            repairs.append(Repair(expected.name, "renamed", 0, f"{channel.name} is called {expected.name}"))
        found[expected.name] = dataclasses.replace(channel, name=expected.name, unit=expected.unit, value=value)
        renamed[channel.name] = expected.name
    named = _renamed(dataset, found, renamed, repairs)
    numbers = {each.name for each in wanted.channels if not each.unit}  # their files need no unit
    named.findings = [each for each in named.findings if each.kind != "no_unit" or each.channel not in numbers]
    return named


def named_by(dataset: Dataset, quantities: Sequence[Quantity]) -> Dataset:
    """The dataset with its channels called, and in the units, as a user's machine has them; others keep their names.

    A file's channel is in SI and has its unit in its name: "speed [rpm]" is speed_rad_per_s. A quantity "speed_rpm",
    "speed_rad_s", or "speed" in rad/s is that channel; the unit in a quantity's name counts where it has no known other
    one. DataError for a channel in another kind of unit.
    """
    found: dict[str, Channel] = {}
    repairs: list[Repair] = []
    renamed: dict[str, str] = {}
    for wanted in quantities:
        unit = (units.unit_of(wanted.unit) if wanted.unit else None) or units.split(wanted.name)[1]
        channel = dataset.channels.get(wanted.name) or _alike(dataset, wanted.name, unit)
        if channel is None:
            continue
        made, text = dataclasses.replace(channel, name=wanted.name), f"{channel.name} is called {wanted.name}"
        there = units.unit_of(channel.unit) if channel.unit else None
        if unit is not None and there is not None:
            if not unit.same_kind(there):
                text = f"{channel.name} is in {channel.unit}, {wanted.name} of the machine in {wanted.unit}"
                raise DataError(f"{dataset.name}: {text}")
            if not unit.is_si:
                value, resolution = (channel.value - unit.offset) / unit.factor, channel.resolution / unit.factor
                made = dataclasses.replace(made, value=value, resolution=resolution, unit=wanted.unit)
                text += f", in {wanted.unit}"
        if made.name != channel.name or made.unit != channel.unit:
            repairs.append(Repair(wanted.name, "renamed", 0, text))
        found[wanted.name] = made
        renamed[channel.name] = wanted.name
    return _renamed(dataset, found, renamed, repairs)


def _alike(dataset: Dataset, name: str, unit: units.Unit | None) -> Channel | None:
    """The channel that has this name but for the unit at its end, or has its unit in a row of its file and not in its
    name; unit: of a name without one."""
    stem, of_name = units.split(name)
    unit = of_name or unit
    if unit is None:
        return None
    bare = dataset.channels.get(stem)
    there = units.unit_of(bare.unit) if bare is not None and bare.unit else None
    return dataset.channels.get(units.si_name(stem, unit)) or (bare if there and unit.same_kind(there) else None)


def _renamed(
    dataset: Dataset, found: dict[str, Channel], renamed: Mapping[str, str], repairs: Sequence[Repair]
) -> Dataset:
    """The dataset with the `found` channels in place of others. renamed: {in the dataset: in `found`}."""
    channels = found | {key: channel for key, channel in dataset.channels.items() if key not in renamed}
    findings = [
        dataclasses.replace(each, channel=renamed.get(each.channel, each.channel))
        for each in dataset.findings
        # a state is a number, whatever a file calls its unit
        if not (each.kind == "unknown_unit" and each.channel in renamed and not found[renamed[each.channel]].unit)
    ]
    before = [dataclasses.replace(each, channel=renamed.get(each.channel, each.channel)) for each in dataset.repairs]
    return dataclasses.replace(dataset, channels=channels, findings=findings, repairs=[*before, *repairs])


def _is_there(dataset: Dataset, source: str, name: str) -> bool:
    """True when the dataset has `source`; under another name than `name` only when it was ever written."""
    key = source.removeprefix("-")
    return key in dataset and (source == name or len(dataset[key].value) >= WRITTEN_SAMPLES)
