"""The person next to the robot: holds it, presses keys, gives it a push, steers by radio.

What the person does comes from the parameter set's [operator] table; times count from power-up.
"""

from typing import Any

from ranger_sim.foundation.events import PIN_EDGE, STAGE_PINS
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.ranger import wiring

PIN_ORDER = STAGE_PINS * 256 + 128

# Radio pulse of the steering stick: width in s = CENTRE + stick * REACH, every FRAME. The record walk's
# steering machine takes 4e-5 * (width in 1/60 us) - 3.4 for the stick (robot.md C1.6), so the
# centre is 85,000 ticks = 1.4167 ms and one unit is 25,000 ticks = 0.4167 ms; 20 ms is the hobby standard.
CENTRE_NS, REACH_NS, FRAME_NS = 1_416_667, 416_667, 20_000_000
# The receiver's wire runs next to the motors' leads, and the robot's board reported RCX_BAD_LVLS (robot.md T3): spikes
# that end before the interrupt reads the pin, 0.4 us later, so both of their edges have one stamp here. Their rate is
# chosen by us: in one pause of 200, so every 4 s.
SPIKE_SHARE = 0.005


class Operator:
    """Plays a script against the plant and the key pins. `script`: boards.main_brain.controllers.Operator."""

    def __init__(self, script: Any, plant: Any, ui_board: Any, start_ns: int, seed: int = 0) -> None:
        self.spikes = RandomStream(seed, "radio spikes")
        self.script = script
        self.plant = plant
        self.inbox = ui_board.inbox
        self.start_ns = start_ns
        self.release_ns = start_ns + round(script.release_time_s * 1e9)
        self.released = False
        self.next_radio_ns = start_ns
        self.stick = script.radio
        plant.hold(
            stance=script.stance,
            lean_rad=script.lean_rad,
            hip_angle_rad=script.hip_angle_rad,
            outer_ankle_rad=script.outer_ankle_rad,
            inner_ankle_rad=script.inner_ankle_rad,
        )
        for press in script.keys:
            self.press(press.key, start_ns + round(press.time_s * 1e9), round(press.hold_s * 1e9))

    def press(self, key: int, time_ns: int, hold_ns: int) -> None:
        """Press key 0-5 at `time_ns` and release it `hold_ns` later."""
        pin = wiring.PINS["UI"][f"key_{key}"]
        self.inbox.push(time_ns, PIN_ORDER, PIN_EDGE, pin, 1, -1, 0)
        self.inbox.push(time_ns + hold_ns, PIN_ORDER, PIN_EDGE, pin, 0, -1, 0)

    def act(self, until_ns: int) -> None:
        """Do what is due before `until_ns`: radio pulses, letting go."""
        pin = wiring.PINS["UI"]["radio_0"]
        while self.next_radio_ns < until_ns:
            width = CENTRE_NS + round(REACH_NS * self.stick)
            self.inbox.push(self.next_radio_ns, PIN_ORDER, PIN_EDGE, pin, 1, -1, 0)
            self.inbox.push(self.next_radio_ns + width, PIN_ORDER, PIN_EDGE, pin, 0, -1, 0)
            if self.spikes.uniform() < SPIKE_SHARE:
                # in the pause between two pulses; the board's interrupt finds the level unchanged
                spike_ns = self.next_radio_ns + FRAME_NS // 2 + self.spikes.integer(FRAME_NS // 4)
                self.inbox.push(spike_ns, PIN_ORDER, PIN_EDGE, pin, 1, -1, 0)
                self.inbox.push(spike_ns, PIN_ORDER, PIN_EDGE, pin, 0, -1, 0)
            self.next_radio_ns += FRAME_NS
        if not self.released and self.release_ns < until_ns:
            self.released = True
            self.plant.release(self.script.release_rate_rad_per_s)
