"""Stamped messages leave in their written order, whatever the order of arrival."""

from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.foundation import events
from ranger_sim.foundation.events import NEVER, EventQueue
from ranger_sim.foundation.numbers import integers


def drain(queue):
    out = []
    while queue.take():
        out.append((queue.time, queue.order, queue.kind, queue.a, queue.f, queue.ref))
    return out


def test_an_empty_queue_is_never_due():
    queue = EventQueue()
    assert queue.head_time == NEVER
    assert not queue.take()


def test_an_earlier_message_overtakes_a_later_one():
    queue = EventQueue()
    queue.push(20, 0, 1, 7)
    queue.push(10, 0, 2, 8)
    assert queue.head_time == 10
    assert [kind for _, _, kind, *_ in drain(queue)] == [2, 1]


def test_at_one_time_the_lower_order_comes_first_and_equals_keep_their_arrival():
    queue = EventQueue()
    queue.push(5, 2, 1)
    queue.push(5, 1, 2)
    queue.push(5, 2, 3)
    queue.push(5, 1, 4)
    assert [kind for _, _, kind, *_ in drain(queue)] == [2, 4, 1, 3]


def test_all_integers_and_the_object_of_a_message_arrive():
    queue = EventQueue()
    thing = object()
    queue.push(1, 2, 3, 4, 5, 6, 7, 8, 9, thing)
    assert queue.take()
    assert (queue.a, queue.b, queue.c, queue.d, queue.e, queue.f) == (4, 5, 6, 7, 8, 9)
    assert queue.ref is thing


def test_all_integers_of_a_message_that_is_not_urgent_arrive_behind_those_before_it():
    queue = EventQueue(2)
    for first in (100, 200, 300):
        queue.put(*range(first, first + 9))
    for first in (100, 200, 300):
        assert queue.take()
        fields = (queue.time, queue.order, queue.kind, queue.a, queue.b, queue.c, queue.d, queue.e, queue.f)
        assert fields == tuple(range(first, first + 9)) and queue.ref is None


def test_no_two_kinds_of_message_have_one_number():
    names = [
        "PIN_EDGE", "CAN_RX", "CAN_TX_DONE", "CAN_STATUS", "UART_BYTE", "SSP_SEGMENT", "CAN_REQUEST", "CAN_ABORT",
        "CAN_MODE", "PWM_UPDATE", "PIN_OUTPUT", "SSP_START", "SSP_LOAD", "UART_OUTPUT", "CAN_FILTER",
    ]  # fmt: skip
    assert len({getattr(events, name) for name in names}) == len(names)


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 3), st.booleans()), max_size=300))
def test_a_queue_agrees_with_a_stable_sort(moves):
    queue = EventQueue(2)  # small, so that it must grow
    model = []
    sent = 0
    for time, order, take in moves:
        if take and model:
            model.sort(key=lambda message: message[:2])  # stable, so arrival decides among equals
            assert queue.head_time == model[0][0]
            assert queue.take()
            assert (queue.time, queue.order, queue.kind) == model.pop(0)
        else:
            queue.push(time, order, sent)
            model.append((time, order, sent))
            sent += 1
    model.sort(key=lambda message: message[:2])
    assert [message[:3] for message in drain(queue)] == model
    assert queue.count == 0


def test_a_message_that_is_not_urgent_only_lowers_the_arrival_time():
    queue, came, due = EventQueue(), integers(2, NEVER), integers(2, NEVER)
    queue.wake(came, due, 1)
    queue.put(50, 0, 1, 0, 0, 0, 0, 0, 0)
    assert (list(came), list(due)) == ([NEVER, 50], [NEVER, NEVER])
    queue.push(70, 0, 2)
    assert (list(came), list(due), queue.urgent_until) == ([NEVER, 50], [NEVER, 70], 70)
    queue.put(40, 0, 3, 0, 0, 0, 0, 0, 0)
    assert (list(came), list(due)) == ([NEVER, 40], [NEVER, 70])
    assert [kind for _, _, kind, *_ in drain(queue)] == [3, 1, 2]
