"""The inertial sensor's bytes and the feet's voltages."""

import math
import struct

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.sensors.foot_sensor import FootSensors
from ranger_sim.plant.sensors.imu import Imu

STEP = 125_000
BYTE_NS = 10_000_000_000 // 460_800


def listen(imu, steps, lean=0.1, rate=0.5, yaw=0.0, yaw_rate=0.0, start=0):
    """All bytes of some plant steps as (time, value)."""
    received = []
    for k in range(start, start + steps):
        imu.update(k * STEP, (k + 1) * STEP, lean, rate, lean, rate, yaw, yaw_rate)
        received += [(imu.bytes.times[i], imu.bytes.values[i]) for i in range(imu.bytes.count)]
    return received


def command(imu, header, time=0):
    for byte in (0xC4, 0xC1, 0x29, header):
        imu.receive_byte(time, byte)


def packets(received, header):
    """Packets of 31 bytes with a right sum, as (time of the last byte, six floats, timer)."""
    values = bytes(value for _, value in received)
    found = []
    i = 0
    while i + 31 <= len(values):
        packet = values[i : i + 31]
        if packet[0] == header and sum(packet[:29]) & 0xFFFF == int.from_bytes(packet[29:], "big"):
            found.append(
                (received[i + 30][0], struct.unpack(">6f", packet[1:25]), int.from_bytes(packet[25:29], "big"))
            )
            i += 31
        else:
            i += 1
    return found


def test_the_device_is_silent_until_it_is_asked():
    assert listen(Imu(), 80) == []


def test_the_command_is_acknowledged_with_eight_bytes_and_a_sum():
    imu = Imu(sample_ns=1_000_000_000)
    command(imu, 0xC2, time=1000)
    imu.samples = 1
    imu.next_sample_ns = imu.sample_time(1)
    received = listen(imu, 40)
    values = [value for _, value in received]
    assert values[:2] == [0xC4, 0xC2] and len(values) == 8
    assert sum(values[:6]) == (values[6] << 8) + values[7]
    assert received[0][0] == 1000 + imu.latency_ns + BYTE_NS


def test_rates_come_every_millisecond_and_the_firmware_gets_the_legs_rate_back():
    imu = Imu(noise_rad_s=0.0)
    command(imu, 0xC2)
    found = packets(listen(imu, 8 * 100, rate=0.7), 0xC2)
    assert 98 <= len(found) <= 100
    for _, values, _ in found[1:]:
        assert -(values[3] - -0.004) == pytest.approx(0.7, abs=1e-6)  # outer leg rate = -(gyro - bias)
    gaps = {b[0] - a[0] for a, b in zip(found[1:], found[2:], strict=False)}
    assert gaps == {1_000_000}


def test_gravity_shows_in_the_accelerations():
    imu = Imu(noise_rad_s=0.0, roll_noise_rad=0.0)
    command(imu, 0xC2)
    _, values, _ = packets(listen(imu, 80, lean=0.2), 0xC2)[-1]
    assert math.hypot(values[1], values[2]) == pytest.approx(1.0, abs=1e-6)
    assert math.atan2(-values[1], -values[2]) == pytest.approx(-0.2 - 0.021, abs=1e-6)


def test_angles_come_at_250_hz_with_roll_opposite_to_the_lean():
    imu = Imu(noise_rad_s=0.0, roll_noise_rad=0.0)
    command(imu, 0xCF)
    found = packets(listen(imu, 8 * 100, lean=0.15, yaw=0.3, yaw_rate=0.1), 0xCF)
    assert 24 <= len(found) <= 25
    _, values, _ = found[-1]
    # th0 = roll + 0.021 and th0 = -lean: robot.md C1.1, C3.2
    assert -(values[0] - -0.021) == pytest.approx(0.15, abs=1e-6)
    assert values[2] == pytest.approx(0.3, abs=1e-6)
    assert values[5] == pytest.approx(0.1 - 0.004, abs=1e-6)


def test_a_packet_takes_two_thirds_of_a_millisecond_on_the_line():
    imu = Imu()
    command(imu, 0xC2)
    received = listen(imu, 80)[-31:]
    assert received[-1][0] - received[0][0] == 30 * BYTE_NS
    assert 31 * BYTE_NS == pytest.approx(673_000, rel=0.01)
    times = [time for time, _ in listen(imu, 80, start=80)]
    assert times == sorted(times)


def test_the_timer_counts_62500_ticks_a_second():
    imu = Imu()
    command(imu, 0xC2)
    found = packets(listen(imu, 8 * 50), 0xC2)
    assert (found[-1][2] - found[1][2]) / (len(found) - 2) == pytest.approx(62.5, abs=0.1)


def test_the_rate_is_the_one_at_the_sample_inside_a_step():
    imu = Imu(noise_rad_s=0.0, phase_ns=50_000)
    command(imu, 0xC2)
    imu.update(0, STEP, 0.0, 1.0, 0.0, 2.0)
    assert imu.rate_x == pytest.approx(-1.4 - 0.004)


def test_noise_has_the_stated_deviation_and_comes_from_the_seed():
    imu = Imu(seed=4)
    rates = []
    for k in range(4000):
        imu.update(k * 1_000_000, (k + 1) * 1_000_000, 0.0, 0.0, 0.0, 0.0)
        rates.append(imu.rate_x)
    mean = sum(rates) / len(rates)
    deviation = math.sqrt(sum((x - mean) ** 2 for x in rates) / len(rates))
    assert mean == pytest.approx(-0.004, abs=0.0003)
    assert deviation == pytest.approx(0.004, rel=0.05)
    again = Imu(seed=4)
    again.update(0, 1_000_000, 0.0, 0.0, 0.0, 0.0)
    assert again.rate_x == rates[0]


def test_a_moving_average_delays_by_half_its_length():
    imu = Imu(bias_rad_s=0.0, noise_rad_s=0.0, filter_samples=15)
    shown = []
    for k in range(60):
        imu.update(k * 1_000_000, (k + 1) * 1_000_000, 0.0, -k * 1.0, 0.0, -k * 1.0)
        shown.append(imu.rate_x)
    assert shown[50] == pytest.approx(43.0)


def test_the_devices_clock_runs_fast_by_its_parts_per_billion():
    imu = Imu(ppb=20_000)
    one_day = 86_400_000
    assert imu.sample_time(one_day) == one_day * 1_000_000 - 1_728_000_000  # 20 ppm of a day
    assert imu.sample_time(1_234_567) == 1_234_567_000_000 - 1_234_567 * 20


def test_the_device_stops_when_another_mode_is_asked():
    imu = Imu()
    command(imu, 0xCF)
    listen(imu, 80)
    command(imu, 0x00, time=80 * STEP)
    received = listen(imu, 80, start=80)
    assert packets(received, 0xCF) == []


def test_noise_on_the_command_line_is_survived():
    imu = Imu()
    for byte in (0xC4, 0xC4, 0xC1, 0x00, 0x29, 0xC4, 0xC1, 0x29, 0xCF):
        imu.receive_byte(0, byte)
    assert imu.mode == 0xCF


def test_impossible_numbers_of_the_inertial_sensor_are_refused():
    with pytest.raises(UserError, match="filter_samples"):
        Imu(filter_samples=0)
    with pytest.raises(UserError, match="latency"):
        Imu(latency_ns=-1)


def counts(volts):
    """What the 14-bit converter makes of a foot's voltage at gain 1."""
    return volts / 2.5 * 8192.0


def test_feet_show_700_counts_in_swing_and_7000_in_stance():
    feet = FootSensors("outer")
    assert counts(feet.left_V) == pytest.approx(700.0)
    feet.settle(True, 97.0)
    assert counts(feet.left_V) == counts(feet.right_V) == pytest.approx(7000.0)
    feet.settle(False, 0.0)
    assert counts(feet.right_V) == pytest.approx(700.0)


def strike_delay_ms(feet, load):
    """Time until 2000 counts above the baseline; `load`: N as a function of seconds since the strike."""
    for k in range(1, 1000):
        feet.step(125e-6, True, load(k * 125e-6))
        if counts(feet.left_V) >= 2700.0:
            return k * 0.125
    raise AssertionError("the threshold is never reached")


def test_a_strike_passes_the_threshold_about_9_ms_after_it_happens():
    # The robot: 14 +/- 3 ms in all (appendix 4.3), of which the chain behind the sensor takes about 5.
    weight = 9.91 * 9.81
    rising = strike_delay_ms(FootSensors("f"), lambda t: weight * min(1.0, t / 0.030))
    assert rising == pytest.approx(9.0, abs=0.5)
    # whole weight at once, and slowly: the range of a walk
    at_once = strike_delay_ms(FootSensors("f"), lambda t: weight)
    assert at_once == pytest.approx(12.0 * math.log(1.0 / (1.0 - 2000.0 / 6300.0)), abs=0.13)
    assert strike_delay_ms(FootSensors("f"), lambda t: weight * min(1.0, t / 0.040)) < 11.0


def test_one_time_constant_sets_the_delay():
    fast = strike_delay_ms(FootSensors("f", rise_time_constant_s=0.006), lambda t: 97.0)
    slow = strike_delay_ms(FootSensors("f", rise_time_constant_s=0.024), lambda t: 97.0)
    assert slow / fast == pytest.approx(4.0, rel=0.05)


def test_a_contact_without_load_closes_the_gap_in_part():
    feet = FootSensors("f")
    feet.settle(True, 0.0)
    assert counts(feet.left_V) == pytest.approx(700.0 + 0.4 * 6300.0)
    feet.settle(True, -20.0)
    assert counts(feet.left_V) == pytest.approx(700.0 + 0.4 * 6300.0)


def test_left_and_right_may_differ_in_gain():
    feet = FootSensors("f", left_gain=0.9)
    feet.settle(True, 100.0)
    assert counts(feet.left_V) == pytest.approx(700.0 + 0.9 * 6300.0)
    assert counts(feet.right_V) == pytest.approx(7000.0)


@pytest.mark.parametrize("arguments", [dict(rise_time_constant_s=0.0), dict(share=1.5), dict(full_load_N=-1.0)])
def test_impossible_feet_are_refused(arguments):
    with pytest.raises(UserError, match="foot sensors f"):
        FootSensors("f", **arguments)
