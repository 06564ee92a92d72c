"""A timeline on rows by hand: which frame an interrupt was for, who asked, what a processor did, what is kept."""

import itertools
from types import SimpleNamespace as Made

import numpy as np
import pytest

from ranger_sim.can_bus.frame_log import SENDER_SHIFT, TIMES_BUFFER_SHIFT
from ranger_sim.datatable.generated import all_variables
from ranger_sim.firmware_sim import activity
from ranger_sim.firmware_sim.legend import InterruptLegend, Legend, TaskLegend
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED
from ranger_sim.harness.timeline import arrows, perfetto_file, perfetto_reader
from ranger_sim.harness.timeline.frames import BusFrames, frame_name
from ranger_sim.harness.timeline.model import Counter, Events, Instant, Instants, Slices, changes, runs
from ranger_sim.harness.timeline.processors import Processor
from ranger_sim.ranger.names import RANGER
from ranger_sim.ranger.timeline import flows


def numbers(*values):
    return np.array(values, dtype=np.int64)


def slices(*spans, names=("x",), name=None, path=("a", "b"), **more):
    start, end = (numbers(*(each[place] for each in spans)) for place in (0, 1))
    return Slices(path, list(names), start, end, numbers(*(name or [0] * len(spans))), **more)


# ---- what is kept


def test_a_value_that_stays_is_one_stretch_and_the_last_ends_with_the_run():
    time, values = changes(numbers(1, 2, 3, 4, 5), numbers(7, 7, 8, 8, 7))
    assert (time.tolist(), values.tolist()) == ([1, 3, 5], [7, 8, 7])
    assert [each.tolist() for each in runs(numbers(1, 2, 3), numbers(7, 7, 8), 9)] == [[1, 3], [3, 9], [7, 8]]
    assert [each.tolist() for each in runs(numbers(), numbers(), 9)] == [[], [], []]


def test_tracks_are_found_by_their_path_and_slices_by_their_name():
    one = slices((0, 1), (2, 3), (4, 5), names=("x", "y"), name=[1, 0, 1])
    counter = Counter(("c",), "V", numbers(1), numbers(2))
    events = Events(0, 9, [one], [counter])
    assert events.track("a", "b") is one and events.counter("c") is counter and len(one) == 3
    assert [each.tolist() for each in one.starts_of("y")] == [[0, 2], [0, 4]]
    assert [each.tolist() for each in one.starts_of("z")] == [[], []]
    for missing in (lambda: events.track("a"), lambda: events.counter("a", "b")):
        with pytest.raises(KeyError):
            missing()


# ---- arrows


def test_arrows_are_numbered_on_and_a_pair_without_an_end_has_none():
    book = arrows.FlowBook()
    one, other = slices((0, 1), (2, 3)), slices((5, 6), (7, 8))
    book.connect(one, numbers(0, -1, 1), other, numbers(1, 1, -1))
    book.connect(one, numbers(1, 0), other, numbers(0, 0))
    assert one.flow_at.tolist() == [0, 1, 0] and one.flow_id.tolist() == other.flow_id.tolist() == [1, 2, 3]
    assert other.flow_at.tolist() == [1, 0, 0]
    assert one.flow_ends.tolist() == [0, 0, 0] and other.flow_ends.tolist() == [1, 1, 1] and book.last == 3


def test_the_slice_that_goes_on_at_a_time_has_both_its_ends():
    found = arrows.containing(slices((10, 20), (30, 40)), numbers(9, 10, 20, 21, 29, 30, 40, 41))
    assert found.tolist() == [-1, 0, 0, -1, -1, 1, 1, -1]
    assert arrows.containing(slices(), numbers(1, 2)).tolist() == [-1, -1]


def test_a_request_is_a_tasks_at_its_start_else_the_interrupts_or_the_turns_then():
    processor = Made(
        tasks=slices((10, 20), (30, 40)), fast=slices((12, 14)), services=slices((11, 18)), turns=slices((0, 99))
    )
    found = arrows.asking(processor, numbers(10, 12, 16, 30, 31, 100))
    assert [rows.tolist() for _, rows in found] == [
        [0, -1, -1, 1, -1, -1],
        [-1, 0, -1, -1, -1, -1],
        [-1, -1, 0, -1, -1, -1],
        [-1, -1, -1, -1, 0, -1],
    ]
    assert [each for each, _ in found] == [processor.tasks, processor.fast, processor.services, processor.turns]


@pytest.mark.parametrize(
    ("came", "asked", "found"),
    [
        ([], [5], []),
        ([10], [], [-1]),
        ([10, 20], [10, 20], [0, 1]),
        ([10, 20], [12, 18], [0, 1]),  # both instants are rounded
        ([10, 20], [13, 17], [1, -1]),  # both are late, and the latest is for the latest frame before it
        ([10, 20], [8, 25], [0, 1]),
        ([10, 20], [7, 25], [-1, 1]),
        ([10, 20], [25], [-1, 0]),  # the later frame
        ([10, 20], [119, 120], [-1, 1]),
        ([10, 20], [121], [-1, -1]),  # more than the 100 that it may take
        ([10, 20], [120], [-1, 0]),
        ([10, 20, 30], [20, 45], [-1, 0, 1]),
        ([10, 20, 30], [25, 30], [-1, 0, 1]),
        ([10, 20, 30], [30, 41, 42], [1, 2, 0]),
    ],
)
def test_an_interrupt_is_for_the_frame_received_then_or_for_the_latest_one_left(came, asked, found):
    assert flows.paired(numbers(*came), numbers(*asked), 100).tolist() == found


def test_the_next_start_is_behind_the_time():
    found = flows.next_start(numbers(4, 7, 9), numbers(10, 20, 30), numbers(0, 10, 19, 20, 29, 30))
    assert found.tolist() == [4, 7, 7, 9, 9, -1]


def passing(*rows):
    made = flows.Passing.__new__(flows.Passing)
    made.rows = np.arange(len(rows))
    made.content = np.array([each[0] for each in rows], dtype=np.int64).reshape(-1, 3)
    made.time_ns = numbers(*(each[1] for each in rows))
    return made


def test_a_passing_frame_is_the_first_of_the_same_content_that_is_not_earlier():
    a, b = (5, 1, 2), (5, 2, 1)
    offered = np.array([a, b, a, a], dtype=np.int64)
    time = numbers(10, 10, 30, 20)
    frames = passing((a, 0), (a, 10), (a, 11), (a, 21), (a, 31), (b, 10), (b, 11))
    assert flows.first_after(frames, offered, time).tolist() == [0, 0, 3, 2, -1, 1, -1]
    far = flows.LONGEST_WAY_NS
    late = np.array([a], dtype=np.int64)
    assert flows.first_after(passing((a, 10)), late, numbers(10 + far)).tolist() == [0]
    assert flows.first_after(passing((a, 10)), late, numbers(11 + far)).tolist() == [-1]
    assert flows.first_after(passing(), late, numbers(1)).tolist() == []
    assert flows.first_after(passing((a, 1)), np.zeros((0, 3), dtype=np.int64), numbers()).tolist() == [-1]


def test_a_number_represents_all_three_words_of_a_frame():
    top = 0xFFFFFFFF
    rows = [
        (1, 0, 0),
        (0, 1, 0),
        (0, 0, 1),
        (1, 0, 0),
        (1, 1, 0),
        (0x1FFFFFFF, top, top),
        (0x1FFFFFFE, top, top),
        (0, top, 0),
    ]
    found = flows.numbered(np.array(rows, dtype=np.int64)).tolist()
    for (one, first), (other, second) in itertools.combinations(zip(rows, found, strict=True), 2):
        assert (one == other) == (first == second)


def test_a_pair_that_several_frames_have_in_common_is_one_arrow():
    target = slices((0, 1))
    rows, same, at = flows.once(numbers(3, 3, 1, -1, 2), numbers(4, 4, 0, 1, -1), target)
    assert (rows.tolist(), same is target, at.tolist()) == ([1, 3], True, [0, 4])


def test_frames_of_one_exchange_of_the_link_are_one_slice():
    rows = np.array([[100, 0, 0x8005, 1, 2], [100, 0, 0x0006, 3, 4], [300, 0, 0x17FF, 5, 6]])
    made = flows.Direction("to the main brain", rows, 40)
    assert made.slices.path == ("Link", "to the main brain")
    assert made.slices.start_ns.tolist() == [60, 260]
    assert (made.slices.end_ns - made.slices.start_ns).tolist() == [flows.EXCHANGE_NS] * 2
    assert [made.slices.names[each] for each in made.slices.name] == ["2 frames", "1 frame"]
    assert made.exchange.tolist() == [0, 0, 1] and made.identifier.tolist() == [5, 6, 0x7FF]
    assert flows.contents(made).tolist() == [[5, 1, 2], [6, 3, 4], [0x7FF, 5, 6]]
    both = flows.Exchanges(np.array([[100, 0, 5, 1, 2], [100, 1, 6, 3, 4]]), 0)
    assert (both.to_main_brain.identifier.tolist(), both.to_router.identifier.tolist()) == ([5], [6])


# ---- frames


def frames(*rows, bitrate=3_000_000):
    """Rows (start, asked, end, identifier, sender, buffer, flags, low, high)."""
    packed = [
        (a, b, c, i, (node + 1) << SENDER_SHIFT | buffer << TIMES_BUFFER_SHIFT | flags, lo, hi)
        for a, b, c, i, node, buffer, flags, lo, hi in rows
    ]
    bus = Made(name="can1", bitrate=bitrate, is_fd=False, nodes=[Made(name="A"), Made(name="B")])
    return BusFrames(bus, RANGER, np.array(packed, dtype=np.int64), 1000)


ANGLE = next(number for number, kind in all_variables.TYPES.items() if kind == "f32")
COUNT = next(number for number, kind in all_variables.TYPES.items() if kind == "i32")


def test_frames_are_in_order_with_their_senders_and_contents():
    made = frames(
        (9000, 8000, 9900, COUNT, 1, 3, 0, -2 & 0xFFFFFFFF, 7),
        (5000, 4500, 5900, ANGLE, 0, 1, 0, 0x3FC00000, 8),
        (7000, 7000, 7100, ANGLE, -1, 0, FLAG_ERROR, 3, 9),
        (8000, 8000, 8100, ANGLE, 5, 0, FLAG_EXTENDED, 4, 9),
    )
    assert made.start_ns.tolist() == [4000, 6000, 7000, 8000] and made.asked_ns.tolist() == [3500, 6000, 7000, 7000]
    assert made.end_ns.tolist() == [4900, 6100, 7100, 8900]
    assert (made.end_ns - made.heard_ns).tolist() == [334] * 4  # a bit of 333.3 ns, rounded up
    assert made.sender.tolist() == [0, -1, 5, 1] and made.buffer.tolist() == [1, 0, 0, 3]
    assert made.is_error.tolist() == [False, True, False, False]
    assert made.slices.notes["value"].tolist()[:2] == [1.5, 3.0] and made.slices.notes["value"][3] == -2.0
    assert made.slices.notes["waited_us"].tolist() == [0.5, 0.0, 0.0, 1.0]
    names = [made.slices.names[each] for each in made.slices.name]
    own, count = all_variables.NAMES[ANGLE], all_variables.NAMES[COUNT]
    assert names == [own, f"error frame: {own}", f"{ANGLE:X}", count]
    assert [made.slices.labels["sender"][each] for each in made.slices.name] == ["A", "", "", "B"]
    assert frames((0, 0, 1, 1, 0, 0, 0, 0, 0), bitrate=1_000_000).heard_ns.tolist() == [1 - 1000 - 1000]


def test_a_frame_without_a_name_has_its_identifier():
    assert frame_name(RANGER, 0x7FF, 0) == "7FF" and frame_name(RANGER, ANGLE, FLAG_EXTENDED) == f"{ANGLE:X}"
    assert frame_name(RANGER, 0x7FF, FLAG_ERROR) == "error frame: 7FF"


def test_the_frames_waiting_in_each_transmit_buffer_are_a_separate_track():
    made = frames(
        (5000, 4000, 5900, ANGLE, 0, 1, 0, 0, 0),
        (6000, 4000, 6900, ANGLE, 0, 3, 0, 0, 0),
        (7000, 6000, 7900, ANGLE, 1, 2, 0, 0, 0),
        (8000, 7500, 8900, ANGLE, 0, 1, 0, 0, 0),
        (9000, 9000, 9900, ANGLE, 0, 0, 0, 0, 0),
    )
    found = {
        each.path[-1]: list(zip(each.start_ns.tolist(), each.end_ns.tolist(), strict=True)) for each in made.waits()
    }
    assert found == {
        "A waits, buffer 1": [(3000, 4000), (6500, 7000)],
        "A waits, buffer 3": [(3000, 5000)],
        "B waits, buffer 2": [(5000, 6000)],
    }


# ---- processors


def row(kind, number, start, end, cycles=0, latency=0, in_row=0, items=0):
    return [kind, number, start, end, cycles, latency, in_row, items]


LEGEND = Legend(
    board="X",
    hz=60_000_000,
    cycles_per_ns=0.5,
    slot_ns=100,
    slot_cycles=50,
    tasks=(
        TaskLegend("a", 1, 0, 0, ""),
        TaskLegend("list", 1, 0, 0, "", entries=(2,)),
        TaskLegend("entry", 1, 0, 0, ""),
        TaskLegend("wait", 1, 0, 0, "", spins=True),
    ),
    interrupts=(InterruptLegend("timer", 1, 0, 10, False), InterruptLegend("edge", 1, 0, 4, True)),
    rows=((0, 3), (1,)),
)


def processor(*rows):
    return Processor(LEGEND, [np.array(rows, dtype=np.int64)], 1000)


def spans(made):
    return list(zip(made.start_ns.tolist(), made.end_ns.tolist(), strict=True))


def test_a_processors_slots_tasks_interrupts_and_turns_are_slices():
    made = processor(
        row(activity.SLOT_BEGAN, 1, 1100, 1100, items=2),
        row(activity.INTERRUPT_RAN, 0, 1100, 1110, 5, 6),
        row(activity.TASK_RAN, 0, 1110, 1150, 15),
        row(activity.INTERRUPT_RAN, 1, 1120, 1130, 4, 3),
        row(activity.WAIT_RAN, 3, 1150, 1160, 5),
        row(activity.SLOT_ENDED, 1, 1100, 1160, 30),
        row(activity.MAIN_LOOP_RAN, 0, 1160, 1200, 20),
        row(activity.SLOT_BEGAN, 2, 1200, 1200, in_row=1, items=1),
        row(activity.TASK_RAN, 2, 1210, 1230, 7, in_row=1),
        row(activity.TASK_RAN, 1, 1210, 1230, 3, in_row=1),
        row(activity.SLOT_ENDED, 2, 1200, 1230, 15, in_row=1),
    )
    assert spans(made.slots) == [(100, 160), (200, 230)] and made.slots.name.tolist() == [0, 1]
    assert made.slots.names == ["row 0", "row 1"] and made.slots.notes["cycles"].tolist() == [30, 15]
    assert spans(made.tasks) == [(110, 150), (150, 160), (210, 230)] and made.tasks.name.tolist() == [0, 3, 2]
    assert made.tasks.notes["cycles"].tolist() == [15, 5, 7]
    assert spans(made.services) == [(100, 110)] and spans(made.fast) == [(120, 130)]
    assert made.services.notes["latency_us"].tolist() == [0.006] and made.fast.notes["cycles"].tolist() == [4]
    # start and latency are those of the way to the handler, 10 cycles of 2 ns and 4
    assert made.services_asked_ns.tolist() == [100 + 20 - 6] and made.fast_asked_ns.tolist() == [120 + 8 - 3]
    assert spans(made.turns) == [(160, 200)] and made.turns.names == ["turn"]
    assert made.slots.path == ("Boards", "X", "slots") and made.turns.path == ("Boards", "X", "main loop")
    assert made.slots.inside is made.tasks and made.services.inside is made.fast
    assert made.tracks() == [made.slots, made.services, made.turns] and made.overruns.events == []


def test_an_empty_processor_has_no_tracks_and_one_with_fast_interrupts_alone_has_theirs():
    empty = Processor(LEGEND, [], 0)
    assert empty.tracks() == []
    fast = processor(row(activity.INTERRUPT_RAN, 1, 1120, 1130, 4, 3))
    assert fast.tracks() == [fast.services]


def test_a_list_without_its_entry_is_shown_itself():
    made = processor(row(activity.TASK_RAN, 1, 1210, 1230), row(activity.TASK_RAN, 0, 1230, 1240))
    assert made.tasks.name.tolist() == [1, 0]
    other = processor(row(activity.TASK_RAN, 2, 1210, 1220), row(activity.TASK_RAN, 1, 1210, 1230))
    assert other.tasks.name.tolist() == [2, 1]


def test_a_slot_that_did_not_end_lasts_until_its_latest_task_and_the_next_begins_behind_it():
    made = processor(
        row(activity.SLOT_BEGAN, 1, 1100, 1100, items=2),
        row(activity.TASK_RAN, 0, 1110, 1230, 60),
        row(activity.SLOT_BEGAN, 2, 1200, 1200, in_row=1, items=1),
        row(activity.TASK_RAN, 0, 1240, 1250, 5, in_row=1),
        row(activity.SLOT_ENDED, 2, 1200, 1250, 25, in_row=1),
        row(activity.SLOT_BEGAN, 3, 1300, 1300, items=2),
    )
    assert spans(made.slots) == [(100, 230), (230, 250), (300, 300)] and made.slots.name.tolist() == [0, 1, 0]
    assert made.slots.notes["cycles"].tolist() == [65, 25, 0]  # 130 ns at half a cycle a ns


def test_a_slot_that_was_dropped_as_a_whole_is_not_shown_and_each_overrun_lists_what_was_dropped():
    made = processor(
        row(activity.SLOT_BEGAN, 1, 1100, 1100, items=2),
        row(activity.TASK_RAN, 0, 1110, 1320, 60),
        row(activity.TASK_DROPPED, 3, 1200, 1200),
        row(activity.TASK_DROPPED, 0, 1200, 1200),
        row(activity.SLOT_OVERRAN, 1, 1100, 1200, items=1),
        row(activity.SLOT_BEGAN, 2, 1200, 1200, in_row=1, items=1),
        row(activity.SLOT_OVERRAN, 2, 1200, 1300, in_row=1, items=1),
    )
    assert spans(made.slots) == [(100, 320)]
    assert made.overruns.path == ("Boards", "X", "overruns")
    assert made.overruns.events == [
        Instant(200, "row 0 overran", {"slot": 1.0, "dropped": 1.0, "functions": "wait, a"}),
        Instant(300, "row 1 overran", {"slot": 2.0, "dropped": 1.0}),
    ]


# ---- the file


def test_a_small_timeline_is_read_back_with_all_that_it_has(tmp_path):
    pytest.importorskip("perfetto.protos.perfetto.trace.perfetto_trace_pb2")
    inside = slices((12, 14), (15, 20), (30, 35), names=("p", "q"), name=[0, 1, 0], path=("G", "in"))
    outer = slices(
        (10, 20), (30, 40), names=("x", "y"), name=[1, 0], path=("G", "out"),
        notes={"n": np.array([1.5, -2.0]), "m": numbers(3, 4)}, labels={"who": ["", "me"]},
    )  # fmt: skip
    outer.inside = inside
    other = slices((50, 60), (60, 61), (70, 90), path=("H", "K", "late"))
    book = arrows.FlowBook()
    book.connect(outer, numbers(0, 0, 1), other, numbers(2, 1, 1))
    book.connect(inside, numbers(2), outer, numbers(1))
    events = Events(
        0,
        99,
        [outer, other],
        [Counter(("H", "volts"), "V", numbers(1, 7), np.array([0.25, -8.0]), "of the battery")],
        [Instants(("G", "now"), [Instant(5, "bang", {"why": "so", "how": 2.5}), Instant(6, "puff")])],
    )
    with (tmp_path / "x").open("wb") as file:
        perfetto_file.write(events, file, "a title")
    trace = perfetto_reader.read(tmp_path / "x")
    paths = {trace.path(track): track for track in trace.tracks.values()}
    assert list(paths) == [
        (),
        ("G",),
        ("G", "now"),
        ("G", "out"),
        ("H",),
        ("H", "K"),
        ("H", "K", "late"),
        ("H", "volts"),
    ]
    assert [track.rank for track in trace.tracks.values()] == list(range(8))
    assert (paths[()].description, paths["H", "volts"].description) == ("a title", "of the battery")
    assert (paths["H", "volts"].unit, paths["G", "out"].unit) == ("V", None)
    assert (paths["H", "volts"].time_ns, paths["H", "volts"].values) == ([1, 7], [0.25, -8.0])
    assert [(each.start_ns, each.name, each.notes) for each in paths["G", "now"].instants] == [
        (5, "bang", {"why": "so", "how": 2.5}),
        (6, "puff", {}),
    ]
    Read = perfetto_reader.ReadSlice
    assert paths["G", "out"].slices == [
        Read(10, 20, "y", 0, {"n": 1.5, "m": 3.0, "who": "me"}, [1, 2], []),
        Read(12, 14, "p", 1, {}, [], []),
        Read(15, 20, "q", 1, {}, [], []),
        Read(30, 40, "x", 0, {"n": -2.0, "m": 4.0}, [3], [4]),
        Read(30, 35, "p", 1, {}, [4], []),
    ]
    assert paths["H", "K", "late"].slices == [
        Read(50, 60, "x", 0, {}, [], []),
        Read(60, 61, "x", 0, {}, [], [2, 3]),
        Read(70, 90, "x", 0, {}, [], [1]),
    ]
    assert (trace.begin_ns, trace.end_ns) == (1, 90)
    begin, end, instants = perfetto_reader.read_instants(tmp_path / "x")
    assert (begin, end, [each.name for each in instants["G now"]]) == (1, 90, ["bang", "puff"])
    part = perfetto_reader.read(tmp_path / "x", 13, 60)
    cut = [(each.start_ns, each.end_ns, each.name, each.depth) for each in part.find("G", "out").slices]
    assert cut == [(13, 14, "...", 0), (15, 20, "q", 0), (13, 20, "...", 0), (30, 40, "x", 0), (30, 35, "p", 1)]
    assert [(each.start_ns, each.end_ns) for each in part.find("H", "K", "late").slices] == [(50, 60), (60, 60)]
    assert part.find("H", "volts").time_ns == [] and part.find("G", "now").instants == []
