"""A bus of its own clock, with a clock that the test turns: what time it has, what it waits for, when it rests."""

import pytest

from ranger_sim.can_bus.edge.paced import PacedBus, speed_of
from ranger_sim.can_bus.edge.taps import QUEUED, RECEIVED
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import UserError

MS = 1_000_000


@pytest.fixture
def clock(monkeypatch):
    """[monotonic ns]: what the wall clock shows."""
    now = [500]
    monkeypatch.setattr(wallclock, "monotonic_ns", lambda: now[0])
    monkeypatch.setattr(wallclock, "epoch_ns", lambda: 77)
    return now


@pytest.mark.parametrize("speed", [0.5, 1.0, 20.0])
def test_virtual_time_is_the_clocks_times_the_speed(clock, speed):
    bus = PacedBus("can1", speed=speed)
    assert (bus.epoch_ns, bus.now(), bus.time) == (77, 0, 0)
    clock[0] += 3 * MS
    assert bus.now() == int(3 * MS * speed)
    assert bus.advance() == NEVER  # nothing is to come
    assert bus.time == bus.bus.advanced == int(3 * MS * speed)  # up to there all is decided
    assert bus.seconds_until(bus.time) == 0.0
    assert bus.seconds_until(bus.time + 5 * MS) == pytest.approx(5e-3 / speed)


def test_a_frame_goes_out_when_its_time_has_come(clock):
    bus = PacedBus("can1", bitrate=1_000_000)
    sender, other = bus.add("a"), bus.add("b")
    bus.advance()
    assert sender.offer(0x123, 8, 1, 2) == QUEUED
    waits_for = bus.advance()
    assert 0 < waits_for < MS and other.received == 0
    clock[0] += waits_for
    bus.advance()
    clock[0] += 200_000  # some 130 bits of 1 us
    bus.advance()
    assert (sender.sent, other.received) == (1, 1)
    assert [event[2] for event in other.events if event[0] == RECEIVED] == [0x123]


def test_at_full_speed_time_stops_on_an_idle_bus_and_a_frame_passes_at_once(clock):
    bus = PacedBus("can1", speed=0.0)
    sender, other = bus.add("a"), bus.add("b")
    assert bus.now() == NEVER - 1 and bus.seconds_until(10**15) == 0.0
    before = bus.time
    clock[0] += 1000 * MS
    decided = bus.bus.advanced
    assert bus.advance() == NEVER and bus.time == before and bus.bus.advanced == decided
    sender.offer(0x123, 8, 1, 2)
    assert bus.advance() == NEVER
    assert (sender.sent, other.received) == (1, 1)
    assert 100_000 < bus.time - before < 200_000  # as long as the frame


@pytest.mark.parametrize("speed", [1.0, 0.0])
def test_the_frame_of_a_lone_client_waits_without_work_until_another_joins(clock, speed):
    bus = PacedBus("can1", speed=speed)
    lone = bus.add("a")
    lone.offer(0x123, 8, 1, 2)
    for _ in range(60):  # it repeats until it is error passive
        clock[0] += MS
        following = bus.advance()
    errors, retries = bus.bus.counters.errors, bus.bus.counters.retries
    assert lone.controller.passive and errors > 10 and following == NEVER
    for _ in range(20):
        clock[0] += MS
        assert bus.advance() == NEVER
    assert (bus.bus.counters.errors, bus.bus.counters.retries) == (errors, retries)
    other = bus.add("b")
    for _ in range(5):
        clock[0] += MS
        bus.advance()
    assert (lone.sent, other.received) == (1, 1)


def test_noise_on_an_idle_bus_comes_with_the_clock_and_is_not_waited_for_at_full_speed(clock):
    """A bit in a thousand of 1 us: the next one within milliseconds."""
    bus = PacedBus("can1", seed=1, bit_error_rate=1e-3)
    bus.add("a"), bus.add("b")
    following = bus.advance()
    assert 0 < following < 20 * MS
    clock[0] += following
    bus.advance()
    assert bus.bus.counters.errors == 1
    fast = PacedBus("can1", seed=1, bit_error_rate=1e-3, speed=0.0)
    fast.add("a"), fast.add("b")
    assert fast.advance() == NEVER and fast.bus.counters.errors == 0


def test_two_clients_that_can_acknowledge_each_other_never_rest(clock):
    bus = PacedBus("can1")
    sender, other = bus.add("a"), bus.add("b")
    sender.controller.transmit_errors = 200
    sender.controller.passive = True
    sender.offer(0x123, 8, 1, 2)
    for _ in range(3):
        clock[0] += MS
        bus.advance()
    assert (sender.sent, other.received) == (1, 1)


def test_a_reader_that_is_behind_holds_time_at_full_speed_alone(clock):
    for speed, held in ((0.0, True), (1.0, False)):
        bus = PacedBus("can1", speed=speed)
        reader = bus.add("slow")
        assert not bus.held()
        reader.held = True
        assert bus.held() == held


@pytest.mark.parametrize(
    ("text", "speed"), [("max", 0.0), (" MAX ", 0.0), ("0.001", 0.001), (1000, 1000.0), ("1", 1.0)]
)
def test_speeds_have_two_limits_and_a_word(text, speed):
    assert speed_of(text) == speed


@pytest.mark.parametrize("text", ["0.0009", "1000.1", "fast", None, "nan", "-1"])
def test_a_text_that_is_not_a_speed_is_refused(text):
    with pytest.raises(UserError, match="is neither a number in 0.001 ... 1000 nor 'max'"):
        speed_of(text)


def test_a_bit_rate_that_no_bus_has_is_a_users_mistake():
    with pytest.raises(UserError, match="bit rate 10 bit/s is outside"):
        PacedBus("can1", bitrate=10)
