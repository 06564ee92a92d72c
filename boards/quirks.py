"""The switches between the appendix and the firmware of 2016.

`boards/QUIRKS.md` is the readable table: one line per disagreement, with the switch named there; a test
holds table and dataclass against each other. Rule of the defaults: errata of the appendix first, then the
appendix, then what is known of the firmware. `Quirks()` is the robot as the appendix intends it,
`Quirks.firmware_2016()` sets every switch to what the firmware of 2016 does.
"""

from collections.abc import Container
from dataclasses import dataclass, field, fields
from typing import Any, Self, TypeVar

from ranger_sim.foundation.user_error import ScenarioError

Value = TypeVar("Value", bool, int, str)


def switch(default: Value, firmware: Value, allowed: Container[Value]) -> Value:
    """A field of `Quirks`: our default, the value that gives the firmware of 2016, what is allowed.

    `allowed` is a tuple of values, or a `range` for whole numbers.
    """
    return field(default=default, metadata={"firmware": firmware, "allowed": allowed})


YES_OR_NO = (False, True)


@dataclass(frozen=True)
class Quirks:
    """One field per switch; immutable, handed to every board when it is built."""

    # --- motor boards -------------------------------------------------------------------------------
    compliant_gain_sign: int = switch(-1, -1, (-1, 1))
    """Sign of both gain terms. Appendix eq. 3: plus (robot.md P1.11). Firmware and default: minus."""

    proportional_current_control: bool = switch(True, False, YES_OR_NO)
    """Appendix 4.7: PI with the emphasis on the integral. Firmware: Kp = 0, integral only."""

    speed_limiter: bool = switch(True, False, YES_OR_NO)
    """Appendix 4.7: a speed limiter in addition to the current limiter. Firmware: none, only the duty ceiling."""

    thermal_derating: bool = switch(True, False, YES_OR_NO)
    """Appendix 4.7: thermal average brings the current down near its limit. Firmware: slope of wrong sign."""

    peak_current_limiter: bool = switch(True, False, YES_OR_NO)
    """Appendix 4.7: short-time current held to the gearhead's peak. Firmware: integral of the excess only."""

    alternating_offset_counts: int = switch(0, 14, range(0, 100))
    """Appendix 3.8: the PWM lead alternates. Firmware: and one of the two patterns has 14 counts more."""

    gains_latch_with_current: bool = switch(False, True, YES_OR_NO)
    """Appendix eq. 3: gains sent earlier are in force. Firmware: taken over with the next current command."""

    contact_equal_samples: int = switch(10, 11, range(1, 1000))
    """Equal samples that change a foot contact. Appendix 4.10: ten. Firmware: eleven."""

    inner_right_off_level: int = switch(1500, 1500, range(0, 8192))
    """Off level of the inner right foot, counts. Appendix: no exception. Firmware: 1500, others 1000."""

    rate_filter_exponent: int = switch(4, 4, range(1, 15))
    """Satellites' rate filter is 1/2^n per slot. Appendix: about 5 ms. Firmware: n = 4, which is 7.75 ms."""

    hip_rezero: bool = switch(True, True, YES_OR_NO)
    """Appendix 4.6: ankle motor encoders are reconciled with the joint. Firmware: the hip's as well."""

    hip_motor_encoder_preset: bool = switch(True, False, YES_OR_NO)
    """Start of the hip motor's encoder: at the joint's angle. Firmware: at 0, it converges in seconds."""

    steering_output: str = switch("duty", "duty_then_current", ("duty", "duty_then_current", "current"))
    """What COMMAND_CURRENT of the steering does: PWM counts (May 2011), both in turn (2016), or amperes."""

    steering_limit_check: bool = switch(False, False, YES_OR_NO)
    """Blocks the steering beyond +/-200 counts. Firmware: the check exists and is not called."""

    # --- every board --------------------------------------------------------------------------------
    occasional_idle_call: bool = switch(True, True, YES_OR_NO)
    """Appendix 4.4: one occasional entry per pass. Firmware: an idle call after the last entry."""

    warn_near_slot_limit: bool = switch(True, False, YES_OR_NO)
    """Appendix 4.4: approaching the slot's end is an error too. Firmware: only exceeding it."""

    errors_counted_per_event: bool = switch(True, False, YES_OR_NO)
    """Appendix 4.9: every recurrence counts. Firmware of the satellites: at most one per slot."""

    new_errors_lost_after_repeat: bool = switch(False, True, YES_OR_NO)
    """Firmware of the satellites: after a repeated error, further new ones of the same slot are lost."""

    full_queues_reported: bool = switch(True, False, YES_OR_NO)
    """A frame lost to a full ring raises an error. Firmware: silent."""

    full_receive_ring_kills: bool = switch(True, True, YES_OR_NO)
    """A satellite whose receive ring is full serves that interrupt for ever. Appendix: nothing."""

    acceptance_filter: bool = switch(False, False, YES_OR_NO)
    """A satellite's CAN controller refuses what its receive list has not. Robot: in bypass, the program looks up."""

    errors_reported_one_late: bool = switch(False, True, YES_OR_NO)
    """Router and main brain. Firmware: each report carries the error before it, the first one is 0."""

    # --- user interface -----------------------------------------------------------------------------
    imu_packets: str = switch("rates", "euler_and_rates", ("rates", "euler_and_rates"))
    """Appendix 3.8: rate packets at 1000 Hz on the 65 km walk. Firmware: 31 bytes, angles and rates."""

    buzzer_beeps: bool = switch(True, False, YES_OR_NO)
    """Appendix 3.8: beeps on errors. Firmware: only the stored song, a frequency alone is silent."""

    song_repeats_for_ever: bool = switch(False, True, YES_OR_NO)
    """Appendix 3.8: the song on command. Firmware: once started it never ends."""

    # --- router -------------------------------------------------------------------------------------
    router_one_frame_lag: bool = switch(False, True, YES_OR_NO)
    """Firmware: a frame stays in the receive ring until another one follows it."""

    ssp_frames_may_straddle: bool = switch(False, True, YES_OR_NO)
    """Firmware: with the ring never empty a frame may lie across two segments of the link."""

    # --- main brain ---------------------------------------------------------------------------------
    lights_in_every_slot: bool = switch(False, True, YES_OR_NO)
    """The six lights go out in every slot of the main brain (firmware), or when their colour changes (ours)."""

    main_brain_overrun_check: bool = switch(True, False, YES_OR_NO)
    """Appendix 4.4: a slot exceeded is an error. Firmware of the main brain: no flag, no error."""

    main_brain_execution_time_folds: bool = switch(False, True, YES_OR_NO)
    """Firmware: MB_EXECUTION_TIME is the timer within the last 1 ms tick, so 1.2 ms reads 0.2."""

    error_distribution_inverted: bool = switch(False, True, YES_OR_NO)
    """Firmware: the PC's error counts as new while nothing waits in its ring; the LCD's ring is never emptied."""

    computer_link: str = switch("wired", "wired", ("wired", "bluetooth"))
    """Appendix 4.10, 4.11: wired or Bluetooth. Firmware: chosen when it is built, the last one wired."""

    parameter_writes_checked: bool = switch(True, False, YES_OR_NO)
    """A packet that writes a variable other than a parameter raises an error. Firmware: any variable is overwritten."""

    serial_dma_off_at_start: bool = switch(False, True, YES_OR_NO)
    """Firmware: the first poll of the serial line finds its receive transfer off and reports an error."""

    heel_strike: str = switch("baseline", "filtered_sum", ("baseline", "filtered_sum"))
    """Appendix 4.3: voltage above its swing baseline for 2 ms. Firmware: two filtered sensors above 850
    together; twice that here, as the emulated sensors read twice as much."""

    rate_filter: str = switch("10_hz", "20_hz", ("10_hz", "20_hz"))
    """Appendix 4.3: Butterworth 10 Hz on all rates (iterated per ms). Firmware: 20 Hz, once per 2 ms."""

    leg_angle: str = switch("gyro_integral", "imu_roll", ("gyro_integral", "imu_roll"))
    """Appendix 4.3: integrated gyro, reset 10 % per step. Firmware: the IMU's own roll."""

    first_step_full_reset: bool = switch(True, True, YES_OR_NO)
    """Appendix: 10 % per step. May 2011 estimator: the first step resets the whole error."""

    hip_mid_rate_of_previous_step: bool = switch(True, True, YES_OR_NO)
    """May 2011 leg machine: the mid-stance hip rate is worked out with the angle one stride old."""

    push_correction_after_strike: bool = switch(False, False, YES_OR_NO)
    """An option found in a neighbouring version of the record controller: push gain after the strike only."""

    estimator_feet: str = switch("ranger", "robot", ("ranger", "appendix", "robot"))
    """Feet in the estimator, radius and ankle to centre: 0.2/0.146 m as our body `ranger` has them, 0.2/0.11 m as the
    appendix prints them, or 0.23/0.176 m inner and 0.168/0.114 m outer, the firmware's own."""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            allowed = each.metadata["allowed"]
            same_type = type(value) is type(each.default)
            if not same_type or value not in allowed:
                shown = (
                    f"{allowed.start} ... {allowed.stop - 1}"
                    if isinstance(allowed, range)
                    else ", ".join(repr(a) for a in allowed)
                )
                raise ScenarioError(f"quirk {each.name}: {value!r} is not allowed (allowed: {shown})")

    @classmethod
    def firmware_2016(cls) -> Self:
        """Every switch set to what the firmware of 2016 does."""
        return cls(**{each.name: each.metadata["firmware"] for each in fields(cls)})

    @classmethod
    def named(cls, **changes: Any) -> Self:
        """The defaults with the given switches changed; an unknown name is a user's mistake."""
        known = {each.name for each in fields(cls)}
        for name in changes:
            if name not in known:
                raise ScenarioError(f"quirk {name!r}: no such switch (see boards/QUIRKS.md)")
        return cls(**changes)
