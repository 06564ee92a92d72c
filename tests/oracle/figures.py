"""The figures of summary.json from the files of its run: {path: (value, tolerance)}. Of ranger_sim nothing is imported.

What the body did is known every 2 ms (`STEP_S`), and an event lies in the 2 ms before the sample that shows it. Hence:
a duration between two events is known to 2 ms, a mean of n consecutive steps to 2 ms / n, and a standard deviation to
2 ms, because it is a norm, divided by sqrt(n), of what differs by no more than that.
"""

import numpy as np

STEP_S = 0.002
BIT_RATE = 3e6
SKIPPED = 5
RADIUS_M = 0.2  # of a foot's arc: appendix 2.4
MOTORS = {"hip": "hip_W", "outer_ankle": "outer_W", "inner_ankle": "inner_W", "steering": "steering_W"}
CAN_OF = {"MCH": "can1", "UI": "can2", "MCFO": "can3", "MCFI": "can4", "MCSI": "can4"}
# Identifiers of the error frames and of "longest slot of all" (datatable/master/variables.csv).
ERROR_FRAME = {"MCH": 3, "MCFO": 4, "MCFI": 5, "MCSI": 7, "UI": 8}
LONGEST_SLOT = {"MCH": 24, "MCFO": 52, "MCFI": 80, "MCSI": 121, "UI": 154}


class Walk:
    """What the body did: `release`, `strikes` (number of the first sample after each), the standing feet.

    `ankle_offset_m`: from the ankle to the centre of a foot's arc; `leg_m`: from hip to ankle.
    """

    def __init__(self, body, ankle_offset_m, leg_m):
        self.body = body
        self.ankle_offset_m = ankle_offset_m
        self.leg_m = leg_m
        self.release = int(np.flatnonzero(np.diff(body["mode"]))[0]) + 1
        self.strikes = np.flatnonzero(np.diff(body["steps"])) + 1
        self.standing = {leg: body[f"{leg}_Fy_N"] != 0.0 for leg in ("outer", "inner")}

    def contact_x(self, leg):
        """Where a foot's arc stands on a level floor, if it stands: below its centre."""
        ankle = self.body["hip_x_m"] - self.leg_m * np.sin(self.body[f"leg_{leg}_rad"])
        return ankle + self.ankle_offset_m * np.sin(self.body[f"foot_{leg}_rad"])

    def landed(self, at):
        """The foot that stands since this sample."""
        [leg] = [each for each in self.standing if self.standing[each][at] and not self.standing[each][at - 1]]
        return leg

    def strike_xs(self):
        """Contact point of each strike: of the foot that did not stand before it."""
        return np.array([self.contact_x(self.landed(at))[at] for at in self.strikes])

    def rolled(self):
        """How far a foot rolls at most from a strike to the sample that shows it: as it turns between two samples."""
        feet = [self.body[f"foot_{self.landed(at)}_rad"][at - 1 : at + 2] for at in self.strikes]
        return RADIUS_M * max(np.abs(np.diff(foot)).max() for foot in feet)

    def weight_N(self):
        """What the floor carries while the robot is held on one foot."""
        return max(self.body[f"{leg}_Fy_N"][self.release - 1] for leg in self.standing)

    def start_x(self):
        """Contact point of the foot that stood when the robot was let go."""
        leg = "outer" if self.standing["outer"][self.release - 1] else "inner"
        return self.contact_x(leg)[self.release - 1]


def of_the_walk(walk, electronics_W):
    """Steps, distances, times, powers."""
    body, time = walk.body, walk.body.time_s
    counted = len(walk.strikes) - SKIPPED
    xs, times = walk.strike_xs(), time[walk.strikes]
    lengths, durations = np.diff(xs)[SKIPPED - 1 :], np.diff(times)[SKIPPED - 1 :]
    rolled = walk.rolled()  # until a foot is seen to stand, and back at the step before
    walked = time[-1] - time[walk.release]
    double = np.array([in_double_stance(walk, at) for at in walk.strikes[SKIPPED:]])
    powers = {name: np.maximum(body[column][walk.release :], 0.0).mean() for name, column in MOTORS.items()}
    total = sum(powers.values()) + electronics_W
    speed = lengths.sum() / durations.sum()
    weight = walk.weight_N()
    # The powers are means of the quarter millisecond that ends at each sample, one of eight: what lies between two
    # samples may differ by as much as from one sample to the next, at random. 2 % covers it (1.1 % were seen).
    sampled = 0.02
    found = {
        "steps": (body["steps"][-1], 0),
        "distance_m": (xs[-1] - walk.start_x(), rolled),
        "time_s": (time[-1], STEP_S + 1e-9),  # the next sample may be due at the very end
        "walked_h": (walked / 3600.0, 2 * STEP_S / 3600.0),
        "mean_step_length_m": (lengths.mean(), 2 * rolled / counted),
        "std_step_length_m": (lengths.std(), 2 * rolled),
        "mean_step_time_s": (durations.mean(), STEP_S / counted),
        "std_step_time_s": (durations.std(), STEP_S),
        "double_stance_s": (double.mean(), STEP_S),
        "speed_m_per_s": (speed, speed * (2 * rolled / lengths.sum() + STEP_S / durations.sum())),
        "motor_power_W": (sum(powers.values()), sampled * sum(powers.values())),
        "electronics_power_W": (electronics_W, 1e-9),
        "total_power_W": (total, sampled * total),
        "tcot": (total / (weight * speed), 1.5 * sampled * total / (weight * speed)),
        "energy_Wh.electronics": (electronics_W * walked / 3600.0, electronics_W * 2 * STEP_S / 3600.0),
        "energy_Wh.total": (total * walked / 3600.0, sampled * total * walked / 3600.0),
    }
    for name, power in powers.items():
        found[f"motor_powers_W.{name}"] = (power, sampled * power)
        found[f"energy_Wh.{name}"] = (power * walked / 3600.0, sampled * power * walked / 3600.0)
    return found


def in_double_stance(walk, at):
    """From a strike until the trailing foot leaves the floor, s."""
    both = walk.standing["outer"][at:] & walk.standing["inner"][at:]
    return STEP_S * int(np.argmin(both)) if not both.all() else STEP_S * len(both)


def electronics_power(body):
    """What the battery gives and no motor takes, W: the median, because it is nothing before the first step."""
    motors = sum(body[column] for column in MOTORS.values())
    return float(np.median(body["battery_V"] * body["battery_A"] - motors))


def of_the_battery(body, capacity_Wh, nominal_V):
    """Charge by counting current, energy by the product, inner resistance by the sag; all sums of 2 ms samples."""
    V, A = body["battery_V"], body["battery_A"]
    sag, _ = np.polyfit(A, V, 1)
    used = STEP_S * A.sum() / (capacity_Wh * 3600.0 / nominal_V)
    delivered, lost = STEP_S * (V * A).sum() / 3600.0, STEP_S * (-sag * A * A).sum() / 3600.0
    return {
        "battery.charge": (1.0 - used, 0.02 * used),  # sampled as the powers are
        "battery.delivered_Wh": (delivered, 0.02 * delivered),
        "battery.lost_inside_Wh": (lost, 0.1 * lost),  # squares of what is sampled weigh its peaks twice
        "battery_V": (V[-1], 0.2),  # of the last 2 ms: a motor of 3 A sags it by 0.2 V
    }


def of_strike_delays(walk):
    """From each strike to the main brain's flip of the swing leg, which the table has every 2 ms."""
    flips, _ = walk.body.variable("E_SWING_LEG")
    strikes = walk.body.time_s[walk.strikes]
    flips = flips[flips > strikes[0]]
    delays = np.array([flips[np.searchsorted(flips, at)] - at for at in strikes if at < flips[-2]]) * 1e3
    # the strike may lie 2 ms before its sample, the slot that flips 2 ms before its own, and a slot is told of by its
    # beginning, up to 0.4 ms of execution before it has written
    return {
        "heel_strike_delay_ms.mean": (delays.mean(), 2.4),
        "heel_strike_delay_ms.std": (delays.std(), 2.4),
        "heel_strike_delay_ms.count": (len(delays), 0),
    }


def of_a_bus(name, log, time_s):
    """Traffic of one bus in a run of `time_s`, known to 1 ms. Stamps are cut to microseconds, 3 bits, at both ends of
    a window."""
    bits = log.bits()
    end = np.round(log.time_us * BIT_RATE * 1e-6).astype(np.int64) + 3  # the stamp is the end of its end of frame
    begin = end - bits
    width = round(0.01 * BIT_RATE)
    windows = np.zeros(int(end[-1] // width) + 2)
    mean = bits.sum() / (time_s * BIT_RATE)
    inside = np.minimum(end, (begin // width + 1) * width) - begin  # what falls into the window of its first bit
    np.add.at(windows, begin // width, inside)
    np.add.at(windows, begin // width + 1, bits - inside)
    return {
        f"can.{name}.frames": (len(bits), 0),
        f"can.{name}.errors": (log.error_frames, 0),
        f"can.{name}.load_mean": (mean, (mean * 0.001 + 150 / BIT_RATE) / time_s),  # a frame may be on its way
        f"can.{name}.load_max": (windows.max() / width, 8 / width),
    }


def of_errors(board, log, names):
    """{path: (reported, most that may wait)}: errors by the counts in a board's error frames (appendix 4.9)."""
    _, words, _ = log.words(ERROR_FRAME[board])
    told, largest = {}, {}
    for word in words.tolist():
        code, count = word & 0xFFFF, word >> 22 & 0x3FF
        told[code] = told.get(code, 0) + count
        largest[code] = max(largest.get(code, 0), count)
    return {f"errors.{board}.{names[code]}": (told[code], largest[code]) for code in told}


def of_slots(board, log, time_s, slot_s):
    """Slots of a run of `time_s`, known to 1 ms; the longest one as the board itself publishes it."""
    found = {f"slots.{board}.budget_us": (slot_s * 1e6, 1e-9)}
    # power-up within 2 ms, first and last slot, the end; crystals are right to 100 parts in a million
    count = (time_s - 0.001) / slot_s
    found[f"slots.{board}.count"] = (count, (0.001 + 0.001) / slot_s + 1.0 + 1e-4 * count)
    if board in LONGEST_SLOT:
        _, words, _ = log.words(LONGEST_SLOT[board])
        longest_us = words[-1:].astype(np.uint32).view(np.float32)[0] * 1e6
        # the board starts its timer in the slot's interrupt, which takes 44 cycles of 60 MHz to be entered
        found[f"slots.{board}.max_execution_us"] = (longest_us + 44 / 60.0, 1e-3)
    return found
