# cython: boundscheck=False, wraparound=False
# (every index below is an id held against the table's size, or a place in a list of ids)
"""IO data: between the serial link and the data table, once per slot each way.

Received frames overwrite value and time stamp together. Every variable of the send list that was written
since the link took it last is sent, in the order of the table, with its own stamp: so a command is sent
only when it is rewritten, and at most once per slot (robot.md N1.6, N4.13).
"""

import array

import cython

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.ssp_link import MainBrainSspLink
from ranger_sim.datatable.store import DataStore
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation.user_error import FirmwareError


@cython.cclass
class IoData:
    """`send_ids`: what may leave by the link, ascending. `time` follows the network time."""

    store: DataStore
    link: MainBrainSspLink
    time: NetworkTime
    subscriber: cython.longlong
    timestamp: cython.longlong
    turn: cython.longlong
    turn_every: cython.longlong
    slots: cython.longlong
    send_ids: cython.longlong[::1]
    dividers: cython.longlong[::1]
    turn_ids: cython.longlong[::1]

    def __init__(self, store, link, time, send_ids) -> None:
        self.store = store
        self.link = link
        self.time = time
        self.send_ids = array.array("q", self.known(send_ids))
        self.subscriber = 1  # SSP, bit of the store's read flags
        self.timestamp = 0  # id of TIMESTAMP
        # for buses slower than the robot's: the first list goes out in every n-th slot (n per entry), of the second one
        # entry in the last of every `turn_every` slots, in turn
        self.dividers = array.array("q", [1]) * len(self.send_ids)
        self.turn_ids = array.array("q")
        self.turn_every = 1
        self.turn = 0
        self.slots = 0

    def thin(self, send_ids, dividers, turn_ids, turn_every=1) -> None:
        """Send `send_ids` in every n-th slot only, n in `dividers`; of `turn_ids` one every so many slots, in turn."""
        if len(send_ids) != len(dividers):
            raise FirmwareError(f"io data: {len(dividers)} dividers for {len(send_ids)} variables")
        self.send_ids = array.array("q", self.known(send_ids))
        self.dividers = array.array("q", dividers)
        self.turn_ids = self.known(turn_ids)
        self.turn_every = turn_every
        self.turn = 0

    def known(self, numbers):
        """`numbers` as an array; UserError for one that is not an id of the table."""
        for number in numbers:
            if not 0 <= number < self.store.size:
                raise FirmwareError(f"io data: id {number} is not 0 ... {self.store.size - 1}")
        return array.array("q", numbers)

    def receive(self) -> object:
        """All waiting segments into the table; returns the number of frames."""
        link: MainBrainSspLink = self.link
        store: DataStore = self.store
        time: NetworkTime = self.time
        segment: SspSegment
        i: cython.longlong
        row: cython.longlong
        link.parse()
        for i in range(link.segments):
            segment = cython.cast(SspSegment, link.received[i])
            for row in range(0, 3 * link.received_frames[i], 3):
                store.set_word(segment.rows[row] & 0x7FF, segment.rows[row + 1], segment.rows[row + 2])
        time.ms = store.stamp(self.timestamp)
        return link.frames

    def send(self) -> object:
        """Queue what was rewritten; returns the number of frames. With all segments full the rest waits."""
        link: MainBrainSspLink = self.link
        store: DataStore = self.store
        sent: cython.longlong = 0
        number: cython.longlong
        place: cython.longlong
        flag: cython.longlong = 1 << self.subscriber
        self.slots += 1
        for place in range(len(self.send_ids)):
            number = self.send_ids[place]
            if store.unread[number] & flag and (self.dividers[place] == 1 or self.slots % self.dividers[place] == 0):
                if not link.send(number, store.words[number], store.stamps[number]):
                    break
                store.unread[number] &= ~flag
                sent += 1
        if len(self.turn_ids) > 0 and (self.slots + 1) % self.turn_every == 0:
            place = store.next_unread(self.turn_ids, self.turn + 1, self.subscriber)
            if place < 0:
                place = store.next_unread(self.turn_ids, 0, self.subscriber)
            if place >= 0:
                number = self.turn_ids[place]
                if link.send(number, store.get_word(number), store.stamp(number)):
                    store.mark_read(number, self.subscriber)
                    self.turn = place
                    sent += 1
        link.flush()
        return sent
