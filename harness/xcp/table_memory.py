"""The main brain's data table as memory of an XCP slave: all of it is readable, only parameters are writable."""

from __future__ import annotations

from typing import Any

from ranger_sim.datatable import parameters
from ranger_sim.datatable.addresses import BASE, WORD_BYTES, address_of
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.kinds import SET_WORD
from ranger_sim.harness.xcp.slave import ERR_ACCESS_DENIED, ERR_OUT_OF_RANGE, XcpError


class TableMemory:
    """Words of `robot`'s main brain at `addresses.address_of` their ids; also of one in another process."""

    def __init__(self, robot: Any) -> None:
        self.robot = robot
        self.by_id = {row.id: row for row in parameters.rows().values()}
        self.end = address_of(max(self.by_id) + 1)
        self.refused = 0  # writes

    def read(self, address: int, count: int) -> bytes:
        """Bytes of words; ERR_OUT_OF_RANGE beyond the table."""
        if count < 1 or not BASE <= address <= self.end - count:
            raise XcpError(ERR_OUT_OF_RANGE)
        memory = self.robot.loop.board("MB").memory
        first, skipped = divmod(address - BASE, WORD_BYTES)
        last = (address - BASE + count - 1) // WORD_BYTES
        data = b"".join((memory[each] & 0xFFFFFFFF).to_bytes(WORD_BYTES, "little") for each in range(first, last + 1))
        return data[skipped : skipped + count]

    def write(self, address: int, data: bytes) -> None:
        """Whole words of parameters, all within their limits; otherwise XcpError, and none is changed."""
        try:
            words = self._checked(address, data)
        except XcpError:
            self.refused += 1
            raise
        board = self.robot.loop.board("MB")
        for number, word in words:
            if hasattr(board, "store"):
                board.store.set_word(number, word, board.time.ms)
            else:  # it runs in another process
                board.send(SET_WORD, self.robot.loop.time, number, word)

    def _checked(self, address: int, data: bytes) -> list[tuple[int, int]]:
        """(id, word) of each parameter that would be written."""
        first, skipped = divmod(address - BASE, WORD_BYTES)
        if skipped or len(data) % WORD_BYTES or not BASE <= address <= self.end - len(data):
            raise XcpError(ERR_OUT_OF_RANGE)
        words = []
        for place in range(len(data) // WORD_BYTES):
            row = self.by_id.get(first + place)
            if row is None or not parameters.is_parameter(row):
                raise XcpError(ERR_ACCESS_DENIED)
            word = int.from_bytes(data[place * WORD_BYTES : (place + 1) * WORD_BYTES], "little")
            try:
                words.append((row.id, parameters.checked_word(row, value_of_word(row.type, word))))
            except UserError:
                raise XcpError(ERR_OUT_OF_RANGE) from None
        return words
