"""The leg machine of the program "reflex": which leg stands, and how fast it is at mid-stance.

Source: robot.md P4. Once per step, where the stance leg passes the vertical (phi = 0), its rate less the one aimed at
becomes dw; hip and ankle machines, which run after it in the same tick, shift their currents by it until the next
mid-stance.

Signs are the appendix's, as in the table of P4: phi is a leg's angle, positive leaning back, the opposite of the
estimator's leg angles (robot.md C1.1); its rate is negative while the robot walks forward.
"""

import cython

from ranger_sim.boards.main_brain.command import table_id
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine

READS = (
    "E_LO_ANGLE",
    "E_LI_ANGLE",
    "E_LO_RATE",
    "E_LI_RATE",
    "E_SWING_LEG",
    "FSM_RESET",
    "R_W_REF",
    "R_DW_MAX",
)
WRITES = ("E_AM_L_ABSRATE", "E_R_DW", "FSM_LEG")


class ReflexLegMachine:
    """States 0 start ... 5 LO_aftermid, those after it with the record walk's numbers; "LO": the outer legs stand."""

    def __init__(self, store) -> None:
        self.store = store
        for name in READS + WRITES:
            setattr(self, name, table_id(name))
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

    def preset(self) -> None:
        """Before the first step: as fast as aimed at."""
        self.store.set_float(self.E_R_DW, 0.0)
        self.store.set_float(self.E_AM_L_ABSRATE, -self.store.get_float(self.R_W_REF))

    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_LEG, number)

    # -- actions ---------------------------------------------------------------------------------

    def judge_inner(self) -> None:
        self.judge(self.store.get_float(self.E_LI_RATE))

    def judge_outer(self) -> None:
        self.judge(self.store.get_float(self.E_LO_RATE))

    def judge(self, forward_rate: float) -> None:
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

    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    def outer_leg_past_vertical(self) -> cython.bint:
        return self.store.get_float(self.E_LO_ANGLE) > 0.0

    def inner_leg_past_vertical(self) -> cython.bint:
        return self.store.get_float(self.E_LI_ANGLE) > 0.0

    def inner_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 0

    def outer_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 1
