"""The walk machine of the program "head-2015": one machine of six states for the whole robot.

Source: robot.md C6.3 C, with C2.2 for what the log of 20 August 2015 does not show. States have the log's numbers. Both
pushes begin by the lean of the OUTER leg: while it stands, and while it swings. So the machine itself is not alike for
the two legs.

It is stepped first; hip and ankles (head_joints.py) take their laws by FSM_LEG, which is reported at the beginning of a
tick: commands are those of the state at the tick's start (robot.md C2.2).

Chosen by us, because the log does not show it: setup ends by a time, and flight as in C2.2 when the outer feet stand.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.boards.main_brain.command import variables_of
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table

if TYPE_CHECKING:
    from ranger_sim.datatable.store import DataStore

# of FSM_LEG, as logged on 20 August 2015
SETUP: Final = 0
INNER_SWING: Final = 1
OUTER_PUSH: Final = 2
OUTER_SWING: Final = 3
INNER_PUSH: Final = 4
FLIGHT: Final = 5

TICK_MS: Final = 2


@cython.cclass
class HeadWalkMachine:
    """States SETUP ... FLIGHT. `machine` is stepped before hip and ankles."""

    store: "DataStore"
    # variables of the data table
    E_LO_ANGLE: cython.longlong
    EST_CONTACT_OUTER: cython.longlong
    EST_CONTACT_INNER: cython.longlong
    FSM_RESET: cython.longlong
    HD_TRANS_ANG: cython.longlong
    HD_CONTACT: cython.longlong
    HD_FLIGHT_TICKS: cython.longlong
    HD_SETUP_TIME: cython.longlong
    FSM_LEG: cython.longlong
    setup_ms: cython.longlong
    ticks_in_the_air: cython.longlong
    machine: StateMachine

    def __init__(self, store) -> None:
        self.store = store
        self.E_LO_ANGLE = table.E_LO_ANGLE
        self.EST_CONTACT_OUTER = table.EST_CONTACT_OUTER
        self.EST_CONTACT_INNER = table.EST_CONTACT_INNER
        self.FSM_RESET = table.FSM_RESET
        self.HD_TRANS_ANG = table.HD_TRANS_ANG
        self.HD_CONTACT = table.HD_CONTACT
        self.HD_FLIGHT_TICKS = table.HD_FLIGHT_TICKS
        self.HD_SETUP_TIME = table.HD_SETUP_TIME
        self.FSM_LEG = table.FSM_LEG
        self.setup_ms = 0
        self.ticks_in_the_air = 0
        swing_states = ("inner_swing", "outer_push", "outer_swing", "inner_push")
        self.machine = StateMachine(
            "walk",
            states=(
                #     no.          name           entry             main
                State(SETUP, "setup", self.enter_setup, self.wait),
                State(INNER_SWING, "inner_swing", None, self.count_flight),
                State(OUTER_PUSH, "outer_push", None, self.count_flight),
                State(OUTER_SWING, "outer_swing", None, self.count_flight),
                State(INNER_PUSH, "inner_push", None, self.count_flight),
                State(FLIGHT, "flight", self.enter_flight),
            ),
            transitions=(
                # from              to             when
                (ANY, "setup", self.reset_wanted),
                (swing_states, "flight", self.flies),
                ("setup", "inner_swing", self.is_set_up),
                ("inner_swing", "outer_push", self.outer_leg_leans_forward),
                ("outer_push", "outer_swing", self.inner_feet_stand),
                ("outer_swing", "inner_push", self.outer_leg_leans_back),
                ("inner_push", "inner_swing", self.outer_feet_stand),
                ("flight", "inner_swing", self.outer_feet_stand),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def preset(self) -> None:
        """Do nothing: the machine keeps nothing from step to step."""

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_LEG, number)

    # -- actions ---------------------------------------------------------------------------------

    @cython.ccall
    def enter_setup(self) -> None:
        self.setup_ms = 0
        self.ticks_in_the_air = 0

    @cython.ccall
    def wait(self) -> None:
        self.setup_ms += TICK_MS

    @cython.ccall
    def enter_flight(self) -> None:
        self.ticks_in_the_air = 0

    @cython.ccall
    def count_flight(self) -> None:
        """Ticks running in which no foot touches."""
        if self.outer_feet_stand() or self.inner_feet_stand():
            self.ticks_in_the_air = 0
        else:
            self.ticks_in_the_air += 1

    # -- conditions ------------------------------------------------------------------------------

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def is_set_up(self) -> cython.bint:
        return self.setup_ms >= self.store.get_float(self.HD_SETUP_TIME)

    @cython.ccall
    def flies(self) -> cython.bint:
        return self.ticks_in_the_air >= self.store.get_float(self.HD_FLIGHT_TICKS)

    @cython.ccall
    def outer_feet_stand(self) -> cython.bint:
        return self.store.get_float(self.EST_CONTACT_OUTER) > self.store.get_float(self.HD_CONTACT)

    @cython.ccall
    def inner_feet_stand(self) -> cython.bint:
        return self.store.get_float(self.EST_CONTACT_INNER) > self.store.get_float(self.HD_CONTACT)

    @cython.ccall
    def outer_leg_leans_forward(self) -> cython.bint:
        """th0 < -trans; th0 is minus the lean (robot.md C1.1)."""
        return self.store.get_float(self.E_LO_ANGLE) > self.store.get_float(self.HD_TRANS_ANG)

    @cython.ccall
    def outer_leg_leans_back(self) -> cython.bint:
        """th0 > trans."""
        return self.store.get_float(self.E_LO_ANGLE) < -self.store.get_float(self.HD_TRANS_ANG)


READS = variables_of(HeadWalkMachine)
