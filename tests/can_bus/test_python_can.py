"""The interface `ranger_sim` of python-can: private buses and attached ones, by python-can's own rules."""

import asyncio
import logging
import threading

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.can_bus.edge import attached_link, links, python_can
from ranger_sim.can_bus.edge.private_link import PrivateLink
from ranger_sim.can_bus.frame import frame_bits
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import NEVER

from .hosting import fresh_name, hosted

pytestmark = pytest.mark.filterwarnings("error")


def message(identifier, data=b"", **options):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False, **options)


class Opener:
    """can.Bus(...) on this interface; everything is shut down at the end of the test."""

    def __init__(self, channel):
        self.channel = channel
        self.open = []

    def __call__(self, channel=None, **options):
        options.setdefault("private", True)
        if not options["private"]:
            del options["private"]
        bus = can.Bus(interface="ranger_sim", channel=channel or self.channel, ignore_config=True, **options)
        self.open.append(bus)
        return bus


@pytest.fixture
def bus():
    opener = Opener(fresh_name())
    yield opener
    for each in opener.open:
        each.shutdown()
    assert not [name for name, private in python_can._private.items() if private.links]


@pytest.fixture
def clock(monkeypatch):
    """A wall clock that stands until the test moves it; stamps count from its zero."""

    class Clock:
        now_ns = 0

        def to(self, now_ns):
            self.now_ns = now_ns

    standing = Clock()
    monkeypatch.setattr(wallclock, "monotonic_ns", lambda: standing.now_ns)
    monkeypatch.setattr(wallclock, "epoch_ns", lambda: 0)
    return standing


def drained(a_bus):
    found = []
    while (each := a_bus.recv(0)) is not None:
        found.append(each)
    return found


# --- the bus behind it --------------------------------------------------------------------------------------


def test_the_interface_is_registered_with_python_can():
    assert can.interfaces.BACKENDS["ranger_sim"] == ("ranger_sim.can_bus.edge.python_can", "RangerSimBus")


def test_a_frame_takes_its_bits_and_arrives_then(bus, clock):
    sender, receiver = bus(bitrate=500_000), bus()
    sender.send(message(0x123, b"\x01\x02"))
    assert receiver.recv(0) is None
    bits = frame_bits(0x123, 2, 0x0201, 0)
    start_ns = 2000  # the next bit edge after 0
    clock.to(start_ns + (bits - 1) * 2000 - 1)
    assert receiver.recv(0) is None
    clock.to(start_ns + (bits - 1) * 2000)
    got = receiver.recv(0)
    assert got.timestamp == pytest.approx((start_ns + (bits - 1) * 2000) * 1e-9, abs=1e-12)
    assert (got.arbitration_id, bytes(got.data), got.is_rx, got.channel) == (0x123, b"\x01\x02", True, bus.channel)


def test_the_lowest_identifier_wins_when_the_bus_falls_free(bus, clock):
    a, b, c = bus(), bus(), bus()
    a.send(message(0x700))
    clock.to(20_000)  # the frame is under way
    b.send(message(0x300))
    a.send(message(0x200))
    clock.to(1_000_000)
    assert [each.arbitration_id for each in drained(c)] == [0x700, 0x200, 0x300]


def test_frames_of_one_sender_keep_their_order_whatever_their_identifiers(bus, clock):
    a, b = bus(), bus()
    order = [0x10, 0x10, 0x700, 0x3, 0x3, 0x3, 0x3, 0x500, 0x1, 0x600, 0x600]
    for number, identifier in enumerate(order):
        a.send(message(identifier, bytes([number])))
    clock.to(10_000_000)
    assert [(each.arbitration_id, each.data[0]) for each in drained(b)] == [(i, n) for n, i in enumerate(order)]


def test_frames_are_not_acknowledged_until_another_node_joins(bus, clock):
    alone = bus()
    alone.send(message(0x55))
    clock.to(20_000_000)
    errors = drained(alone)
    assert alone.state == can.BusState.PASSIVE and alone.statistics()["transmit_errors"] == 128
    assert len(errors) == 16 and all(each.is_error_frame for each in errors)  # 8 each; then nothing changes any more
    assert errors[0].arbitration_id == 0x2A0 and errors[0].data[3] == 25  # CAN_ERR_ACK | BUSERROR | CNT; ACK slot
    clock.to(3_600_000_000_000)  # an hour of repetitions, which nobody has to compute
    other = bus()
    clock.to(3_600_001_000_000)
    assert [each.arbitration_id for each in drained(other)] == [0x55]
    assert alone.statistics()["sent"] == 1


def test_disturbed_frames_are_repeated_and_reported_as_error_frames(bus, clock):
    a, b = bus(), bus()
    a.inject_errors(2)
    a.send(message(0x100, b"abc"))
    clock.to(10_000_000)
    received = drained(b)
    assert [each.is_error_frame for each in received] == [True, True, False]
    assert received[2].arbitration_id == 0x100
    assert b.statistics()["receive_errors"] == 1 and a.statistics()["transmit_errors"] == 15  # 2 and 16, less one


def test_bus_off_is_an_error_until_recovery_is_asked_for(bus, clock):
    a, b = bus(), bus()
    a.inject_errors(32)
    a.send(message(0x100))
    a.send(message(0x101))
    clock.to(50_000_000)
    assert a.state == can.BusState.ERROR
    assert drained(a)[-1].arbitration_id & 0x40  # CAN_ERR_BUSOFF
    assert a.statistics()["dropped"] == 2
    with pytest.raises(can.CanOperationError, match="bus-off"):
        a.send(message(0x102))
    a.state = can.BusState.ACTIVE
    clock.to(50_000_000 + 127 * 11_000)
    assert a.state == can.BusState.ERROR
    clock.to(60_000_000)
    assert a.state == can.BusState.ACTIVE
    drained(b)
    a.send(message(0x103))
    clock.to(61_000_000)
    assert [each.arbitration_id for each in drained(b)] == [0x103]


def test_two_senders_of_one_identifier_collide(bus, clock):
    a, b, c = bus(), bus(), bus()
    a.send(message(0x42, b"\x00"))
    b.send(message(0x42, b"\xff"))
    clock.to(200_000)
    assert any(each.is_error_frame for each in drained(c))


def test_a_listener_only_does_not_acknowledge(bus, clock):
    sender, listener = bus(), bus(listen_only=True)
    assert listener.state == can.BusState.PASSIVE
    sender.send(message(0x1))
    clock.to(1_000_000)
    assert not [each for each in drained(listener) if not each.is_error_frame]
    with pytest.raises(can.CanOperationError, match="listening only"):
        listener.send(message(0x2))
    listener.state = can.BusState.ACTIVE
    clock.to(30_000_000)
    assert [each.arbitration_id for each in drained(listener) if not each.is_error_frame] == [0x1]


# --- python-can's conventions -------------------------------------------------------------------------------


def test_own_messages_come_only_when_asked_for_and_after_they_are_on_the_bus(bus, clock):
    quiet, own, other = bus(), bus(receive_own_messages=True), bus()
    own.send(message(0x10))
    quiet.send(message(0x20))
    assert own.recv(0) is None
    clock.to(1_000_000)
    assert [(each.arbitration_id, each.is_rx) for each in drained(own)] == [(0x10, False), (0x20, True)]
    assert [(each.arbitration_id, each.is_rx) for each in drained(quiet)] == [(0x10, True)]
    assert len(drained(other)) == 2


def test_filters_keep_what_does_not_match_away(bus):
    sender = bus(speed="max")
    receiver = bus(can_filters=[{"can_id": 0x100, "can_mask": 0x700, "extended": False}])
    for identifier in (0x0FF, 0x123, 0x200, 0x1FF):
        sender.send(message(identifier))
    sender.send(can.Message(arbitration_id=0x123, is_extended_id=True))
    assert [each.arbitration_id for each in drained(receiver)] == [0x123, 0x1FF]
    receiver.set_filters(None)
    sender.send(message(0x7FF))
    assert receiver.recv(0).arbitration_id == 0x7FF


def test_a_full_queue_blocks_until_the_timeout_and_then_raises(bus):
    alone = bus(speed="max")
    for number in range(64):
        alone.send(message(number), timeout=0)
    for timeout in (0, 0.01):
        with pytest.raises(can.CanOperationError, match="transmit queue stayed full .*acknowledge=True adds"):
            alone.send(message(0x99), timeout=timeout)
    other = bus()
    assert [each.arbitration_id for each in drained(other)] == list(range(64))


def test_without_a_timeout_unacknowledged_sending_raises_once_the_queue_is_full(bus):
    alone = bus(speed="max")
    for number in range(64):
        alone.send(message(number))
    with pytest.raises(can.CanOperationError, match="transmit queue stayed full .*acknowledge=True adds"):
        alone.send(message(0x99))
    other = bus()
    for number in range(64, 300):  # there is somebody: sending waits for places again
        alone.send(message(number))
    assert [other.recv(60).arbitration_id for _ in range(300)] == list(range(300))


def test_attached_sending_without_acknowledgement_raises_as_well(monkeypatch):
    monkeypatch.setattr(attached_link, "UNHEARD_S", 0.05)
    with hosted("can1") as (name, _), can.Bus(interface="ranger_sim", channel=f"{name}/can1") as alone:
        with pytest.raises(can.CanOperationError, match="transmit queue stayed full .*ranger-sim bus --acknowledge"):
            for number in range(65):
                alone.send(message(number))


def test_a_channel_comes_back_as_it_was_given():
    """python-can's users give numbers as well, and compare."""
    with can.Bus(interface="ranger_sim", channel=0, private=True, speed="max", ignore_config=True) as a:
        with can.Bus(interface="ranger_sim", channel=0, private=True, ignore_config=True) as b:
            a.send(message(1))
            assert b.recv(60).channel == 0 and a.channel == 0


def test_what_cannot_be_on_a_classic_bus_is_refused(bus):
    a = bus()
    with pytest.raises(can.CanOperationError, match="CAN FD"):
        a.send(can.Message(arbitration_id=1, is_fd=True, data=bytes(12)))
    with pytest.raises(can.CanOperationError, match="error frame"):
        a.send(can.Message(is_error_frame=True))
    wrong = message(0x123)
    wrong.arbitration_id = 0x800
    with pytest.raises(can.CanOperationError, match="0x800 is above 0x7ff"):
        a.send(wrong)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bitrate": 12}, "bitrate 12 is not a whole number in 1000"),
        ({"bitrate": "fast"}, "bitrate 'fast'"),
        ({"speed": "quick"}, "speed 'quick'"),
        ({"bit_error_rate": 0.5}, "bit error rate 0.5"),
        ({"bit_error_rate": "x"}, "x"),
        ({"data_bitrate": 2_000_000}, "data_bitrate and fd_non_iso need fd=True"),
        ({"fd": True, "data_bitrate": "fast"}, "data_bitrate 'fast' is not a whole number"),
        ({"fd": True, "bitrate": 500_000, "data_bitrate": 250_000}, "data bit rate 250000 bit/s is outside 500000"),
        ({"rx_queue_size": 0}, "rx_queue_size 0"),
        ({"channel": "somebody/"}, "no channel"),
        ({"channel": "nobody-of-this-name/can1", "private": False}, "no robot or bus host named 'nobody-of-this-name'"),
        ({"channel": "a name/can1", "private": False}, "name 'a name' is not"),
    ],
)
def test_a_mistake_in_an_option_is_reported_in_one_line(bus, options, words):
    with pytest.raises(can.CanInitializationError, match=words) as reported:
        bus(**options)
    assert "\n" not in str(reported.value)


def test_a_client_that_joins_a_private_bus_cannot_change_it(bus):
    bus(bitrate=250_000, speed="max")
    bus(bitrate="250000", speed="max")
    with pytest.raises(
        can.CanInitializationError, match="open with bitrate 250000, not 500000: the first to open it sets it"
    ):
        bus(bitrate=500_000)
    with pytest.raises(can.CanInitializationError, match="open with speed 0, not 1"):
        bus(speed=1)


def test_after_shutdown_everything_is_refused_and_nothing_is_printed(bus, caplog):
    a, b = bus(), bus()
    a.shutdown()
    a.shutdown()
    for action in (lambda: a.send(message(1)), lambda: a.recv(0), a.flush_tx_buffer):
        with pytest.raises(can.CanOperationError, match="shut down"):
            action()
    with bus() as c:
        c.send(message(2))
    assert b.recv(60).arbitration_id == 2  # what was queued is still sent
    assert not [entry for entry in caplog.records if entry.levelno >= logging.WARNING]


def test_the_shutdown_of_python_can_itself_is_always_called(bus, monkeypatch):
    """python-can's own tests call it on an interface that was never opened."""
    calls = []
    monkeypatch.setattr(can.BusABC, "shutdown", lambda each: calls.append(each))
    never_opened = python_can.RangerSimBus.__new__(python_can.RangerSimBus)
    never_opened.shutdown()
    assert calls == [never_opened]


def test_flushing_drops_what_waits(bus, clock):
    a, b = bus(), bus()
    for number in range(10):
        a.send(message(number))
    a.flush_tx_buffer()
    clock.to(10_000_000)
    assert len(drained(b)) <= 1  # the one that was under way
    assert a.statistics()["dropped"] >= 9


def test_a_reader_that_is_too_slow_loses_frames_and_gets_a_report(bus):
    a, b = bus(speed="max"), bus(rx_queue_size=10)
    for number in range(25):
        a.send(message(number))
    first = [b.recv(0) for _ in range(10)]
    assert [each.arbitration_id for each in first] == list(range(10))
    assert b.recv(0) is None and b.statistics()["lost"] == 15
    a.send(message(0x77))
    reported, after = drained(b)
    assert (
        reported.is_error_frame and reported.arbitration_id == 0x004 and reported.data[1] == 0x01
    )  # CRTL: receive overflow
    assert after.arbitration_id == 0x77


def test_periodic_sending_by_python_cans_thread(bus, caplog):
    a, b = bus(), bus()
    task = a.send_periodic(message(0x123, b"\x00"), 0.002)
    assert [b.recv(60).arbitration_id for _ in range(5)] == [0x123] * 5
    task.modify_data(message(0x123, b"\x01"))
    while b.recv(60).data[0] != 1:
        pass
    a.shutdown()  # the task's thread may be in the middle of a message
    task.thread.join(60)
    assert not task.thread.is_alive(), "the task's thread goes on"
    assert not [entry for entry in caplog.records if entry.levelno >= logging.WARNING]


def test_a_periodic_message_that_fails_is_an_error_before_the_shutdown_only(bus, clock):
    a, _ = bus(), bus()
    sender = python_can._WhileOpen(a)
    a.inject_errors(32)
    sender.send(message(0x100))
    clock.to(50_000_000)
    with pytest.raises(can.CanOperationError, match="bus-off"):
        sender.send(message(0x100))
    a.shutdown()
    sender.send(message(0x100))


def test_a_notifier_hands_messages_to_listeners(bus):
    a, b = bus(), bus()
    reader = can.BufferedReader()
    with can.Notifier(b, [reader], timeout=0.05):
        for number in range(20):
            a.send(message(number))
        assert [reader.get_message(60).arbitration_id for _ in range(20)] == list(range(20))


def heard_by_asyncio(sender, receiver, count):
    async def run():
        reader = can.AsyncBufferedReader()
        notifier = can.Notifier(receiver, [reader], loop=asyncio.get_running_loop())
        for number in range(count):
            sender.send(message(number))
        found = [(await asyncio.wait_for(reader.get_message(), 60)).arbitration_id for _ in range(count)]
        notifier.stop()
        return found

    return asyncio.run(run())


def in_thread(work):
    """(thread, list that gets what `work()` returns or raises)."""
    found = []

    def run():
        try:
            found.append(work())
        except Exception as fault:
            found.append(fault)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread, found


class Asleep:
    """Waits until a thread sleeps in a link: `until()` returns once the link's wait has begun."""

    def __init__(self, monkeypatch, link):
        self.begun = threading.Event()
        waiting = link._wait

        def wait(ready, timeout):
            self.begun.set()  # the lock is held: who has it next finds the thread asleep
            waiting(ready, timeout)

        monkeypatch.setattr(link, "_wait", wait)
        self.link = link

    def until(self):
        assert self.begun.wait(60), "the thread does not begin to wait"
        with self.link.changed:
            pass


def test_a_thread_that_waits_is_woken_by_its_own_bus_that_sends(bus, monkeypatch):
    """It sleeps for a minute where nothing wakes it."""
    own, _ = bus(receive_own_messages=True), bus()
    asleep = Asleep(monkeypatch, own._link)
    thread, found = in_thread(lambda: own.recv(50))
    asleep.until()
    begun = wallclock.monotonic_s()
    own.send(message(0x123))
    thread.join(60)
    assert found[0].arbitration_id == 0x123
    assert wallclock.monotonic_s() - begun < 20  # a guard: it takes 0.5 ms


def test_a_thread_that_waits_is_woken_by_a_node_that_joins(bus, monkeypatch):
    alone = bus(receive_own_messages=True, bitrate=10_000)
    alone.send(message(0x123))
    while alone.statistics()["transmit_errors"] < 128:  # error passive: its attempts go on and are not seen
        alone.recv(0)
    drained(alone)
    asleep = Asleep(monkeypatch, alone._link)
    thread, found = in_thread(lambda: alone.recv(50))
    asleep.until()
    begun = wallclock.monotonic_s()
    bus()
    thread.join(60)
    assert found[0].arbitration_id == 0x123
    assert wallclock.monotonic_s() - begun < 20


# ---- a call that is under way when the bus is shut down


@pytest.mark.parametrize("attached", [False, True], ids=["private", "attached"])
@pytest.mark.parametrize("timeout", [50, None])
def test_a_recv_under_way_when_its_bus_is_shut_down_returns_none_and_later_calls_raise(
    bus, monkeypatch, attached, timeout
):
    monkeypatch.setattr(links, "RUN_OUT_S", 0.0)
    with hosted("can1") as (name, _):
        one = bus(f"{name}/can1", private=False) if attached else bus()
        asleep = Asleep(monkeypatch, one._link)
        thread, found = in_thread(lambda: one.recv(timeout))
        asleep.until()
        one.shutdown()
        thread.join(60)
        assert found == [None]
        with pytest.raises(can.CanOperationError, match="is shut down"):
            one.recv(timeout)
        with pytest.raises(can.CanOperationError, match="is shut down"):
            one.fileno()


@pytest.mark.parametrize("attached", [False, True], ids=["private", "attached"])
def test_a_notifier_that_is_stopped_after_its_bus_is_shut_down_ends_without_an_error(bus, monkeypatch, attached):
    """Its call runs out its time, as on python-can's `virtual`: at once it would call a second time, which raises."""
    with hosted("can1") as (name, _):
        one = bus(f"{name}/can1", private=False) if attached else bus()
        asleep = Asleep(monkeypatch, one._link)
        notifier = can.Notifier(one, [lambda _: None], timeout=1.0)
        asleep.until()
        one.shutdown()
        notifier.stop(60)
        assert not notifier._readers[0].is_alive() and notifier.exception is None


@pytest.mark.parametrize("attached", [False, True], ids=["private", "attached"])
def test_a_recv_that_waits_for_the_lock_when_its_bus_is_shut_down_returns_none(bus, monkeypatch, attached):
    monkeypatch.setattr(links, "RUN_OUT_S", 0.0)
    with hosted("can1") as (name, _):
        one = bus(f"{name}/can1", private=False) if attached else bus()
        link, lock = one._link, one._link.changed
        waits, may_have_it = threading.Event(), threading.Event()

        class Contended:
            def __enter__(self):
                link.changed = lock
                waits.set()
                assert may_have_it.wait(60)
                return lock.__enter__()

            def __exit__(self, *raised):
                return lock.__exit__(*raised)

        link.changed = Contended()
        thread, found = in_thread(lambda: one.recv(1.0))
        assert waits.wait(60)
        one.shutdown()
        may_have_it.set()
        thread.join(60)
        assert found == [None]


def test_what_arrived_is_not_read_after_the_shutdown(bus):
    a, b = bus(speed="max"), bus()
    a.send(message(1))
    b.shutdown()
    with pytest.raises(can.CanOperationError, match="is shut down"):
        b.recv(0)


# ---- a bus with one user


def test_a_silent_node_acknowledges_where_a_program_is_alone(bus, clock):
    alone = bus(acknowledge="yes", receive_own_messages=True)
    alone.send(message(0x55))
    clock.to(1_000_000)
    assert [(each.arbitration_id, each.is_error_frame) for each in drained(alone)] == [(0x55, False)]
    assert alone.statistics()["transmit_errors"] == 0 and alone.state == can.BusState.ACTIVE


def test_the_silent_node_can_join_later_and_is_one_however_often_it_is_asked_for(bus, clock):
    alone = bus()
    alone.send(message(0x55))
    clock.to(20_000_000)
    assert alone.state == can.BusState.PASSIVE
    others = [bus(acknowledge=True, listen_only=True) for _ in range(2)]
    clock.to(21_000_000)
    assert alone.statistics()["sent"] == 1
    assert [node.name for node in alone._link.bus.paced.bus.nodes].count(f"{bus.channel} acknowledger") == 1
    assert [each.arbitration_id for each in drained(others[0])] == [0x55]


def test_the_silent_node_keeps_no_errors(bus, clock):
    """Its messages are thrown away as time passes: a bus with noise may be open for days."""
    one = bus(acknowledge=True)
    one.inject_errors(20)
    one.send(message(0x55))
    clock.to(20_000_000)
    assert drained(one)  # the errors
    clock.to(21_000_000)
    one.recv(0)
    assert one._link.bus.paced.acknowledger.head_time == NEVER


def test_an_attached_bus_gets_its_silent_node_where_it_is_started(bus):
    with hosted("can1", acknowledge=True) as (name, _):
        alone = bus(f"{name}/can1", private=False, receive_own_messages=True)
        alone.send(message(0x55))
        assert alone.recv(60).arbitration_id == 0x55
        with pytest.raises(can.CanInitializationError, match="acknowledge can only be set where that is started"):
            bus(f"{name}/can1", private=False, acknowledge=True)


@pytest.mark.parametrize("speed", [1, "max"])
def test_asyncio_waits_on_the_descriptor_of_a_private_bus(bus, speed):
    a, b = bus(speed=speed), bus()
    assert heard_by_asyncio(a, b, 50) == list(range(50))


# --- attached -----------------------------------------------------------------------------------------------


def test_attached_buses_meet_in_another_process_or_thread(bus):
    with hosted("can1", "can2", bitrate=500_000) as (name, _):
        a, b = bus(f"{name}/can1", private=False), bus("can1", robot=name, private=False, receive_own_messages=True)
        other = bus(f"{name}/can2", private=False)
        assert a.bitrate == 500_000 and name in str(a)
        a.send(message(0x123, b"hello"))
        b.send(message(0x124, b"you"))
        assert [(m.arbitration_id, bytes(m.data), m.is_rx) for m in (b.recv(60), b.recv(60))] == [
            (0x123, b"hello", True),
            (0x124, b"you", False),
        ]
        assert a.recv(60).arbitration_id == 0x124
        assert other.recv(0) is None
        assert a.state == can.BusState.ACTIVE
        assert a.statistics()["sent"] == 1


def test_running_hosts_are_found(bus):
    with hosted("can1", "can2") as (name, _):
        found = can.detect_available_configs("ranger_sim")
        assert {"interface": "ranger_sim", "channel": f"{name}/can2"} in found
        with pytest.raises(can.CanInitializationError, match="has no channel 'can9'; it has can1, can2"):
            bus(f"{name}/can9", private=False)
        with pytest.raises(can.CanInitializationError, match="runs at 1000000 bit/s, not at 500000"):
            bus(f"{name}/can1", private=False, bitrate=500_000)
        with pytest.raises(can.CanInitializationError, match="speed can only be set where that is started"):
            bus(f"{name}/can1", private=False, speed="max")
    assert not [each for each in can.detect_available_configs("ranger_sim") if name in each["channel"]]


def test_the_end_of_the_other_side_is_reported(bus):
    with hosted("can1") as (name, _):
        a, b = bus(f"{name}/can1", private=False), bus(f"{name}/can1", private=False)
        a.send(message(5))
        assert b.recv(60).arbitration_id == 5
    with pytest.raises(can.CanOperationError, match="has gone"):
        a.recv(60)
    with pytest.raises(can.CanOperationError, match="has gone"):
        b.send(message(1))


def test_asyncio_waits_on_the_descriptor_of_an_attached_bus(bus):
    with hosted("can1") as (name, _):
        a, b = bus(f"{name}/can1", private=False), bus(f"{name}/can1", private=False)
        assert heard_by_asyncio(a, b, 200) == list(range(200))


def test_an_attached_node_receives_errors_and_bus_off(bus):
    with hosted("can1") as (name, host):
        a, b = bus(f"{name}/can1", private=False), bus(f"{name}/can1", private=False)
        host.buses[0].bus.inject_errors(32)
        a.send(message(0x100))
        while not (received := a.recv(60)).is_error_frame or not received.arbitration_id & 0x40:
            pass
        with pytest.raises(can.CanOperationError, match="bus-off"):
            a.send(message(0x101))
        a.state = can.BusState.ACTIVE
        while not a.recv(60).arbitration_id & 0x100:  # CAN_ERR_RESTARTED
            pass
        a.send(message(0x102))
        while (received := b.recv(60)).is_error_frame:
            pass
        assert received.arbitration_id == 0x102


def test_threads_may_send_and_receive_on_one_attached_bus(bus):
    count = 300
    with hosted("can1", speed=0.0) as (name, _):
        a, b = bus(f"{name}/can1", private=False), bus(f"{name}/can1", private=False)
        threads = [
            threading.Thread(
                target=lambda one=one, n=n: [one.send(message(n, i.to_bytes(2)), 60) for i in range(count)],
                daemon=True,
            )
            for n, one in enumerate((a, a, b, b))
        ]
        for thread in threads:
            thread.start()
        received = [[one.recv(60) for _ in range(2 * count)] for one in (a, b)]
        for thread in threads:
            thread.join(60)
            assert not thread.is_alive(), "everything is heard, but sending it does not end"
    for messages, senders in zip(received, ((2, 3), (0, 1)), strict=True):
        for sender in senders:
            mine = [int.from_bytes(each.data) for each in messages if each.arbitration_id == sender]
            assert mine == list(range(count))


def test_python_cans_environment_and_configuration_are_honoured(bus, monkeypatch, tmp_path):
    with hosted("can1", bitrate=250_000) as (name, _):
        configuration = tmp_path / "can.ini"
        configuration.write_text(f"[here]\ninterface = ranger_sim\nchannel = can1\nrobot = {name}\nbitrate = 250000\n")
        monkeypatch.setattr(can.util, "CONFIG_FILES", [str(configuration)])
        with can.Bus(config_context="here") as one:
            assert str(one) == f"ranger_sim {name}/can1, 250000 bit/s"
        monkeypatch.setenv("CAN_INTERFACE", "ranger_sim")
        monkeypatch.setenv("CAN_CHANNEL", f"{name}/can1")
        monkeypatch.setenv("CAN_CONFIG", '{"receive_own_messages": "yes"}')
        with can.Bus() as two, can.Bus():
            two.send(message(0x9))
            assert two.recv(60).is_rx is False


# --- every frame --------------------------------------------------------------------------------------------


def test_every_standard_identifier_with_every_length_passes(bus):
    a, b = bus(speed="max"), bus()
    for length in range(9):
        for identifier in range(2048):
            a.send(message(identifier, (identifier * 0x0101_0101_0101_0101 & (1 << 64) - 1).to_bytes(8)[:length]))
        received = drained(b)
        assert [(each.arbitration_id, each.dlc) for each in received] == [(i, length) for i in range(2048)]
        assert all(
            bytes(m.data) == (m.arbitration_id * 0x0101_0101_0101_0101 & (1 << 64) - 1).to_bytes(8)[:length]
            for m in received
        )
    assert a.statistics()["sent"] == 9 * 2048 and a.state == can.BusState.ACTIVE == b.state


@st.composite
def any_message(draw):
    extended, remote = draw(st.booleans()), draw(st.booleans())
    data = draw(st.binary(max_size=8))
    return can.Message(
        arbitration_id=draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF)),
        is_extended_id=extended,
        is_remote_frame=remote,
        dlc=len(data),
        data=None if remote else data,
        check=True,
    )


@given(st.lists(any_message(), max_size=20))
def test_any_message_passes_a_private_bus_unchanged(messages):
    channel = fresh_name()
    with (
        can.Bus(interface="ranger_sim", channel=channel, private=True, speed="max", ignore_config=True) as a,
        can.Bus(interface="ranger_sim", channel=channel, private=True, ignore_config=True) as b,
    ):
        assert isinstance(a._link, PrivateLink)
        for each in messages:
            a.send(each)
        for each in messages:
            assert b.recv(0).equals(each, timestamp_delta=None, check_channel=False)
        assert b.recv(0) is None and a.statistics()["sent"] == len(messages)
