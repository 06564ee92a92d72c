"""What a bus counts, logs and times against what the oracle of ISO 11898-1 saw happen, recomputed from its events.

A scenario counts here when it is over before its end: what a bus has decided beyond that the oracle does not know.
"""

import array
import collections

import pytest

from ranger_sim.can_bus.frame_log import SENDER_SHIFT, TIMES_BUFFER_SHIFT, TIMES_COLUMNS, FrameTimes
from ranger_sim.foundation.events import CAN_TX_DONE, FLAG_ERROR, FLAG_SINGLE_SHOT, TX_ABORTED, TX_LOST, TX_SENT

from . import bit_oracle as oracle
from .oracle_comparison import BIT_NS, KINDS, TAIL, flags_of, run_on_our_bus, run_on_the_oracle, scenario_of, words

SEEDS = 10  # of each kind
INTERMISSION = 3
DEAF = 1  # this node does not listen: it acknowledges, and what only it would hear is lost


class Seen:
    """What both saw of one scenario. `sent`: bit at which frames ended: [(node, Frame)]."""

    def __init__(self, kind, seed):
        self.rows = array.array("q")

        def prepare(bus):
            bus.nodes[DEAF].listening = False
            bus.log.times = FrameTimes()
            bus.log.times.sink = lambda _time, rows: self.rows.frombytes(rows)

        scenario = scenario_of(kind, seed)
        self.bus, inboxes, accepted = run_on_our_bus(scenario, prepare=prepare)
        self.bus.log.times.flush()
        self.requests = [each for each in accepted if isinstance(each[2], oracle.Frame)]
        self.asked = {id(frame): (bit * BIT_NS - 1, node) for bit, node, frame in self.requests}
        self.over = not self.bus.disturbed and self.bus.free_bit < scenario.bits and not self.bus.buffers.waiting_count
        self.ends = collections.Counter()
        for inbox in inboxes:
            while inbox.take():
                self.ends[inbox.c] += inbox.kind == CAN_TX_DONE
        self.nodes = run_on_the_oracle(scenario, accepted)[1]
        self.sent = collections.defaultdict(list)
        for number, node in enumerate(self.nodes):
            for bit, what, *more in node.events:
                if what == "sent":
                    self.sent[bit].append((number, more[0]))

    def count(self, what, number=None):
        """How often something happened, to one node or to all."""
        nodes = self.nodes if number is None else [self.nodes[number]]
        return sum(event[1] == what for node in nodes for event in node.events)

    def got(self, bit):
        """True when a node that listens had the frame, one bit before its sender was done at `bit`."""
        return any(
            event[:2] == (bit - 1, "received")
            for number, node in enumerate(self.nodes)
            if number != DEAF
            for event in node.events
        )


@pytest.fixture(scope="module", params=KINDS)
def scenarios(request):
    """Those of a kind that were over in time."""
    seen = [Seen(request.param, seed) for seed in range(SEEDS)]
    return [each for each in seen if each.over]


def length(frame):
    """Bits of a frame, from its start to the end of its end of frame."""
    return len(oracle.stuffed(frame)[0]) + TAIL


def test_enough_scenarios_are_over_in_time(scenarios, request):
    if "noise" not in request.node.name:  # where often nothing comes to an end
        assert len(scenarios) > SEEDS // 2
        assert sum(len(each.sent) for each in scenarios) > 2 * len(scenarios)


def test_counts_of_frames_are_those_of_what_was_seen_on_the_wire(scenarios):
    for seen in scenarios:
        counters, nodes = seen.bus.counters, seen.bus.nodes
        assert counters.frames == len(seen.sent)
        assert counters.merged == seen.count("sent") - len(seen.sent)
        assert [node.sent for node in nodes] == [seen.count("sent", n) for n in range(len(nodes))]
        received = [seen.count("received", n) if n != DEAF else 0 for n in range(len(nodes))]
        assert [node.received for node in nodes] == received
        unheard = sum(not seen.got(bit) for bit in seen.sent)
        assert counters.lost == unheard + counters.flushed
        assert [node.arbitrations_lost for node in nodes] == [
            seen.count("lost arbitration", n) for n in range(len(nodes))
        ]
        assert counters.arbitrations_lost == seen.count("lost arbitration")


def test_every_request_ends_once_and_is_counted_as_it_ended(scenarios):
    for seen in scenarios:
        counters, nodes = seen.bus.counters, seen.bus.nodes
        assert seen.bus.accepted == counters.over == len(seen.requests)
        assert seen.ends[TX_SENT] == seen.count("sent")
        # what takes its node off the bus as well is lost with all else that waits there
        off = [{event[0] for event in node.events if event[1] == "bus-off"} for node in seen.nodes]
        dropped = sum(
            event[1] == "single shot dropped" and event[0] not in off[number]
            for number, node in enumerate(seen.nodes)
            for event in node.events
        )
        assert seen.ends[TX_LOST] == counters.single_shot_dropped == dropped
        assert [node.retries for node in nodes] == [
            sum(not frame.single_shot and bit not in off[number] for bit, frame in node.failures)
            for number, node in enumerate(seen.nodes)
        ]
        for of_bus, of_nodes in (
            (counters.flushed, "flushed"),
            (counters.aborted, "aborted"),
            (counters.refused, "refused"),
            (counters.retries, "retries"),
            (counters.single_shot_skipped, "single_shot_skipped"),
        ):
            assert of_bus == sum(getattr(node, of_nodes) for node in nodes), of_nodes
        gone = seen.ends[TX_ABORTED]
        assert counters.flushed + counters.aborted <= gone <= counters.flushed + counters.aborted + counters.refused


def test_the_log_has_each_frame_at_the_time_at_which_receivers_had_it(scenarios):
    for seen in scenarios:
        logged = [each for each in seen.bus.log.frames if not each[2] & FLAG_ERROR]
        expected = []
        for bit in sorted(seen.sent):
            number, frame = seen.sent[bit][0]
            flags = flags_of(frame) & ~FLAG_SINGLE_SHOT
            expected.append((bit * BIT_NS, frame.identifier, flags, *words(frame.data), number))
        assert logged == expected


def test_each_frame_is_timed_from_its_request_to_its_end(scenarios):
    for seen in scenarios:
        rows = [tuple(seen.rows[at : at + TIMES_COLUMNS]) for at in range(0, len(seen.rows), TIMES_COLUMNS)]
        expected = []
        responses = collections.defaultdict(list)
        for bit in sorted(seen.sent):
            number, frame = seen.sent[bit][0]
            asked, asker = seen.asked[id(frame)]
            assert asker == number
            end = (bit + 1) * BIT_NS
            sender = number + 1 << SENDER_SHIFT | frame.buffer << TIMES_BUFFER_SHIFT | flags_of(frame)
            start = end - length(frame) * BIT_NS
            data = words(frame.data)
            expected.append((start, asked, end, frame.identifier, sender & ~FLAG_SINGLE_SHOT, *data))
            if not frame.extended:
                responses[frame.identifier].append(end - asked)
        assert [row for row in rows if not row[4] & FLAG_ERROR] == expected
        counters = seen.bus.counters
        found = [
            (identifier, count, longest)
            for identifier, (count, longest) in enumerate(
                zip(counters.frames_by_identifier, counters.response_max_ns, strict=True)
            )
            if count or longest
        ]
        assert found == [(each, len(took), max(took)) for each, took in sorted(responses.items())]


def test_error_frames_are_counted_logged_and_timed_alike(scenarios):
    for seen in scenarios:
        logged = [each for each in seen.bus.log.frames if each[2] & FLAG_ERROR]
        timed = [
            tuple(seen.rows[at : at + TIMES_COLUMNS])
            for at in range(0, len(seen.rows), TIMES_COLUMNS)
            if seen.rows[at + 4] & FLAG_ERROR
        ]
        assert len(logged) == len(timed) == seen.bus.counters.errors
        assert (len(logged) > 0) == (seen.count("error") > 0)
        errors = {event[0] for node in seen.nodes for event in node.events if event[1] == "error"}
        off = {event[0] for node in seen.nodes for event in node.events if event[1] == "bus-off"}
        for (end, identifier, flags, field, position, node), row in zip(logged, timed, strict=True):
            assert row[2:] == (end, identifier, node + 1 << SENDER_SHIFT | flags, field, position)
            assert row[0] == row[1]
            begun = row[0] // BIT_NS
            assert begun + position in errors
            # flag of six bits or more, delimiter of eight, unless who would send them is off the bus by this error
            shortest = 0 if begun + position in off else 6 + 8
            assert end >= (begun + position + 1 + shortest) * BIT_NS
            if node >= 0:
                assert identifier in {frame.identifier for _, number, frame in seen.requests if number == node}


def test_an_undisturbed_bus_is_taken_for_its_frames_and_their_intermissions(scenarios):
    for seen in scenarios:
        if seen.count("error") or seen.count("overload"):
            continue
        taken = sum(length(frames[0][1]) + INTERMISSION for frames in seen.sent.values())
        assert seen.bus.load.bits == taken
        now = seen.bus.free_bit
        assert seen.bus.load_mean(now * BIT_NS) == pytest.approx(taken / now, rel=1e-12)
