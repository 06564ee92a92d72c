"""boards.toml against the firmware: each board runs alone on a bench, and what it sends is compared with its lists.

Nothing is read out of the boards' tables but the numbers of slots, rows and entries: the names are those of the
frames that come out.
"""

import importlib

import pytest

from ranger_sim import datatable
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.store import BLUETOOTH
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.scheduler import Occasional
from ranger_sim.foundation.events import CAN_REQUEST, CAN_TX_DONE, SSP_START, STAGE_BUS, TX_SENT

QUANTUM_NS = 25_000  # below the 36 us of the shortest frame, as in the assembled robot
FRAME_NS = 37_000  # a frame of 8 bytes with intermission at 3 Mbit/s: 111 bits
SATELLITES = {
    "MCH": "ranger_sim.boards.hip.HipBoard",
    "MCFO": "ranger_sim.boards.outer_feet.OuterFeetBoard",
    "MCFI": "ranger_sim.boards.inner_feet.InnerFeetBoard",
    "MCSI": "ranger_sim.boards.steering.SteeringBoard",
    "UI": "ranger_sim.boards.user_interface.UserInterfaceBoard",
}
ROUTER = "ranger_sim.boards.can_router.CanRouterBoard"
MAIN_BRAIN = "ranger_sim.boards.main_brain.board.MainBrainBoard"
EVERY_BOARD = {**SATELLITES, "CSR": ROUTER, "MB": MAIN_BRAIN}


def power_up(path):
    """A board on a perfect crystal, powered at 0."""
    module, name = path.rsplit(".", 1)
    return getattr(importlib.import_module(module), name)(Crystal(), Quirks(), 0)


def run(board, until_ns, seen):
    """Run to `until_ns`; every message that comes out is given to `seen(outbox)`, every frame is acknowledged."""
    time = 0
    while time < until_ns:
        time += QUANTUM_NS
        board.advance(time)
        while board.outbox.take():
            out = board.outbox
            seen(out)
            if out.kind == CAN_REQUEST:
                done = max(out.time, time - QUANTUM_NS) + FRAME_NS
                board.inbox.push(done, STAGE_BUS * 256, CAN_TX_DONE, out.a, out.b, TX_SENT)


def occasional_of(schedule):
    """(row, entries) of the occasional list in a board's Schedule."""
    for index, row in enumerate(schedule.rows):
        for task in row:
            if isinstance(task, Occasional):
                return index, len(task.tasks)
    return None, 0


def is_error(name):
    return name.startswith("ERROR_")


def test_every_board_with_firmware_is_on_the_bench():
    assert set(EVERY_BOARD) == {board.name for board in datatable.load().boards if board.firmware}


@pytest.mark.parametrize("name", EVERY_BOARD)
def test_slot_length_rows_and_occasional_entries_are_those_of_the_boards_own_table(name):
    published = datatable.published_schedule(name)
    schedule = power_up(EVERY_BOARD[name]).scheduler.schedule
    assert schedule.slot_ns == published.slot_us * 1000
    assert len(schedule.rows) == len(published.rows)
    assert occasional_of(schedule) == (published.occasional_row, len(published.occasional))


@pytest.mark.parametrize("name", SATELLITES)
def test_a_satellite_sends_row_by_row_what_boards_toml_says(name):
    published = datatable.published_schedule(name)
    rows, calls = len(published.rows), len(published.occasional) + 1
    board = power_up(SATELLITES[name])
    slots = {}  # slot -> names sent in it

    def seen(out):
        if out.kind == CAN_REQUEST:
            slot = out.time // (published.slot_us * 1000)
            slots.setdefault(slot, []).append(all_variables.NAMES[out.c])

    run(board, (2 * rows * calls + 2 * rows) * published.slot_us * 1000, seen)
    first = min(slots)
    # the slot of row 0: every later one follows from it
    row_of_first = next(
        index for index, row in enumerate(published.rows) if slots[first][: len(row)] == list(row) and row
    )
    call = None
    compared = 0
    for slot in range(first, first + 2 * rows * calls):
        row = (row_of_first + slot - first) % rows
        sent = slots.get(slot, [])
        expected = [*published.every, *published.rows[row]]
        assert sent[: len(expected)] == expected, f"slot {slot}, row {row}"
        rest = sent[len(expected) :]
        if row != published.occasional_row:
            assert rest == [], f"slot {slot}, row {row}"
            continue
        if call is None:
            call = published.occasional.index(rest[0]) if rest else 0  # an error, if one waits, is entry 0
        entry = published.occasional[call % calls] if call % calls < calls - 1 else "(idle)"
        if entry.startswith("(") or (is_error(entry) and not rest):
            assert rest == [], f"slot {slot}, call {call}: {entry}"
        else:
            assert rest == [entry], f"slot {slot}, call {call}"
        call += 1
        compared += 1
    assert compared == 2 * calls


def frames_in(segment):
    """Identifiers of the frames in a segment of the link (robot.md N1.6), in order."""
    found = []
    for start in range(0, 30, 5):
        header = segment.words[start]
        if header >> 11 & 0x1F != 0b01111:
            break
        found.append(header & 0x7FF)
    return found


def test_the_router_sends_row_by_row_what_boards_toml_says():
    published = datatable.published_schedule("CSR")
    passes = 2 * (len(published.occasional) + 1)
    board = power_up(ROUTER)
    on_link, on_buses = [], {1: 0, 2: 0, 3: 0, 4: 0}

    def seen(out):
        if out.kind == SSP_START:
            on_link.extend(all_variables.NAMES[number] for number in frames_in(out.ref))
        elif out.kind == CAN_REQUEST and out.c == 0:
            on_buses[out.a] += 1

    pass_ms = len(published.rows) * published.slot_us // 1000
    run(board, (passes * pass_ms + pass_ms) * 1_000_000, seen)
    milliseconds = passes * pass_ms + pass_ms
    assert all(milliseconds - 2 <= count <= milliseconds for count in on_buses.values()), "a sync frame every ms"
    times = [index for index, name in enumerate(on_link) if name == "TIMESTAMP"]
    assert milliseconds - 3 <= len(times) <= milliseconds, "the time to the main brain in every slot"
    occasional = [name for name in on_link if name != "TIMESTAMP" and not is_error(name)]
    cycle = [name for name in published.occasional if not is_error(name)]
    assert occasional[: 2 * len(cycle)] == 2 * cycle
    assert len(occasional) <= 2 * len(cycle) + 1, "one idle call after the last entry"


def test_the_main_brain_writes_row_by_row_what_boards_toml_says():
    published = datatable.published_schedule("MB")
    board = power_up(MAIN_BRAIN)
    scheduled = [all_variables.ID_OF[name] for row in published.rows for name in row]
    assert scheduled and published.every == published.occasional == ()
    slots = 3 * len(published.rows)
    written = []  # (row, name) in the order of writing
    time, counted = 0, 0
    for number in scheduled:
        board.store.mark_read(number, BLUETOOTH)
    while counted <= slots:  # until the last of them has ended
        time += QUANTUM_NS
        board.advance(time)
        counted = board.scheduler.slot_count
        for number in scheduled:
            if board.store.is_unread(number, BLUETOOTH):
                board.store.mark_read(number, BLUETOOTH)
                written.append((board.scheduler.row, all_variables.NAMES[number]))
    one_pass = [(index, name) for index, row in enumerate(published.rows) for name in row]
    assert written == 3 * one_pass


@pytest.mark.parametrize("name", SATELLITES)
def test_a_satellite_listens_only_to_what_the_table_gives_it(name):
    generated = importlib.import_module(f"ranger_sim.datatable.generated.{name.lower()}")
    board = power_up(SATELLITES[name])
    received = {number for number, receiver in enumerate(board.can.receivers) if receiver is not None}
    assert received and received <= set(generated.RECEIVE)
    unheard = {generated.NAMES[number] for number in set(generated.RECEIVE) - received}
    # robot.md N2.4: nobody takes the main brain's status, the spares and what is reserved
    reserved = {"MB_STATUS", "MCFO_HS_STATE", "MCFI_HS_STATE", "UI_AUDIO", "ERROR_LCD", "MCSO_LEFT_ANKLE_ANGLE"}
    assert {variable for variable in unheard if "_EMPTY_" not in variable} <= reserved
