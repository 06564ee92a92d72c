"""The mode machine: the mode by the keys, the display's text, and the walk's machines inside it.

Source: robot.md C1.7. Key 0 leads from standby to calibrate, key 1 from either of them to walk, key 2
from walk back to standby. A key counts when it goes down. Chosen by us, because no source gives it: a fall
leads from walk to stop (the 2016 firmware goes to its safe mode), keys 0 and 2 lead out of stop; colours of
light 1 as in 2016 (robot.md N6.4) where the mode exists there.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.boards.main_brain import programs
from ranger_sim.boards.main_brain.command import table_id
from ranger_sim.boards.main_brain.state_machine import State, StateMachine
from ranger_sim.boards.main_brain.steering_machine import SteeringMachine
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore
from ranger_sim.foundation.numbers import elapsed_u32

if TYPE_CHECKING:
    from ranger_sim.boards.main_brain.estimator import Estimator

# Bits of UI_BUTTONS.
KEY_0: Final = 1
KEY_1: Final = 2
KEY_2: Final = 4
PAGES: Final = 3  # of the display while walking

LCD_QUADS = ("UI_SET_LCD_QUAD_1", "UI_SET_LCD_QUAD_2", "UI_SET_LCD_QUAD_3", "UI_SET_LCD_QUAD_4")

# Colour words: red in the lowest byte, then green, then blue (robot.md N4.11, N6.4).
RED = 0x000080
GREEN = 0x008000
BLUE = 0x800000
PURPLE = 0xE22B8A
DARK = 0


def lcd_words(upper, lower):
    """Four words of four characters, first character in byte 0, for a display of two lines of eight."""
    text = f"{upper[:8]:<8}{lower[:8]:<8}".encode("ascii", "replace")
    return [int.from_bytes(text[i : i + 4], "little") for i in (0, 4, 8, 12)]


@cython.cclass
class ModeMachine:
    """update() once per slot, after the estimator. Holds every machine of the walk: those of `program` (programs.py)
    and steering.

    More than 40 fields: half are the numbers of its variables in the data table, as in the estimator.
    """

    store: DataStore
    estimator: "Estimator"
    # variables of the data table
    TIMESTAMP: cython.longlong
    UI_BUTTONS: cython.longlong
    MCH_BATT_VOLTAGE: cython.longlong
    E_STEP_COUNT: cython.longlong
    E_DISTANCE: cython.longlong
    E_SWING_LEG: cython.longlong
    E_FO_PP2HS_TIME: cython.longlong
    E_FI_PP2HS_TIME: cython.longlong
    P_UI_LCD_TIME: cython.longlong
    P_UI_SONG_STEPS: cython.longlong
    P_UI_PP2HS_TTIME: cython.longlong
    D_UI_STOP_ON_FALL: cython.longlong
    FSM_UI: cython.longlong
    FSM_RESET: cython.longlong
    EST_UI_FSM_MODE: cython.longlong
    UI_SET_LED_1: cython.longlong
    UI_SET_LED_3: cython.longlong
    UI_EMPTY_TX2: cython.longlong
    MCSI_COMMAND_CURRENT: cython.longlong
    MCSI_STIFFNESS: cython.longlong
    MCSI_DAMPNESS: cython.longlong
    lcd_ids: list
    # of whichever program
    leg: object
    hip: object
    inner_foot: object
    outer_foot: object
    steering: SteeringMachine
    buttons: cython.longlong
    pressed: cython.longlong
    last_song_steps: cython.longlong
    page: cython.longlong
    page_time: cython.longlong
    late_push_light: cython.longlong
    machine: StateMachine

    def __init__(self, store, quirks, estimator, program="record") -> None:
        self.store = store
        self.estimator = estimator
        self.TIMESTAMP = table.TIMESTAMP
        self.UI_BUTTONS = table.UI_BUTTONS
        self.MCH_BATT_VOLTAGE = table.MCH_BATT_VOLTAGE
        self.E_STEP_COUNT = table.E_STEP_COUNT
        self.E_DISTANCE = table.E_DISTANCE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.E_FO_PP2HS_TIME = table.E_FO_PP2HS_TIME
        self.E_FI_PP2HS_TIME = table.E_FI_PP2HS_TIME
        self.P_UI_LCD_TIME = table.P_UI_LCD_TIME
        self.P_UI_SONG_STEPS = table.P_UI_SONG_STEPS
        self.P_UI_PP2HS_TTIME = table.P_UI_PP2HS_TTIME
        self.D_UI_STOP_ON_FALL = table.D_UI_STOP_ON_FALL
        self.FSM_UI = table.FSM_UI
        self.FSM_RESET = table.FSM_RESET
        self.EST_UI_FSM_MODE = table.EST_UI_FSM_MODE
        self.UI_SET_LED_1 = table.UI_SET_LED_1
        self.UI_SET_LED_3 = table.UI_SET_LED_3
        self.UI_EMPTY_TX2 = table.UI_EMPTY_TX2
        self.MCSI_COMMAND_CURRENT = table.MCSI_COMMAND_CURRENT
        self.MCSI_STIFFNESS = table.MCSI_STIFFNESS
        self.MCSI_DAMPNESS = table.MCSI_DAMPNESS
        self.leg, self.hip, self.inner_foot, self.outer_foot = programs.program(program).build(store, quirks)
        self.steering = SteeringMachine(store)
        walk_machines = (
            self.leg.machine,  # first: the others see its figures in the same tick
            self.hip.machine,
            self.inner_foot.machine,
            self.outer_foot.machine,
            self.steering.machine,
        )
        self.lcd_ids = [table_id(name) for name in LCD_QUADS]
        self.buttons = 0
        self.pressed = 0  # keys that went down since the slot before
        self.last_song_steps = 0
        self.page = 0
        self.page_time = 0
        self.late_push_light = -1
        self.machine = StateMachine(
            "mode",
            states=(
                #     no. name         entry                 main                exit
                State(0, "calibrate", self.enter_calibrate, self.motors_off),
                State(1, "standby", self.enter_standby, self.motors_off),
                State(2, "walk", self.enter_walk, self.walk_display, self.leave_walk, walk_machines),
                State(3, "stop", self.enter_stop, self.motors_off),
            ),
            transitions=(
                # from                     to            when
                (("standby", "stop"), "calibrate", self.key_0),
                (("calibrate", "standby"), "walk", self.key_1),
                (("walk", "stop"), "standby", self.key_2),
                ("walk", "stop", self.robot_fell),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def update(self) -> None:
        """One slot: keys, then the machines."""
        buttons: cython.longlong = self.store.get_int(self.UI_BUTTONS)
        self.pressed = buttons & ~self.buttons
        self.buttons = buttons
        self.machine.step()

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_UI, number)
        self.store.set_float(self.EST_UI_FSM_MODE, number)

    # -- actions ---------------------------------------------------------------------------------

    @cython.ccall
    def motors_off(self) -> None:
        """All commands and gains 0, rewritten in every slot as in the standby of 2016."""
        self.hip.motor.off()
        self.outer_foot.motor.off()
        self.inner_foot.motor.off()

    @cython.ccall
    def steering_off(self) -> None:
        self.steering.off()
        self.store.set_float(self.MCSI_STIFFNESS, 0.0)
        self.store.set_float(self.MCSI_DAMPNESS, 0.0)

    @cython.ccall
    def enter_calibrate(self) -> None:
        """Power-up mode: motors off, counters to zero."""
        self.store.set_int(self.FSM_RESET, 0)
        self.estimator.zero_counters()
        self.steering_off()
        self.show_mode("CALIBRAT", PURPLE)
        self.last_song_steps = 0

    @cython.ccall
    def enter_standby(self) -> None:
        self.store.set_int(self.FSM_RESET, 0)
        self.steering_off()
        self.show_mode("STANDBY", GREEN)

    @cython.ccall
    def enter_stop(self) -> None:
        self.store.set_int(self.FSM_RESET, 0)
        self.steering_off()
        self.show_mode("STOP", RED)

    @cython.ccall
    def enter_walk(self) -> None:
        self.store.set_int(self.FSM_RESET, 2)
        self.store.set_int(self.E_SWING_LEG, 1)
        self.leg.preset()
        self.show_mode("WALK", BLUE)
        self.page = 0
        self.page_time = self.store.stamp(self.TIMESTAMP)

    @cython.ccall
    def leave_walk(self) -> None:
        """Motors to zero, then one tick of every machine with the reset flag: all return to their starts."""
        machine: StateMachine
        walk: State = self.machine.current
        i: cython.longlong
        self.motors_off()
        self.store.set_int(self.FSM_RESET, 1)
        for i in range(len(walk.machines)):
            machine = walk.machines[i]
            machine.step()

    @cython.ccall
    def walk_display(self) -> None:
        """Every 4 s the next of battery, steps, metres; a song every 3000 steps; a light for late pushes."""
        store: DataStore = self.store
        now: cython.longlong = store.stamp(self.TIMESTAMP)
        elapsed: cython.longlong = elapsed_u32(now, self.page_time)
        song: float = store.get_float(self.P_UI_SONG_STEPS)
        steps: cython.longlong = store.get_int(self.E_STEP_COUNT)
        limit: float = store.get_float(self.P_UI_PP2HS_TTIME)
        late: cython.longlong = 0
        if elapsed >= store.get_float(self.P_UI_LCD_TIME):
            self.page_time = now
            self.show_page()
        if steps < self.last_song_steps:
            self.last_song_steps = 0  # the estimator counts each walk's steps from zero
        if song >= 1.0 and steps - self.last_song_steps >= song:
            self.last_song_steps = steps
            store.set_int(self.UI_EMPTY_TX2, 1)
        if store.get_int(self.E_FO_PP2HS_TIME) > limit or store.get_int(self.E_FI_PP2HS_TIME) > limit:
            late = 1
        if late != self.late_push_light:
            self.late_push_light = late
            store.set_int(self.UI_SET_LED_3, RED if late else DARK)

    @cython.ccall
    def show_page(self) -> None:
        if self.page == 0:
            self.show("BATTERY", f"{self.store.get_float(self.MCH_BATT_VOLTAGE):.1f} V")
        elif self.page == 1:
            self.show("STEPS", f"{self.store.get_int(self.E_STEP_COUNT)}")
        else:
            self.show("METRES", f"{self.store.get_float(self.E_DISTANCE):.1f}")
        self.page = (self.page + 1) % PAGES

    @cython.ccall
    def show_mode(self, name, colour) -> None:
        self.show(name, "")
        self.store.set_int(self.UI_SET_LED_1, colour)

    @cython.ccall
    def show(self, upper, lower) -> None:
        """Two lines of eight characters to the display of the user interface board."""
        for number, word in zip(self.lcd_ids, lcd_words(upper, lower), strict=True):
            self.store.set_int(number, word)

    # -- conditions ------------------------------------------------------------------------------

    @cython.ccall
    def key_0(self) -> cython.bint:
        return (self.pressed & KEY_0) != 0

    @cython.ccall
    def key_1(self) -> cython.bint:
        return (self.pressed & KEY_1) != 0

    @cython.ccall
    def key_2(self) -> cython.bint:
        return (self.pressed & KEY_2) != 0

    @cython.ccall
    def robot_fell(self) -> cython.bint:
        return self.estimator.fallen and self.store.get_float(self.D_UI_STOP_ON_FALL) != 0.0
