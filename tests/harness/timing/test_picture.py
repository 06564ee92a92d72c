"""A slot's picture cell by cell, and the pieces of the static check, worked out by hand."""

from types import SimpleNamespace as Made

import pytest

from ranger_sim.harness.timing import picture
from ranger_sim.harness.timing.picture import WIDTH
from ranger_sim.ranger.timing import static_check


def test_a_piece_of_time_fills_the_cells_that_it_covers_and_no_other():
    sums, shares = [0.0] * WIDTH, [{} for _ in range(WIDTH)]
    picture._fill(sums, None, 15.0, 40.0, 10.0)
    assert sums[:6] == [0.0, 5.0, 10.0, 10.0, 0.0, 0.0]
    picture._fill(None, shares, 15.0, 40.0, 10.0, "a")
    picture._fill(None, shares, 18.0, 22.0, 10.0, "a")
    picture._fill(None, shares, 38.0, 39.0, 10.0, "b")
    assert shares[:6] == [{}, {"a": 7.0}, {"a": 12.0}, {"a": 10.0, "b": 1.0}, {}, {}]
    picture._fill(sums, None, -20.0, 3.0, 10.0)
    picture._fill(sums, None, 10.0 * WIDTH - 4.0, 10.0 * WIDTH + 50.0, 10.0)
    assert sums[0] == 3.0 and sums[-1] == 4.0


def test_a_cell_shows_the_largest_user_if_a_tenth_was_used():
    assert picture._most({"a": 3.0, "b": 4.0}, 10.0) == "b"
    assert picture._most({"a": 1.0}, 10.0) == "a" and picture._most({"a": 0.9}, 10.0) == " "
    assert picture._most({}, 10.0) == " "


def test_names_have_signs_in_their_order_and_share_the_last_one():
    assert picture._signs(["x", "y", "x", "z", "w"], "ab") == {"x": "a", "y": "b", "z": "b", "w": "b"}
    assert picture.INTERRUPT_SIGNS == "1234567890"


def test_what_ran_inside_is_cut_out_of_an_execution():
    def ran(start, end):
        return Made(start_ns=start, end_ns=end)

    outer = ran(10, 100)
    assert picture._pieces(outer, [ran(10, 20), ran(50, 60)]) == [(20, 50), (60, 100)]
    assert picture._pieces(outer, []) == [(10, 100)]
    assert picture._inside(ran(10, 100), outer) and picture._inside(ran(50, 60), outer)
    assert not picture._inside(ran(9, 60), outer) and not picture._inside(ran(50, 101), outer)


def test_a_scale_has_at_most_twelve_round_steps():
    line = picture._scale(500_000.0)
    assert line.startswith("us          |0") and [int(each) for each in line.split("|")[1:]] == list(range(0, 501, 50))
    assert line.index("|250") - line.index("|0") == WIDTH // 2
    assert "|10" in picture._scale(120_000.0) and "|20" in picture._scale(120_001.0)
    assert "|10 " not in picture._scale(120_001.0)


def test_a_mark_has_its_text_behind_it_or_before_it_for_want_of_space():
    first, last = picture._marks({200: "late", 20: "tick"}, 10.0), picture._marks({960: "limit"}, 10.0)
    assert first == [" " * 12 + "  ^ tick", " " * 12 + " " * 20 + "^ late"]
    assert last[0] == " " * 12 + " " * 96 + "^ limit"
    assert picture._marks({980: "limit"}, 10.0)[0] == " " * 12 + " " * (98 - 6) + "limit ^"


def test_a_line_of_the_list_has_microseconds_and_the_share_of_the_slot():
    legend = Made(cycles_per_ns=0.06, slot_cycles=30_000)
    assert picture._line("a", "work", 2, 1500, legend).split() == ["a", "work", "2", "1,500", "25.0", "5.0"]


def run(name, cycles, limit=0, interrupt=False, latency_ns=0):
    return Made(name=name, cycles=cycles, limit=limit, interrupt=interrupt, latency_ns=latency_ns)


def test_a_list_reports_what_exceeded_its_limit_and_gathers_what_is_short():
    slot = Made(legend=Made(cycles_per_ns=0.06, slot_cycles=30_000))
    runs = [run("work", 700, 1000), run("work", 1001, 1000), run("tiny", 59), run("just", 60), run("small", 1)]
    lines = picture._list(slot, runs, {"work": "a", "tiny": "b", "just": "c", "small": "d"}, "function", "limit")
    assert [line.split() for line in lines[1:]] == [
        ["a", "work", "2", "1,701", "28.4", "5.7", "1,000", "over!"],
        ["c", "just", "1", "60", "1.0", "0.2"],
        ["(2", "shorter", "ones)", "2", "60", "1.0", "0.2"],
    ]
    assert "over!" not in picture._against([run("work", 1000, 1000)])
    assert picture._against([run("x", 1, 0, True, 1500), run("x", 1, 0, True, 2500)]).strip() == "2.50"
    assert picture._list(slot, [], {}, "function", "limit") == []


# ---- the static check's pieces -----------------------------------------------------------------------------------


def legend(rows, entries=()):
    lists = dict(entries)
    return Made(rows=rows, tasks=[Made(entries=lists.get(number, ())) for number in range(12)])


def test_tasks_are_in_the_tables_order_common_ones_once():
    table = legend([(0, 1, 4, 9), (0, 1, 5, 6, 9), (0, 1, 9)], {5: (7, 8)})
    assert static_check.in_order(table) == [0, 1, 4, 5, 7, 8, 6, 9]
    assert static_check.in_order(legend([(0, 1, 2, 8, 9), (0, 3, 8, 9)])) == [0, 1, 2, 3, 8, 9]
    assert static_check.in_order(legend([(2, 1, 3), (4, 1, 5)])) == [2, 1, 3, 4, 5]
    assert static_check.in_order(legend([(3, 2, 1)])) == [3, 2, 1]


def test_a_task_s_place_is_every_slot_or_its_rows_or_its_list():
    table = legend([(0, 1), (0, 5), (0, 1)], {5: (7,)})
    shown = [static_check.place_of(table, number) for number in (0, 1, 5, 7)]
    assert shown == ["every slot", "row 0, 2", "row 1", "row 1, in turn"]
    assert static_check.place_of(legend([(0,)]), 0) == "row 0"


@pytest.mark.parametrize("slot, period, times", [(500, 200, 3), (400, 200, 3), (399, 200, 2), (100, 200, 1)])
def test_what_comes_periodically_may_have_waited_for_the_slot(slot, period, times):
    assert static_check.periods(slot, period) == times


@pytest.mark.parametrize(
    "kind, board, expected",
    [
        ("PIN_EDGE", "MCH", (6, 0, 0)),
        ("EXTERNAL_INTERRUPT", "MCH", (5, 0, 0)),
        ("ADC_DONE", "MCH", (1, 0, 0)),
        ("SPI_DONE", "MCH", (1, 0, 0)),
        ("UART_BYTE", "UI", (6, 8, 0)),  # 46.05 bytes in 1 ms at 460,526 baud, eight at a time
        ("SSP_SEGMENT", "CSR", (6, static_check.SEGMENT_HALF_WORDS, 0)),
        ("TIMER_MATCH", "CSR", (6, 0, 77)),
        ("TIMER_MATCH", "UI", (6, 0, 0)),
        ("TIMER_MATCH", "MCH", (3, 0, 0)),  # 1 ms has two wraps of 500 us
        ("DMA_DONE", "MB", (2, 0, 0)),  # a segment to the computer takes 990 us
        ("SOFTWARE", "MB", (2, 0, 0)),
        ("SLOT_TIMER", "MCH", (3, 0, 0)),
    ],
)
def test_a_source_comes_so_often_in_a_slot_of_one_millisecond(kind, board, expected):
    source = Made(kind=getattr(static_check, kind), name="encoder_edge_0", index=0, per_item=4)
    made = Made(name=board, sync_cycles=77, adc_external=Made(length=5), scheduler=Made(divider=3))
    assert static_check.services(made, source, 1_000_000, {"encoder_edge_0": 6}, {})[:3] == expected


def test_sources_without_edges_or_their_own_work_are_never_served():
    made = Made(name="MCH")
    edge = Made(kind=static_check.PIN_EDGE, name="another", index=0)
    assert static_check.services(made, edge, 1_000_000, {"encoder_edge_0": 6}, {})[0] == 0
    fault = Made(kind=-77, name="errors", index=0)
    assert static_check.services(made, fault, 1_000_000, {}, {}) == (0, 0, 0, "only with errors of the bus")
    board = Made(vic=Made(sources={1: Made(attached=False)}))
    assert static_check.interrupts_of(board, 1, {}, {}) == []


def test_the_segment_to_the_computer_takes_92_bytes_of_ten_bits():
    assert static_check.COMPUTER_SEGMENT_NS == 990_312  # 920 bits at 929,000 baud
    assert static_check.SHORTEST_FRAME_BITS == 111
