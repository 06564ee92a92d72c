"""The leg machine of the program "reflex": which leg stands, and how fast it is at mid-stance.

Source: robot.md P4. Once per step, where the stance leg passes the vertical (phi = 0), its rate less the one aimed at
becomes dw; hip and ankle machines, which run after it in the same tick, shift their currents by it until the next
mid-stance.

Signs are the appendix's, as in the table of P4: phi is a leg's angle, positive leaning back, the opposite of the
estimator's leg angles (robot.md C1.1); its rate is negative while the robot walks forward.
"""

from typing import TYPE_CHECKING

import cython

from ranger_sim.boards.main_brain.command import variables_of
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table

if TYPE_CHECKING:
    from ranger_sim.datatable.store import DataStore


@cython.cclass
class ReflexLegMachine:
    """States 0 start ... 5 LO_aftermid, those after it with the record walk's numbers; "LO": the outer legs stand."""

    store: "DataStore"
    # variables of the data table
    E_LO_ANGLE: cython.longlong
    E_LI_ANGLE: cython.longlong
    E_LO_RATE: cython.longlong
    E_LI_RATE: cython.longlong
    E_SWING_LEG: cython.longlong
    FSM_RESET: cython.longlong
    R_W_REF: cython.longlong
    R_DW_MAX: cython.longlong
    E_AM_L_ABSRATE: cython.longlong
    E_R_DW: cython.longlong
    FSM_LEG: cython.longlong
    machine: StateMachine

    def __init__(self, store) -> None:
        self.store = store
        self.E_LO_ANGLE = table.E_LO_ANGLE
        self.E_LI_ANGLE = table.E_LI_ANGLE
        self.E_LO_RATE = table.E_LO_RATE
        self.E_LI_RATE = table.E_LI_RATE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.FSM_RESET = table.FSM_RESET
        self.R_W_REF = table.R_W_REF
        self.R_DW_MAX = table.R_DW_MAX
        self.E_AM_L_ABSRATE = table.E_AM_L_ABSRATE
        self.E_R_DW = table.E_R_DW
        self.FSM_LEG = table.FSM_LEG
        self.machine = StateMachine(
            "leg",
            states=(
                #     no. name            entry
                State(0, "start"),  # outer legs stand; the first step has no mid-stance that could be judged
                State(1, "LI_premid"),
                State(2, "LI_aftermid", self.judge_inner),
                State(4, "LO_premid"),
                State(5, "LO_aftermid", self.judge_outer),
            ),
            transitions=(
                # from                                  to             when
                (ANY, "start", self.reset_wanted),
                (("start", "LO_premid", "LO_aftermid"), "LI_premid", self.inner_struck),
                (("LI_premid", "LI_aftermid"), "LO_premid", self.outer_struck),
                ("LI_premid", "LI_aftermid", self.inner_leg_past_vertical),
                ("LO_premid", "LO_aftermid", self.outer_leg_past_vertical),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def preset(self) -> None:
        """Before the first step: as fast as aimed at."""
        self.store.set_float(self.E_R_DW, 0.0)
        self.store.set_float(self.E_AM_L_ABSRATE, -self.store.get_float(self.R_W_REF))

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_LEG, number)

    # -- actions ---------------------------------------------------------------------------------

    @cython.ccall
    def judge_inner(self) -> None:
        self.judge(self.store.get_float(self.E_LI_RATE))

    @cython.ccall
    def judge_outer(self) -> None:
        self.judge(self.store.get_float(self.E_LO_RATE))

    @cython.ccall
    def judge(self, forward_rate: cython.double) -> None:
        """dw of this mid-stance; `forward_rate`: of the stance leg, as the estimator has it, rad/s."""
        limit: float = self.store.get_float(self.R_DW_MAX)
        dw: float = -forward_rate - self.store.get_float(self.R_W_REF)
        if dw > limit:
            dw = limit
        elif dw < -limit:
            dw = -limit
        self.store.set_float(self.E_R_DW, dw)
        self.store.set_float(self.E_AM_L_ABSRATE, forward_rate)

    # -- conditions ------------------------------------------------------------------------------

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def outer_leg_past_vertical(self) -> cython.bint:
        return self.store.get_float(self.E_LO_ANGLE) > 0.0

    @cython.ccall
    def inner_leg_past_vertical(self) -> cython.bint:
        return self.store.get_float(self.E_LI_ANGLE) > 0.0

    @cython.ccall
    def inner_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 0

    @cython.ccall
    def outer_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 1


READS = variables_of(ReflexLegMachine)
