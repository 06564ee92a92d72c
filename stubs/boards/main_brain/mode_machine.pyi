# Generated from boards/main_brain/mode_machine.py and boards/main_brain/mode_machine.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.main_brain.estimator import Estimator
from ranger_sim.boards.main_brain.state_machine import StateMachine
from ranger_sim.boards.main_brain.steering_machine import SteeringMachine
from ranger_sim.datatable.store import DataStore
from typing import Any

KEY_0: int
KEY_1: int
KEY_2: int
PAGES: int
READS: tuple[str, ...]
WRITES: tuple[str, ...]
LCD_QUADS: tuple[str, ...]
RED: int
GREEN: int
BLUE: int
PURPLE: int
DARK: int

def lcd_words(upper: Any, lower: Any) -> Any: ...

class ModeMachine:
    store: DataStore
    estimator: Estimator
    TIMESTAMP: int
    UI_BUTTONS: int
    MCH_BATT_VOLTAGE: int
    E_STEP_COUNT: int
    E_DISTANCE: int
    E_SWING_LEG: int
    E_FO_PP2HS_TIME: int
    E_FI_PP2HS_TIME: int
    P_UI_LCD_TIME: int
    P_UI_SONG_STEPS: int
    P_UI_PP2HS_TTIME: int
    D_UI_STOP_ON_FALL: int
    FSM_UI: int
    FSM_RESET: int
    EST_UI_FSM_MODE: int
    UI_SET_LED_1: int
    UI_SET_LED_3: int
    UI_EMPTY_TX2: int
    MCSI_COMMAND_CURRENT: int
    MCSI_STIFFNESS: int
    MCSI_DAMPNESS: int
    lcd_ids: list[Any]
    leg: Any
    hip: Any
    inner_foot: Any
    outer_foot: Any
    steering: SteeringMachine
    buttons: int
    pressed: int
    last_song_steps: int
    page: int
    page_time: int
    late_push_light: int
    machine: StateMachine
    def __init__(self, store: DataStore, quirks: Any, estimator: Estimator, program: Any = 'record') -> None: ...
    def update(self) -> None: ...
    def publish_state(self, number: Any) -> None: ...
    def motors_off(self) -> None: ...
    def steering_off(self) -> None: ...
    def enter_calibrate(self) -> None: ...
    def enter_standby(self) -> None: ...
    def enter_stop(self) -> None: ...
    def enter_walk(self) -> None: ...
    def leave_walk(self) -> None: ...
    def walk_display(self) -> None: ...
    def show_page(self) -> None: ...
    def show_mode(self, name: Any, colour: Any) -> None: ...
    def show(self, upper: Any, lower: Any) -> None: ...
    def key_0(self) -> bool: ...
    def key_1(self) -> bool: ...
    def key_2(self) -> bool: ...
    def robot_fell(self) -> bool: ...
