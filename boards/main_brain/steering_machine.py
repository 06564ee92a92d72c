"""The steering machine: twists the inner feet one way in the air and the other way on the ground.

Source: robot.md C1.6, the form of the record walk: the command is a count of PWM duty that the
steering board writes straight to its drive. The radio's channel 0 says how much; within the dead band
the motor is shut down.
"""

from typing import TYPE_CHECKING

import cython

from ranger_sim.boards.main_brain.command import variables_of
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table

if TYPE_CHECKING:
    from ranger_sim.datatable.store import DataStore


@cython.cclass
class SteeringMachine:
    """States 0 front, 1 stance, 2 back, 3 swing of the inner legs; stepped last of the walk's machines."""

    store: "DataStore"
    # variables of the data table
    MCH_ANGLE: cython.longlong
    E_SWING_LEG: cython.longlong
    UI_RC_0: cython.longlong
    FSM_RESET: cython.longlong
    P_S_NULL_H_TANG: cython.longlong
    P_S_MAX_CUR: cython.longlong
    P_S_ILST_TWITCH_FRAC: cython.longlong
    P_S_ILST_TWITCH_TIME: cython.longlong
    P_S_RC_DEADBAND: cython.longlong
    D_S_SHUT_DOWN: cython.longlong
    MCSI_COMMAND_CURRENT: cython.longlong
    MCSI_STIFFNESS: cython.longlong
    MCSI_DAMPNESS: cython.longlong
    MCSI_SHUTDOWN: cython.longlong
    E_RC_STEER: cython.longlong
    FSM_STEER: cython.longlong
    twist: cython.double
    ramp_start: cython.double
    ramp_change: cython.double
    ramp_fraction: cython.double
    shut_down: cython.longlong
    machine: StateMachine

    def __init__(self, store) -> None:
        self.store = store
        self.MCH_ANGLE = table.MCH_ANGLE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.UI_RC_0 = table.UI_RC_0
        self.FSM_RESET = table.FSM_RESET
        self.P_S_NULL_H_TANG = table.P_S_NULL_H_TANG
        self.P_S_MAX_CUR = table.P_S_MAX_CUR
        self.P_S_ILST_TWITCH_FRAC = table.P_S_ILST_TWITCH_FRAC
        self.P_S_ILST_TWITCH_TIME = table.P_S_ILST_TWITCH_TIME
        self.P_S_RC_DEADBAND = table.P_S_RC_DEADBAND
        self.D_S_SHUT_DOWN = table.D_S_SHUT_DOWN
        self.MCSI_COMMAND_CURRENT = table.MCSI_COMMAND_CURRENT
        self.MCSI_STIFFNESS = table.MCSI_STIFFNESS
        self.MCSI_DAMPNESS = table.MCSI_DAMPNESS
        self.MCSI_SHUTDOWN = table.MCSI_SHUTDOWN
        self.E_RC_STEER = table.E_RC_STEER
        self.FSM_STEER = table.FSM_STEER
        self.twist = 0.0  # S, PWM counts
        self.ramp_start = 0.0
        self.ramp_change = 0.0
        self.ramp_fraction = 0.0
        self.shut_down = -1  # last word sent to the board, -1 before the first
        self.machine = StateMachine(
            "steering",
            states=(
                #     no. name      entry               main
                State(0, "front", self.enter_front),
                State(1, "stance", self.enter_stance, self.ramp_to_other_side),
                State(2, "back", self.enter_back),
                State(3, "swing", None, self.send_twist),
            ),
            transitions=(
                # from      to        when
                ("front", "stance", self.inner_struck),
                ("stance", "back", self.inner_falls_behind),
                ("back", "swing", self.outer_struck),
                ("swing", "front", self.inner_comes_forward),
                (ANY, "front", self.reset_wanted),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_STEER, number)

    @cython.ccall
    def send(self, counts: cython.double) -> None:
        self.store.set_float(self.MCSI_COMMAND_CURRENT, counts)

    @cython.ccall
    def switch(self, shut_down: cython.longlong) -> None:
        """Order the board once per change to drive or to shut down."""
        if shut_down != self.shut_down:
            self.shut_down = shut_down
            self.store.set_int(self.MCSI_SHUTDOWN, shut_down)

    @cython.ccall
    def off(self) -> None:
        """No twist; motor shut down where the parameter says so."""
        self.twist = 0.0
        self.send(0.0)
        self.switch(1 if self.store.get_float(self.D_S_SHUT_DOWN) != 0.0 else 0)

    @cython.ccall
    def radio_command(self) -> cython.double:
        """-1 ... 1 from the pulse width of channel 0 in 1/60 us (85 000 is the centre).

        A radio that never sent a pulse (width 0) means straight on: no source gives a rule, chosen by us,
        because the formula alone would then steer fully to one side.
        """
        width: float = self.store.get_float(self.UI_RC_0)
        command: float
        if width <= 0.0:
            return 0.0
        command = 4e-5 * width - 3.4
        if command > 1.0:
            return 1.0
        if command < -1.0:
            return -1.0
        return command

    @cython.ccall
    def enter_back(self) -> None:
        """Read the radio once per stride."""
        command: float = self.radio_command()
        dead: float = self.store.get_float(self.P_S_RC_DEADBAND)
        self.store.set_float(self.E_RC_STEER, command)
        self.twist = self.store.get_float(self.P_S_MAX_CUR) * command
        if not -dead < command < dead:
            self.switch(0)
        elif self.store.get_float(self.D_S_SHUT_DOWN) != 0.0:
            self.switch(1)  # the count is still sent
        else:
            self.off()

    @cython.ccall
    def send_twist(self) -> None:
        self.send(self.twist)

    @cython.ccall
    def enter_front(self) -> None:
        self.ramp_start = self.twist
        self.ramp_change = -(1.0 + self.store.get_float(self.P_S_ILST_TWITCH_FRAC)) * self.twist

    @cython.ccall
    def enter_stance(self) -> None:
        self.ramp_fraction = 0.0

    @cython.ccall
    def ramp_to_other_side(self) -> None:
        """From S to -S * twitch in steps of 1/twitch time per tick (1.0: in one tick), then hold."""
        time: float = self.store.get_float(self.P_S_ILST_TWITCH_TIME)
        if self.ramp_fraction < 1.0:
            self.ramp_fraction = self.ramp_fraction + (1.0 / time if time > 0.0 else 1.0)
            if self.ramp_fraction > 1.0:
                self.ramp_fraction = 1.0
        self.send(self.ramp_start + self.ramp_fraction * self.ramp_change)

    # -- conditions ------------------------------------------------------------------------------

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def inner_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 0

    @cython.ccall
    def outer_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 1

    @cython.ccall
    def inner_falls_behind(self) -> cython.bint:
        return self.store.get_float(self.MCH_ANGLE) < self.store.get_float(self.P_S_NULL_H_TANG)

    @cython.ccall
    def inner_comes_forward(self) -> cython.bint:
        return self.store.get_float(self.MCH_ANGLE) > -self.store.get_float(self.P_S_NULL_H_TANG)


READS = variables_of(SteeringMachine)
