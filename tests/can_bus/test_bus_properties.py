"""Whatever is sent by whomever: nothing lost, doubled or reordered, and the lowest ready field wins."""

import hashlib
import json
import os
import pathlib
import subprocess
import sys

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from ranger_sim.can_bus.frame import FIELD_END, arbitration_key, frame_bits
from ranger_sim.can_bus.node import BUS_OFF
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_SINGLE_SHOT, TX_ABORTED, TX_LOST, TX_SENT
from tests.examples import examples

from .wiring import RATE, Wired

SECOND = 10**9
ROOT = pathlib.Path(__file__).parents[2]
COUNTED = (
    "frames", "merged", "lost", "single_shot_skipped", "single_shot_dropped", "retries", "errors", "refused",
    "arbitrations_lost", "aborted", "flushed", "late_results", "late_requests", "frames_by_identifier",
    "response_max_ns",
)  # fmt: skip


class BusMachine(RuleBasedStateMachine):
    """Nodes 0..2 send from buffer b the identifiers 8 k + 2 node + b; node 3 only listens.

    The model is the list of what was accepted; the log and the inboxes are held against it. Whether the
    lowest ready frame won is judged from the log alone, with whole-number fractions for the bit edges.
    """

    @initialize(rate=st.sampled_from([125_000, 1_000_000, 3_000_000]), noise=st.booleans(), seed=st.integers(0, 99))
    def build(self, rate, noise, seed):
        self.rate = rate
        self.wired = Wired(4, rate, seed)
        if noise:
            self.wired.bus.set_bit_error_rate(1e-3)
        self.noisy = noise
        self.time = 0
        self.number = 0
        self.open = {}  # (node, buffer) -> record that waits or is under way
        self.accepted = {}  # number -> record
        self.finished = {}  # number -> status
        self.heard = {n: [] for n in range(4)}
        self.free_bit = 0
        self.late_errors = {}  # identifier -> errors in its end of frame

    @rule(
        node=st.integers(0, 2),
        buffer=st.integers(1, 3),
        k=st.integers(0, 40),
        code=st.integers(4, 8),
        kind=st.sampled_from(["plain", "single", "extended"]),
        delay=st.integers(0, 400),
    )
    def request(self, node, buffer, k, code, kind, delay):
        identifier = 32 * k + 8 * node + buffer
        flags = code
        if kind == "extended":
            identifier = identifier << 18 | k
            flags |= FLAG_EXTENDED
        if kind == "single":
            flags |= FLAG_SINGLE_SHOT
        self.time += delay
        number = self.number
        taken = self.wired.send(node, identifier, self.time, buffer, flags, lo=number)
        assert taken == ((node, buffer) not in self.open)
        if taken:
            self.number += 1
            record = {
                "number": number, "node": node, "buffer": buffer, "time": self.time,
                "key": arbitration_key(identifier, flags), "identifier": identifier, "flags": flags,
                "abort": None, "sent": False,
            }  # fmt: skip
            self.open[node, buffer] = self.accepted[number] = record

    @rule(node=st.integers(0, 2), buffer=st.integers(1, 3), delay=st.integers(0, 400))
    def abort(self, node, buffer, delay):
        self.time += delay
        self.wired.bus.abort(node, buffer, self.time)
        if (node, buffer) in self.open:
            self.open[node, buffer]["abort"] = True
        # the answer must be there before the buffer is asked again
        self.pass_time(100_000)

    @rule(step=st.integers(1, 2_000_000))
    def pass_time(self, step):
        self.time += step
        self.wired.bus.advance(self.time)
        self.read()

    @precondition(lambda self: not self.noisy)
    @rule(count=st.integers(1, 3))
    def disturb(self, count):
        self.wired.bus.inject_errors(count)

    def read(self):
        """Compare the new output since the last time with the model."""
        for time, identifier, flags, lo, _hi, node in self.wired.log():
            if flags & FLAG_ERROR:
                if lo == FIELD_END:
                    self.late_errors[identifier] = self.late_errors.get(identifier, 0) + 1
                continue
            record = self.accepted[lo]
            assert (record["identifier"], record["flags"] & ~FLAG_SINGLE_SHOT) == (identifier, flags)
            assert record["node"] == node and not record["sent"]
            bits = frame_bits(identifier, flags, lo, 0)
            start = time * self.rate // SECOND - (bits - 1)
            # never on top of another frame; but a false bit may make the last one of intermission a start of frame
            assert start >= self.free_bit - self.noisy
            self.free_bit = start + bits + 3
            assert record["time"] * self.rate < start * SECOND  # asked strictly before
            for other in self.accepted.values():
                waiting = not other["sent"] and other["number"] not in self.finished
                if waiting and other is not record and other["abort"] is None:
                    if other["flags"] & FLAG_SINGLE_SHOT:
                        continue  # may have been dropped; seen at its TX_DONE
                    if other["time"] * self.rate < start * SECOND and self.calm(other["node"]):
                        assert (record["key"], node * 3 + record["buffer"]) < (
                            other["key"], other["node"] * 3 + other["buffer"],
                        )  # fmt: skip
            record["sent"] = True
        # whatever is still stamped in the future is read as well: a frame is decided at its start
        for n in range(4):
            for message in self.wired.messages(n):
                if message[0] == "rx":
                    self.heard[n].append(message[4])
                elif message[0] == "done":
                    _, time, buffer, status = message
                    self.answer(n, time, buffer, status)

    def calm(self, node):
        """Not suspended: a passive sender may have to wait. (At most nine frames have passed since the last look.)"""
        return max(self.wired.bus.nodes[node].transmit_errors, self.wired.bus.nodes[node].receive_errors) < 100

    def answer(self, node, time, buffer, status):
        record = self.open.pop((node, buffer))
        assert record["number"] not in self.finished
        self.finished[record["number"]] = status
        assert record["sent"] == (status == TX_SENT)
        if status == TX_LOST:
            assert record["flags"] & FLAG_SINGLE_SHOT
        if status == TX_ABORTED:
            assert record["abort"] or self.wired.bus.nodes[node].mode == BUS_OFF
        # nobody may ask again for a buffer before its answer is due
        if self.time < time:
            self.time = time

    @invariant()
    def every_frame_accounted_for(self):
        bus, counters = self.wired.bus, self.wired.bus.counters
        if bus.nodes[0].mode == BUS_OFF or bus.accepted == 0:
            return
        dropped = sum(1 for status in self.finished.values() if status == TX_LOST)
        over = counters.frames + counters.aborted + counters.flushed + dropped
        assert bus.accepted == over + bus.buffers.waiting_count

    def teardown(self):
        if not hasattr(self, "wired"):
            return
        self.wired.bus.set_bit_error_rate(0.0)
        self.wired.bus.inject_errors(0)
        self.time += SECOND
        self.wired.bus.advance(self.time)
        self.read()
        assert self.open == {}
        sent = [number for number, status in self.finished.items() if status == TX_SENT]
        for n in range(4):
            due = sorted(number for number in sent if self.accepted[number]["node"] != n)
            assert set(self.heard[n]) >= set(due)  # nothing lost
            # nothing twice and nothing that was not sent, unless the last bit of EOF was hit: then receivers have what
            # its sender repeats, or, a single shot or an aborted one, gives up
            for number in set(self.heard[n]):
                often = self.late_errors.get(self.accepted[number]["identifier"], 0)
                assert self.heard[n].count(number) <= (number in due) + often
            by_identifier = {}
            for number in self.heard[n]:
                by_identifier.setdefault(self.accepted[number]["key"], []).append(number)
            for numbers in by_identifier.values():
                assert numbers == sorted(numbers)  # nothing reordered within an identifier
        assert self.wired.bus.counters.lost == 0


BusMachine.TestCase.settings = settings(max_examples=examples(60), stateful_step_count=40)
TestWhateverIsSent = BusMachine.TestCase


REQUESTS = st.lists(
    st.tuples(
        st.integers(0, 3),  # node
        st.integers(1, 3),  # buffer
        st.integers(0, 3_000_000),  # time, ns
        st.integers(0, 60),  # identifier: equal ones from two nodes may collide
        st.sampled_from([8, 3, 8 | FLAG_SINGLE_SHOT]),
        st.integers(0, 3),
    ),
    max_size=30,
)


@settings(max_examples=examples(60))
@given(REQUESTS, st.lists(st.integers(2_000, 300_000), min_size=1, max_size=20), st.booleans(), st.integers(0, 2))
def test_results_do_not_depend_on_how_time_is_cut(requests, cuts, noise, errors):
    requests = sorted(requests, key=lambda request: request[2])

    def run(steps):
        wired = Wired(4, seed=3)
        if noise:
            wired.bus.set_bit_error_rate(2e-3)
        if errors:
            wired.bus.inject_errors(errors)
        time = 0
        waiting = list(requests)
        position = 0
        while time < 4_000_000:
            until = time + steps[position % len(steps)]
            position += 1
            while waiting and waiting[0][2] < until:
                node, buffer, at, identifier, flags, lo = waiting.pop(0)
                # two requests into one buffer: only results with full knowledge of it are comparable
                wired.bus.advance(at)
                wired.send(node, identifier, at, buffer, flags, lo)
            wired.bus.advance(until)
            time = until
        assert waiting == []
        wired.bus.advance(SECOND // 10)
        return [wired.messages(n) for n in range(4)], wired.bus.log.take(), wired.bus.load.bits

    assert run([25_000]) == run(cuts)


def test_late_results_are_counted_when_steps_are_longer_than_frames():
    wired = Wired(2)
    wired.send(0, 1)
    wired.bus.advance(1_000_000)
    assert wired.bus.counters.late_results > 0
    wired = Wired(2)
    wired.send(0, 1)
    for step in range(10):
        wired.bus.advance(step * 25_000)
    assert wired.bus.counters.late_results == 0 and wired.bus.counters.frames == 1


def test_a_request_from_the_past_takes_part_from_now_on_and_is_counted():
    wired = Wired(2)
    wired.bus.advance(1_000_000)
    wired.send(0, 1, time=400_000)
    wired.bus.advance(2_000_000)
    assert wired.bus.counters.late_requests == 1
    assert wired.of(1, "rx")[0][0] > 1_000_000


# ---- both ways of running --------------------------------------------------------------------------------


def digest_of_a_busy_second() -> str:
    """SHA-256 over everything that a noisy, crowded bus did."""
    wired = Wired(4, RATE, seed=7)
    digest = hashlib.sha256()
    time = 31 * 3600 * SECOND
    wired.bus.reset_statistics(time)
    wired.bus.advance(time)
    wired.bus.set_bit_error_rate(5e-4)
    for i in range(1500):
        node = i * 7 % 4
        flags = (8, 8 | FLAG_SINGLE_SHOT, 3, 8 | FLAG_EXTENDED)[i % 4]
        wired.send(node, i * 40503 % 2048, time + i % 333, i % 3 + 1, flags, i * 2654435761, i * i)
        if i % 97 == 0:
            wired.bus.abort(node, i % 3 + 1, time + 400)
        if i % 10 == 0:
            wired.send(3, 0, time + 5, 3, 8 | FLAG_SINGLE_SHOT, i, i)
        time += 25_000
        wired.bus.advance(time)
        if wired.bus.nodes[node].mode == BUS_OFF:
            wired.bus.set_mode(node, 0, time)
    for n in range(4):
        digest.update(json.dumps(wired.messages(n)).encode())
    counters = wired.bus.counters
    digest.update(json.dumps([wired.log(), wired.bus.load_mean(time), wired.bus.load.largest()]).encode())
    digest.update(json.dumps([getattr(counters, name) for name in COUNTED]).encode())
    assert counters.errors > 10 and counters.frames > 800 and counters.single_shot_skipped > 10
    return digest.hexdigest()


def test_interpreted_and_compiled_do_the_same_to_the_bit():
    here = digest_of_a_busy_second()
    assert digest_of_a_busy_second() == here
    program = "from tests.can_bus.test_bus_properties import digest_of_a_busy_second as d; print(d())"
    for interpreted, hash_seed in (("1", "1"), ("0", "2")):
        environment = dict(os.environ, RANGER_SIM_INTERPRETED=interpreted, PYTHONHASHSEED=hash_seed)
        there = subprocess.run(
            [sys.executable, "-c", program], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
        )
        assert there.stdout.strip() == here
