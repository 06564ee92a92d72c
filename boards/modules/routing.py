# cython: boundscheck=False, wraparound=False
# (every index below is a channel, an identifier held against the table's size, or a place of a ring, which is masked)
"""Routing: a table of 2032 identifiers, the rings in front of it, and the order in which frames move.

A table entry is a mask of destinations (bit 0 SSP, bits 1-4 CAN1-CAN4) and the source last seen (7: none
yet). Frames go to every destination but the channel they came from, in the order SSP, CAN1 ... CAN4.
Source: robot.md N1.5.
"""

from typing import Final

import cython

from ranger_sim.boards.modules.can_load import CanLoad
from ranger_sim.boards.modules.ssp_link import RouterSspLink
from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.peripherals.can_controller import EIGHT_BYTES
from ranger_sim.foundation.events import FLAG_REMOTE

IDENTIFIERS: Final = 2032  # 2032-2047 would begin with seven recessive bits, which CAN forbids
CHANNEL_SSP: Final = 0
FIRST_BUS: Final = 1
LAST_BUS: Final = 4
CHANNEL_OWN: Final = 5
SOURCE_UNKNOWN: Final = 7
# a row of the table: destinations, and the source above them
DESTINATIONS: Final = 0xFF
SOURCE_SHIFT: Final = 8
ALL_CHANNELS: Final = 0x1F
TO_SSP: Final = 1  # destinations: the main brain alone
NOT_LEARNED: Final = 0x701  # a row to the main brain, its source unknown
# rings: places are masked; one place stays empty
RECEIVE_RING: Final = 64
RECEIVE_MASK: Final = 63
RECEIVED: Final = 5  # numbers in a place: channel, identifier, flags and two words
TRANSMIT_RING: Final = 8
TRANSMIT_MASK: Final = 7
OWN_MASK: Final = 7
TO_SEND: Final = 4  # numbers in a place of a transmit ring or the own ring: identifier, flags and two words


@cython.final
@cython.cclass
class RoutingTable:
    """Destinations and learned sources of every identifier. `routes`: pairs (identifier, mask)."""

    rows: cython.longlong[2032]
    learned: cython.longlong
    changed: cython.longlong

    def __init__(self, routes=()) -> None:
        # every identifier that the table does not name goes to the main brain
        self.rows = [NOT_LEARNED] * 2032  # IDENTIFIERS
        self.learned = 0
        self.changed = 0
        for identifier, mask in routes:
            self.set_destinations(identifier, mask)

    @cython.ccall
    def set_destinations(self, identifier, mask) -> object:
        """Replace the destinations of `identifier`; IndexError above 2031."""
        if not 0 <= identifier < IDENTIFIERS:
            raise IndexError(f"routing table: identifier {identifier} is not 0 ... {IDENTIFIERS - 1}")
        self.rows[identifier] = self.rows[identifier] & ~DESTINATIONS | mask & ALL_CHANNELS

    @property
    def destinations(self):
        """Masks by identifier."""
        return [row & DESTINATIONS for row in list(self.rows)]

    @property
    def sources(self):
        """Channels by identifier; 7: none yet."""
        return [row >> SOURCE_SHIFT for row in list(self.rows)]

    @cython.ccall
    def learn(self, identifier: cython.longlong, channel: cython.longlong) -> cython.void:
        """Note the source of `identifier`; a changed source is accepted without a report."""
        before: cython.longlong = self.rows[identifier] >> SOURCE_SHIFT
        if before == channel:
            return
        if before == SOURCE_UNKNOWN:
            self.learned += 1
        else:
            self.changed += 1
        self.rows[identifier] = self.rows[identifier] & DESTINATIONS | channel << SOURCE_SHIFT

    @cython.ccall
    def subscribe(self, identifier: cython.longlong, channel: cython.longlong) -> cython.void:
        """A remote frame arrived from `channel`: send `identifier` there too from now on."""
        self.rows[identifier] |= 1 << channel


@cython.final
@cython.cclass
class Router:
    """The rings and the moves. `report(code)` receives errors.

    `one_frame_lag` is the firmware's quirk: its receive interrupt advances the write index before storing
    and its reader takes before advancing, so a frame waits for its successor.
    """

    # what the main loop and a frame touch
    rx_write: cython.longlong
    rx_read: cython.longlong
    own_write: cython.longlong
    own_read: cython.longlong
    to_route: cython.longlong
    waiting: cython.longlong
    table: RoutingTable
    ssp: RouterSspLink
    load: CanLoad
    routed: cython.longlong
    copies: cython.longlong
    one_frame_lag: cython.bint
    tx_write: cython.longlong[5]
    tx_read: cython.longlong[5]
    rx_rows: cython.longlong[320]
    own_rows: cython.longlong[32]
    tx_rows: cython.longlong[160]
    # the rest
    report: object
    receive_lost: cython.longlong
    own_lost: cython.longlong
    unroutable: cython.longlong
    transmit_lost: cython.longlong[5]
    receive_lost_from: cython.longlong[5]
    receive_full_codes: cython.longlong[5]

    def __init__(self, table: RoutingTable, ssp: RouterSspLink, load: CanLoad, report, one_frame_lag=False) -> None:
        self.table = table
        self.ssp = ssp
        self.load = load
        self.report = report
        self.one_frame_lag = one_frame_lag
        # rings of rows: channel, identifier, flags and two words; the two others without the channel
        self.rx_rows = [0] * 320  # RECEIVED x RECEIVE_RING
        self.rx_write = 0
        self.rx_read = 0
        self.to_route = 0  # frames in this ring and in the router's own
        self.tx_rows = [0] * 160  # TO_SEND x TRANSMIT_RING for each channel; that of the link stays empty
        self.waiting = 0  # frames in the four transmit rings
        self.tx_write = [0] * 5
        self.tx_read = [0] * 5
        self.own_rows = [0] * 32  # TO_SEND x 8
        self.own_write = 0
        self.own_read = 0
        self.receive_full_codes = [
            0,
            errors.CAN1_RX_BUF_OF,
            errors.CAN2_RX_BUF_OF,
            errors.CAN3_RX_BUF_OF,
            errors.CAN4_RX_BUF_OF,
        ]
        self.routed = 0
        self.copies = 0
        self.receive_lost = 0
        self.receive_lost_from = [0] * 5  # by channel
        self.own_lost = 0
        self.unroutable = 0
        self.transmit_lost = [0] * 5

    @cython.ccall
    def receive(
        self,
        channel: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        word0: cython.longlong,
        word1: cython.longlong,
    ) -> cython.bint:
        """The work of a CAN receive interrupt: one frame into the ring that the four buses share.

        63 frames fit; one more is lost, False, and CANn_RX_BUF_OF reported.
        """
        following: cython.longlong = (self.rx_write + 1) & RECEIVE_MASK
        row: cython.longlong = RECEIVED * self.rx_write
        self.load.counts[channel] += 1
        if following == self.rx_read:
            return self._lose(channel)
        if self.one_frame_lag:
            row = RECEIVED * following
        self.rx_rows[row] = channel
        self.rx_rows[row + 1] = identifier
        self.rx_rows[row + 2] = flags
        self.rx_rows[row + 3] = word0
        self.rx_rows[row + 4] = word1
        self.rx_write = following
        self.to_route += 1
        return True

    @cython.cfunc
    def _lose(self, channel: cython.longlong) -> cython.bint:
        """A frame from `channel` finds the ring full: False."""
        self.receive_lost += 1
        self.receive_lost_from[channel] += 1
        self.report(self.receive_full_codes[channel])
        return False

    @cython.ccall
    @cython.exceptval(check=False)
    def send(self, identifier: cython.longlong, word0: cython.longlong, word1: cython.longlong) -> cython.bint:
        """A frame of the router itself into its own ring (7 fit); False when it is lost."""
        following: cython.longlong = (self.own_write + 1) & OWN_MASK
        row: cython.longlong = TO_SEND * self.own_write
        if following == self.own_read:
            self.own_lost += 1
            return False
        self.own_rows[row] = identifier
        self.own_rows[row + 1] = EIGHT_BYTES
        self.own_rows[row + 2] = word0
        self.own_rows[row + 3] = word1
        self.own_write = following
        self.to_route += 1
        return True

    @cython.ccall
    def route_step(self, now: cython.longlong) -> cython.longlong:
        """Move up to three frames, one each from the link, the CAN ring and the own ring; return how many."""
        moved: cython.longlong = 0
        read: cython.longlong = self.rx_read
        row: cython.longlong = RECEIVED * read
        if self.ssp.received_read != self.ssp.received_write and self.ssp.take():
            self.load.counts[CHANNEL_SSP] += 1
            self.route(CHANNEL_SSP, self.ssp.rx_id, self.ssp.rx_flags, self.ssp.rx_word0, self.ssp.rx_word1, now)
            moved += 1
        if read != self.rx_write:
            self.to_route -= 1
            self.rx_read = (read + 1) & RECEIVE_MASK
            self.route(
                self.rx_rows[row],
                self.rx_rows[row + 1],
                self.rx_rows[row + 2],
                self.rx_rows[row + 3],
                self.rx_rows[row + 4],
                now,
            )
            moved += 1
        read = self.own_read
        if read != self.own_write:
            row = TO_SEND * read
            self.to_route -= 1
            self.own_read = (read + 1) & OWN_MASK
            self.route(
                CHANNEL_OWN,
                self.own_rows[row],
                self.own_rows[row + 1],
                self.own_rows[row + 2],
                self.own_rows[row + 3],
                now,
            )
            moved += 1
        return moved

    @cython.ccall
    def route(
        self,
        source: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        word0: cython.longlong,
        word1: cython.longlong,
        now: cython.longlong,
    ) -> cython.longlong:
        """Learn the frame's source and copy it to its destinations; return the number of copies."""
        mask: cython.longlong
        if not 0 <= identifier < IDENTIFIERS:
            self.unroutable += 1
            return 0
        self.routed += 1
        if flags & FLAG_REMOTE and FIRST_BUS <= source <= LAST_BUS:
            self.table.subscribe(identifier, source)
            return 0
        mask = self.table.rows[identifier]
        if mask >> SOURCE_SHIFT != source:
            self.table.learn(identifier, source)
        mask = mask & DESTINATIONS & ~(1 << source)
        if mask == TO_SSP:  # nearly all that satellites send
            self.copies += 1
            self.ssp.push(identifier, flags, word0, word1, now)
            return 1
        return self._spread(mask, identifier, flags, word0, word1, now)

    @cython.cfunc
    def _spread(
        self,
        mask: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        word0: cython.longlong,
        word1: cython.longlong,
        now: cython.longlong,
    ) -> cython.longlong:
        """Copy a frame to all destinations of `mask`; return their number."""
        channel: cython.longlong = 0
        n: cython.longlong = 0
        if mask & TO_SSP:
            self.ssp.push(identifier, flags, word0, word1, now)
            n += 1
        mask >>= 1
        while mask != 0:
            channel += 1
            if mask & 1:
                self.queue(channel, identifier, flags, word0, word1)
                n += 1
            mask >>= 1
        self.copies += n
        return n

    @cython.ccall
    @cython.exceptval(check=False)
    def queue(
        self,
        channel: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        word0: cython.longlong,
        word1: cython.longlong,
    ) -> cython.bint:
        """Into the transmit ring of a bus: 7 fit, one more is lost without an error, as on the robot."""
        write: cython.longlong = self.tx_write[channel]
        following: cython.longlong = (write + 1) & TRANSMIT_MASK
        row: cython.longlong = TO_SEND * (channel * TRANSMIT_RING + write)
        if following == self.tx_read[channel]:
            self.transmit_lost[channel] += 1
            return False
        self.waiting += 1
        self.tx_rows[row] = identifier
        self.tx_rows[row + 1] = flags
        self.tx_rows[row + 2] = word0
        self.tx_rows[row + 3] = word1
        self.tx_write[channel] = following
        return True

    @cython.ccall
    @cython.exceptval(check=False)
    def frames_for(self, channel: cython.longlong) -> cython.longlong:
        """Frames in the transmit ring of `channel`."""
        return (self.tx_write[channel] - self.tx_read[channel]) & TRANSMIT_MASK
