"""What can walk: programs, each with its machines and the parameters that they read.

A controller file says which one it is for (`program = "reflex"`), and has to give the parameters of that one and of
what all share: estimator, steering, display. To add a program of your own:

1. a module with its machines next to reflex_hip.py: tables of states and transitions (state_machine.py), and `READS`,
   the variables that it reads. Without `import cython` it runs interpreted, beside compiled ones;
2. its parameters as rows of datatable/master/variables.csv, published by PC for MB, then `ranger-sim table generate`;
3. a function that builds its machines, and a line in PROGRAMS;
4. a set in parameters/, or a file of your own: program, parameters, operator.

The mode machine steps leg, hip, inner and outer foot machine in this order, then steering, in each slot of the walk;
all return to their start states when FSM_RESET is 1. For less than a program `Ranger.replace("MB", "controller", ...)`
puts a function of yours in the machines' place.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from ranger_sim.boards.main_brain import (
    estimator,
    foot_machines,
    head_joints,
    head_walk,
    hip_machine,
    leg_machine,
    reflex_feet,
    reflex_hip,
    reflex_leg,
    steering_machine,
)
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.loader import load_table
from ranger_sim.foundation.user_error import ScenarioError, unknown

FIRST_OWN_ID = 314  # ids below are the robot's of 2016
# What the controller of 2015 reads of the robot's own parameters; the rest belongs to parts that are not emulated.
OF_THE_ROBOT = tuple(name for name in head_joints.READS if name.startswith("CTRL_"))
# What the mode machine reads for every program: display, song, light, fall.
SHARED_BY_ALL = ("P_UI_LCD_TIME", "P_UI_SONG_STEPS", "P_UI_PP2HS_TTIME", "D_UI_STOP_ON_FALL")


class Machines(NamedTuple):
    """The machines of a walk, in the order in which they are stepped.

    Each has `machine`, a StateMachine; leg has `preset()`, called when the walk begins; the others have `motor`, a
    MotorCommand.
    """

    leg: Any
    hip: Any
    inner_foot: Any
    outer_foot: Any


@dataclass(frozen=True)
class Program:
    """One program. `reads`: names of variables, its parameters among them; `build(store, quirks)`: its machines.

    quirks: switches that belong to the program, as its estimator does; they hold whatever the robot's others are.
    """

    name: str
    description: str
    reads: tuple
    build: Callable[[Any, Any], Machines]
    quirks: dict = field(default_factory=dict)

    def switches(self, quirks: Quirks) -> Quirks:
        """These switches with the program's own."""
        return replace(quirks, **self.quirks)

    def parameters(self) -> frozenset:
        """Names of the parameters that a set for this program has to give."""
        return frozenset(parameter_rows()) & {*self.reads, *estimator.READS, *steering_machine.READS, *SHARED_BY_ALL}


def record_machines(store: Any, quirks: Any) -> Machines:
    """The machines of May 2011 (robot.md C1)."""
    return Machines(
        leg_machine.LegMachine(store, quirks),
        hip_machine.HipMachine(store),
        foot_machines.FootMachine(store, quirks, True),
        foot_machines.FootMachine(store, quirks, False),
    )


def reflex_machines(store: Any, quirks: Any) -> Machines:
    """Machines in the appendix's style: a linear law in each state, corrected once per step (robot.md P4)."""
    return Machines(
        reflex_leg.ReflexLegMachine(store),
        reflex_hip.ReflexHipMachine(store),
        reflex_feet.ReflexFootMachine(store, True),
        reflex_feet.ReflexFootMachine(store, False),
    )


def head_machines(store: Any, _quirks: Any) -> Machines:
    """The machine of August 2015 and its three trackers (robot.md C2, C6.3 C)."""
    return Machines(
        head_walk.HeadWalkMachine(store),
        head_joints.HeadHip(store),
        head_joints.HeadAnkle(store, True),
        head_joints.HeadAnkle(store, False),
    )


PROGRAMS = {
    each.name: each
    for each in (
        Program(
            "record",
            "the machines of the 65 km walk of May 2011",
            leg_machine.READS + hip_machine.READS + foot_machines.COMMON + foot_machines.OF_ONE_PAIR,
            record_machines,
        ),
        Program(
            "reflex",
            "a linear law in each state of hip and ankles, corrected once per step",
            reflex_leg.READS + reflex_hip.READS + reflex_feet.READS,
            reflex_machines,
        ),
        Program(
            "head-2015",
            "the controller of August 2015: one machine of six states, trackers at hip and ankles",
            head_walk.READS + head_joints.READS,
            head_machines,
            # its estimator (robot.md C3.2), and the sensor's packets that carry the roll
            {
                "leg_angle": "imu_roll",
                "heel_strike": "filtered_sum",
                "rate_filter": "20_hz",
                "imu_packets": "euler_and_rates",
            },
        ),
    )
}


@functools.cache
def parameter_rows() -> dict:
    """Rows of the master table that are parameters of the programs, by name."""
    return {
        row.name: row
        for row in load_table().variables
        if (row.id >= FIRST_OWN_ID or row.name in OF_THE_ROBOT) and row.publisher == "PC" and "MB" in row.subscribers
    }


def program(name: str) -> Program:
    """The program of this name. UserError for any other."""
    if name not in PROGRAMS:
        raise ScenarioError(unknown("program", name, PROGRAMS))
    return PROGRAMS[name]
