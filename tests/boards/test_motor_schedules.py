"""The four tables of what runs when: order, rates, cycles, start-up and the CAN link, on running boards."""

import hashlib

import pytest

from ranger_sim.boards.modules.can_link import CanLink
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.receiver import FloatReceiver, Ignored, IntReceiver
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.schedule import published_schedule
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.firmware_sim.vic import FIQ
from ranger_sim.foundation.events import CAN_REQUEST, CAN_RX, CAN_TX_DONE
from ranger_sim.foundation.user_error import UserError
from tests.boards.motor_bench import BOARDS, Bench

DECODERS = ["qdc_cap01_angle", "qdc_cap01_rate", "qdc_cap23_angle", "qdc_cap23_rate"]

# Written out from the robot's firmware (robot.md N3.2-N3.5), one list per board.
EVERY = {
    "MCH": [
        "adcx_convert_all", "adci_convert_all", *DECODERS, "ae_update", "can_rx_dispatch_all", "hb_beat",
        "mcu_led_update", "dn_safety", "error_update", "can_tx1", "adcx_conversion_wait", "mc_compliant_control",
    ],
    "MCFO": [
        "adcx_convert_all", "adci_convert_all", *DECODERS, "ae_update", "can_rx_dispatch_all", "hb_beat",
        "mcu_led_update", "ls_update", "dn_safety", "error_update", "can_tx1", "adcx_conversion_wait",
        "mc_compliant_control",
    ],
    "MCFI": [
        "adcx_convert_all", "adci_convert_all", *DECODERS, "can_rx_dispatch_all", "hb_beat", "mcu_led_update",
        "ae_update", "ls_update", "dn_safety", "error_update", "can_tx2", "adcx_conversion_wait",
        "mc_compliant_control",
    ],
    "MCSI": [
        "adcx_convert_all", "adci_convert_all", "can_rx_dispatch_all", "hb_beat", "mcu_led_update", "error_update",
        "can_tx2", "adcx_conversion_wait", "dn_update_pwm", "mc_compliant_control",
    ],
}  # fmt: skip
ROWS = {
    "MCH": ["ANGLE", "ANG_RATE", "BATT_POWER", None],
    "MCFO": [
        "RIGHT_ANKLE_ANGLE", "RIGHT_ANKLE_RATE", "RIGHT_HEEL_SENSE", "RIGHT_HS", "LEFT_HS", "MOTOR_POSITION",
        "LEFT_HEEL_SENSE", "BATT_POWER", None,
    ],
    "MCFI": [
        "MID_ANKLE_ANGLE", "ANKLE_RATE", "LEFT_HEEL_SENSE", "MOTOR_POSITION", "RIGHT_HS", "BATT_POWER",
        "RIGHT_HEEL_SENSE", None,
    ],
    "MCSI": ["STEER_ANGLE", "MOTOR_CURRENT", "BATT_POWER", None],
}  # fmt: skip
OCCASIONAL = {
    "MCH": [
        "ERROR", "MOTOR_POSITION", "MOTOR_CURRENT", "STATUS", "BATT_CURRENT", "BATT_VOLTAGE", "MOTOR_VELOCITY",
        "rezero", "EXECUTION_TIME", "MAX_EXECUTION_TIME",
    ],
    "MCFO": [
        "ERROR", "MOTOR_VELOCITY", "MOTOR_CURRENT", "STATUS", "BATT_CURRENT", "BATT_VOLTAGE", "HBRIDGE_TEMP",
        "RIGHT_LS", "LEFT_LS", "rezero", "EXECUTION_TIME", "MAX_EXECUTION_TIME", "RIGHT_ANKLE_RATE",
        "RIGHT_HEEL_SENSE",
    ],
    "MCFI": [
        "ERROR", "MOTOR_VELOCITY", "MOTOR_CURRENT", "LEFT_HS", "STATUS", "BATT_CURRENT", "BATT_VOLTAGE",
        "HBRIDGE_TEMP", "RIGHT_LS", "LEFT_LS", "EXECUTION_TIME", "MAX_EXECUTION_TIME", "RIGHT_HEEL_SENSE", "rezero",
    ],
    "MCSI": ["ERROR", "STATUS", "EXECUTION_TIME", "MAX_EXECUTION_TIME"],
}  # fmt: skip
SPECIAL = {"ERROR": "ERROR_{}", "rezero": "motor_encoder_rezero"}

# Frames per second of each board and of some variables (robot.md N3.2-N3.5 and N1.10, no errors flowing).
UP = {"MCH": 1863.6, "MCFO": 1955.6, "MCFI": 1950.0, "MCSI": 1800.0}
RATES = {
    "MCH": {"ANGLE": 500, "ANG_RATE": 500, "BATT_POWER": 500, "STATUS": 45.45, "MOTOR_VELOCITY": 45.45},
    "MCFO": {
        "RIGHT_ANKLE_ANGLE": 222.22, "RIGHT_ANKLE_RATE": 237.04, "RIGHT_HEEL_SENSE": 237.04, "LEFT_HS": 222.22,
        "MOTOR_CURRENT": 14.81,
    },
    "MCFI": {
        "MID_ANKLE_ANGLE": 250, "ANKLE_RATE": 250, "RIGHT_HEEL_SENSE": 266.67, "RIGHT_HS": 250, "LEFT_HS": 16.67,
        "HBRIDGE_TEMP": 16.67,
    },
    "MCSI": {"STEER_ANGLE": 500, "MOTOR_CURRENT": 500, "BATT_POWER": 500, "STATUS": 100, "EXECUTION_TIME": 100},
}  # fmt: skip


def task_name(board, entry):
    return SPECIAL.get(entry, "{}_" + entry).format(board)


@pytest.mark.parametrize("name", list(BOARDS))
def test_the_every_slot_list_is_the_firmwares_in_its_order(name):
    schedule = Bench(name).board.scheduler.schedule
    assert [task.name for task in schedule.every] == EVERY[name]
    # can_transmit is the end of the row's line, from where its frame is asked for
    assert [task.name for task in schedule.last] == ["can_transmit", "execution_time_record"]
    assert schedule.slot_ns == 500_000


@pytest.mark.parametrize("name", list(BOARDS))
def test_rows_and_occasional_list_are_the_firmwares_in_their_order(name):
    schedule = Bench(name).board.scheduler.schedule
    for row, expected in zip(schedule.rows, ROWS[name], strict=True):
        wanted = "occasional" if expected is None else task_name(name, expected)
        assert [task.name for task in row] == [wanted]
    occasional = schedule.rows[-1][0]
    assert [task.name for task in occasional.tasks] == [task_name(name, entry) for entry in OCCASIONAL[name]]
    assert occasional.extra_idle_call


@pytest.mark.parametrize("name", list(BOARDS))
def test_the_tables_send_what_the_master_table_says_they_send(name):
    published = published_schedule(name)
    schedule = Bench(name).board.scheduler.schedule
    sent = [[task.name for task in row if task.name != "occasional"] for row in schedule.rows]
    assert sent == [list(row) for row in published.rows]
    assert published.slot_us * 1000 == schedule.slot_ns
    occasional = [task.name for task in schedule.rows[published.occasional_row][-1].tasks]
    named = [entry if not entry.startswith("(") else "motor_encoder_rezero" for entry in published.occasional]
    assert occasional == named


@pytest.mark.parametrize("name", list(BOARDS))
def test_every_variable_goes_out_at_its_rate(name):
    bench = Bench(name)
    if name == "MCSI":
        bench.counts("motor_current", 25)
    bench.run(ms=100)
    bench.frames.clear()
    lost = bench.board.can.send_lost
    seconds = 2.0
    bench.run(ms=1000 * seconds)
    rates = {key: count / seconds for key, count in bench.rates().items()}
    errors = rates.pop(f"ERROR_{name}", 0.0)
    # two seconds count a rate to +/- 0.5 Hz (one frame at either end)
    for variable, rate in RATES[name].items():
        assert rates[f"{name}_{variable}"] == pytest.approx(rate, abs=0.6), variable
    assert sum(rates.values()) == pytest.approx(UP[name], rel=0.003)
    assert errors <= 101
    assert bench.board.can.send_lost == lost == 0


# us from the tick: the mean of all slots, and the longest one, standing still with a clock on the bus (robot.md T1).
# MCH: 97 us usually, 102 with the time frame, 207 to 226 with the re-zeroing in it. MCFI: 172, as it waits for four
# conversions of 31 us; MCFO is its like. MCSI: 142 to 145.
AT_REST = {"MCH": ((92, 104), (207, 226)), "MCFO": ((160, 175), (167, 181)), "MCFI": ((160, 175), (167, 181)),
           "MCSI": ((134, 145), (142, 145))}  # fmt: skip


@pytest.mark.parametrize("name", list(BOARDS))
def test_slots_at_rest_are_as_long_as_the_robots(name):
    bench = Bench(name).run(ms=200)
    scheduler = bench.board.scheduler
    assert scheduler.overruns == 0 and scheduler.near_limits == 0
    mean, longest = AT_REST[name]
    assert mean[0] < scheduler.total_slot_cycles / scheduler.slot_count / 60 < mean[1]
    assert longest[0] < scheduler.max_slot_cycles / 60 < longest[1]


# Starts of the tasks of a usual slot of MCH at rest, us after the tick (robot.md T2, last line).
USUAL_SLOT_OF_MCH = {
    "adcx_convert_all": 3, "qdc_cap01_rate": 7, "qdc_cap23_rate": 31, "can_rx_dispatch_all": 56, "dn_safety": 58,
    "error_update": 59, "adcx_conversion_wait": 61, "mc_compliant_control": 61, "MCH_ANGLE": 85, "end": 97,
}  # fmt: skip


def test_the_usual_slot_of_the_hip_at_rest_runs_as_the_images():
    bench = Bench("MCH", Quirks.firmware_2016(), sync=False)
    bench.board.words[0] = 4600
    bench.run(ms=100)
    starts = {}

    def noting(task):
        function = task.function

        def run():
            starts[task.name] = (bench.board.now - bench.board.match_time) / 1000.0
            return function()

        return run

    scheduler = bench.board.scheduler
    for task in scheduler.schedule.row_tasks(0):
        task.function = noting(task)
    while "MCH_ANGLE" not in starts:
        bench.run(slots=1)
    starts["end"] = starts["execution_time_record"] + scheduler.find("execution_time_record").cost / 60.0
    # the list has whole us, and parts of one are lost in the loop between two functions
    assert {name: starts[name] for name in USUAL_SLOT_OF_MCH} == pytest.approx(USUAL_SLOT_OF_MCH, abs=1.5)


# Instructions counted in the images (robot.md T2): what a call costs at two cycles each, within least and most.
COUNTED = {
    "MCH": {"adcx_convert_all": (37, 37), "qdc_cap01_rate": (614, 691), "qdc_cap23_rate": (614, 989),
            "dn_safety": (34, 34), "error_update": (39, 39), "mc_compliant_control": (707, 762),
            "motor_encoder_rezero": (3540, 3760)},
    "MCFI": {"adcx_convert_all": (37, 37), "qdc_cap01_rate": (617, 1290), "ls_update": (135, 145),
             "dn_safety": (413, 485), "mc_compliant_control": (600, 764), "motor_encoder_rezero": (158, 164)},
    "MCSI": {"dn_update_pwm": (88, 88), "can_rx_dispatch_all": (15, 15)},
}  # fmt: skip


@pytest.mark.parametrize("name", list(COUNTED))
def test_a_call_costs_two_cycles_for_each_instruction_counted(name):
    scheduler = Bench(name).board.scheduler
    for task, (least, most) in COUNTED[name].items():
        assert 2 * least <= scheduler.find(task).cost <= 2 * most, task


def test_a_frame_costs_by_what_it_is_and_by_its_place_in_the_receive_list():
    # 142 instructions for the time alone, 716 with three gains on MCH; 130 and 632 on MCFI (robot.md T2)
    for name, time, all_four in (("MCH", 142, 716), ("MCFI", 130, 632)):
        bench = Bench(name, sync=False).run(ms=3)
        task = bench.board.scheduler.find("can_rx_dispatch_all")
        bench.receive(bench.table.TIMESTAMP, 1, 1)
        bench.run(slots=2)
        assert task.max_cycles == 2 * time
        bench.receive(bench.table.TIMESTAMP, 2, 2)
        for suffix in ("COMMAND_CURRENT", "STIFFNESS", "DAMPNESS"):
            bench.now += 1000
            bench.command(suffix, 1.0)
        bench.run(slots=2)
        # places in the lists of the other boards are ours, by this very figure
        assert task.max_cycles == pytest.approx(2 * all_four, rel=0.06)


@pytest.mark.parametrize("name", list(BOARDS))
def test_every_task_has_a_limit_above_what_it_usually_costs_and_typical_costs_fit_the_slot(name):
    schedule = Bench(name).board.scheduler.schedule
    for task in schedule.all_tasks():
        if task.name != "occasional":
            assert 0 < task.cost < task.limit, task.name
    fixed = sum(task.cost for task in schedule.every + schedule.last)
    rarest = max(task.cost for task in schedule.all_tasks() if task not in schedule.every)
    assert fixed + rarest < 30000 * 0.45  # the rarest is the hip's re-zeroing, a quarter of a slot


@pytest.mark.parametrize("name", list(BOARDS))
def test_no_task_exceeds_its_limit_when_everything_comes_at_once(name):
    bench = Bench(name).run(ms=2)
    if name != "MCSI":
        bench.turn(4300, 9_300, pair="01")
        bench.turn(520, 77_000, pair="23")
    identifiers = [bench.table.TIMESTAMP, getattr(bench.table, f"{name}_STATUS") + 500]
    for ms in range(40):
        for i in range(20):  # a bus so full that 27 frames come per ms, most of them for others
            bench.board.inbox.push(
                bench.now + ms * 1_000_000 + i * 37_000, 512, CAN_RX, bench.controller, identifiers[i & 1], 8, 0, ms
            )
    bench.run(ms=40)
    board = bench.board
    over = [task.name for task in board.scheduler.schedule.all_tasks() if task.hits]
    assert over == []
    assert board.scheduler.overruns == 0
    assert board.can_controller.data_overruns == 0 and board.can.receive_lost == 0
    assert board.scheduler.max_slot_cycles < 0.8 * 30000


def test_a_task_over_its_limit_and_a_slot_near_its_end_are_errors():
    bench = Bench("MCH").run(ms=5)
    task = bench.board.scheduler.find("hb_beat")
    task.cost = 21000
    bench.run(slots=1)
    task.cost = 40
    bench.run(ms=2)
    assert bench.errors()["SCHED_TASK_LIMIT"] == 1
    assert bench.errors()["SCHED_SLOT_NEAR_LIMIT"] == 1
    assert "ASCHED_DNF" not in bench.errors()


def test_the_firmware_of_2016_reports_only_the_slot_that_was_exceeded():
    bench = Bench("MCH", Quirks(warn_near_slot_limit=False)).run(ms=5)
    task = bench.board.scheduler.find("hb_beat")
    task.cost = 35000
    bench.run(slots=1)
    task.cost = 40
    bench.run(ms=2)
    scheduled = {key for key in bench.errors() if key.startswith(("SCHED", "ASCHED"))}
    assert scheduled == {"ASCHED_DNF"}
    assert bench.board.scheduler.overruns == 1
    assert bench.board.scheduler.dropped_tasks > 0


def test_without_the_idle_call_the_occasional_list_comes_round_sooner():
    bench = Bench("MCH", Quirks(occasional_idle_call=False)).run(ms=100)
    bench.frames.clear()
    bench.run(ms=1000)
    assert bench.rates()["MCH_STATUS"] == pytest.approx(50.0, abs=1)


@pytest.mark.parametrize("name", list(BOARDS))
def test_interrupts_have_the_priorities_of_the_robot(name):
    board = Bench(name).board
    slots = {source.name: source.slot for source in board.vic.sources.values() if source.attached}
    assert slots["can_receive"] == 0
    assert slots["adcx_busy"] == 1
    assert slots["adci_done"] == 3
    assert slots["slot timer"] == 4
    assert slots["can_error"] == 8
    fast = sorted(key for key, slot in slots.items() if slot == FIQ)
    if name == "MCSI":
        assert fast == [] and "ae_read" not in slots
    else:
        assert slots["ae_read"] == 10
        assert fast == ["encoder_edge_0", "encoder_edge_2", "encoder_timer_wrap"]


# --- start-up ------------------------------------------------------------------------------------------------


def test_both_ankle_encoders_start_at_the_absolute_angle():
    bench = Bench("MCFO")
    bench.board.words[0] = 6562 - 2000  # mounted the other way round: +2000 counts
    bench.run(ms=1)
    board = bench.board
    assert board.encoder.counts == 2000
    angle = 2000 * 0.0007669922
    assert board.motor.count == pytest.approx(angle / -1.80468e-4, abs=1.1)
    assert board.joint.count == pytest.approx(angle / -1.53398e-3, abs=1.1)


@pytest.mark.parametrize(("preset", "start"), [(True, 0.3), (False, 0.0)])
def test_the_hip_motor_encoder_starts_at_the_joint_or_at_0_and_converges(preset, start):
    bench = Bench("MCH", Quirks(hip_motor_encoder_preset=preset))
    bench.board.words[0] = 4590 + 391  # 0.3 rad
    bench.run(ms=1)
    assert bench.board.joint.count * 1.53398e-3 == pytest.approx(0.3, abs=2e-3)
    assert bench.board.motor.count * 2.4792e-4 == pytest.approx(start, abs=3e-4)
    bench.run(ms=440)  # one time constant: 20 calls at 45.45 Hz
    # truncation of the count stops it up to 20 counts (5 mrad) below the joint
    expected = 0.3 - (0.3 - start) * 0.95**20
    assert bench.board.motor.position / 65536 == pytest.approx(expected, abs=0.008)


def test_without_the_rezero_the_hip_motor_encoder_keeps_its_offset():
    bench = Bench("MCH", Quirks(hip_rezero=False, hip_motor_encoder_preset=False))
    bench.board.words[0] = 4590 + 391
    bench.run(ms=300)
    assert bench.board.motor.count == 0


@pytest.mark.parametrize(("counts", "moves"), [(300, True), (400, False)])
def test_an_ankle_is_rezeroed_only_near_its_upper_stop(counts, moves):
    bench = Bench("MCFI")
    bench.board.words[0] = 1572 + counts  # 0.23 or 0.307 rad
    bench.run(ms=1)
    bench.board.motor.set_position(0)
    bench.run(ms=300)
    assert (bench.board.motor.count > 0) is moves


def test_an_ankle_that_moves_is_not_rezeroed():
    bench = Bench("MCFI")
    bench.board.words[0] = 1572 + 300
    bench.run(ms=1)
    bench.board.motor.set_position(0)
    bench.turn(400, 500_000, pair="23")  # 3 rad/s at the joint
    bench.run(ms=100)
    assert bench.board.motor.count == 0


def test_a_board_without_its_absolute_encoder_starts_with_zeros_instead_of_hanging():
    bench = Bench("MCFI")
    bench.board.spi.busy = True  # a transfer that never ends
    bench.run(ms=10)
    assert bench.board.scheduler.slot_count == 19
    assert bench.board.encoder.value == 0
    assert bench.board.motor.count == 0


def test_nothing_is_sent_before_the_first_slot():
    bench = Bench("MCH")
    bench.run(ms=0.5)
    assert bench.frames == [] and bench.board.scheduler.slot_count == 0
    bench.run(ms=0.5)
    assert bench.board.scheduler.slot_count == 1 and len(bench.frames) == 1


@pytest.mark.parametrize("name", list(BOARDS))
def test_a_start_after_31_hours_runs_the_same_course(name):
    def course(phase_ns):
        bench = Bench(name, phase_ns=phase_ns, sync=False).run(ms=30)
        return [(time - phase_ns, identifier, word) for time, identifier, word, _ in bench.frames]

    assert course(0) == course(31 * 3600 * 1_000_000_000)


@pytest.mark.parametrize("name", list(BOARDS))
def test_a_board_answers_the_same_whatever_the_size_of_its_steps(name):
    def digest(step_ns):
        bench = Bench(name, ppb=17_000)
        bench.answers = False
        for ms in range(20):
            for i in range(10):
                bench.edge(i & 1, 1 - (i & 1), "01", after_ns=ms * 1_000_000 + i * 90_000 + 5)
            bench.board.inbox.push(ms * 1_000_000 + 7, 512, CAN_RX, bench.controller, 0, 8, ms, ms)
        reported = []
        queue = bench.board.outbox
        while bench.now < 20_000_000:
            bench.now += step_ns
            bench.board.advance(bench.now)
            while queue.take():
                reported.append((queue.time, queue.kind, queue.a, queue.b, queue.c, queue.d, queue.e, queue.f))
        # a bridge update is stamped with the coming PWM period, so it may be fetched before its turn
        return hashlib.sha256(repr(sorted(reported)).encode()).hexdigest()

    assert digest(25_000) == digest(125_000) == digest(1_000_000)


# --- CAN link ---------------------------------------------------------------------------------------------------


class Link:
    """A CAN link alone on a chip."""

    def __init__(self, report_full=True, number=1, full_ring_kills=True):
        self.chip = Microcontroller(name="alone", hz=60_000_000, crystal=Crystal())
        self.controller = CanController(self.chip, number, IER=0xFFF)
        self.time = NetworkTime()
        self.errors = ErrorModule(3, self.time)
        self.can = CanLink(self.chip, self.controller, self.time, self.errors, report_full, full_ring_kills)
        self.can.attach()
        self.now = 0

    def push(self, kind, a, b, c, d=0, e=0):
        self.now += 10_000
        self.chip.inbox.push(self.now, 512, kind, a, b, c, d, e)
        self.chip.advance(self.now + 9_000)

    def requests(self):
        taken = []
        while self.chip.outbox.take():
            queue = self.chip.outbox
            if queue.kind == CAN_REQUEST:
                taken.append((queue.b, queue.c, queue.d, queue.e, queue.f))
        return taken


def test_frames_go_to_the_receiver_of_their_identifier():
    link = Link()
    current, sleep = FloatReceiver(), IntReceiver()
    link.can.subscribe(18, current)
    link.can.subscribe(17, sleep)
    link.push(CAN_RX, 1, 18, 8, 0xBFC00000, 5)
    link.push(CAN_RX, 1, 17, 8, 0xFFFFFFFF, 5)
    assert link.can.receive_all() == 2
    assert (current.value, current.fixed) == (-1.5, -98304)
    assert sleep.value == -1


@pytest.mark.parametrize("flags", [7, 0, 8 | 16, 8 | 64])
def test_frames_that_are_not_8_bytes_or_remote_or_extended_are_dropped(flags):
    link = Link()
    current = FloatReceiver()
    link.can.subscribe(18, current)
    link.push(CAN_RX, 1, 18, flags, 0xBFC00000, 5)
    link.can.receive_all()
    assert current.frames == 0 and link.can.ignored == 1


def test_an_identifier_outside_the_list_is_dropped():
    link = Link()
    link.push(CAN_RX, 1, 99, 8, 1, 1)
    assert link.can.receive_all() == 1
    assert link.can.ignored == 1


def test_the_old_name_of_subscribe_warns_at_the_caller():
    link, current = Link(), FloatReceiver()
    with pytest.warns(DeprecationWarning, match=r"^CanLink.listen is now subscribe; the old name ends") as warned:
        link.can.listen(18, current)
    assert warned[0].filename == __file__
    link.push(CAN_RX, 1, 18, 8, 0xBFC00000, 5)
    link.can.receive_all()
    assert current.value == -1.5


def test_two_receivers_for_one_identifier_are_a_mistake():
    link = Link()
    link.can.subscribe(18, Ignored())
    with pytest.raises(UserError, match="identifier 18 has two receivers"):
        link.can.subscribe(18, Ignored())
    with pytest.raises(UserError, match="identifier 2048 is not"):
        link.can.subscribe(2048, Ignored())


@pytest.mark.parametrize("report", [True, False])
def test_the_receive_ring_holds_63_frames(report):
    link = Link(report_full=report, full_ring_kills=False)
    for _ in range(70):
        link.push(CAN_RX, 1, 18, 8, 0, 0)
    assert link.can.received == 63
    assert link.can.receive_lost == 7
    assert link.errors.totals[codes.CAN1_RX_BUF_OF] == (7 if report else 0)
    assert link.can.receive_all() == 63


def stalled(quirks, frames):
    """The hip after a task of 4 ms during which `frames` frames arrived, 50 us apart, and 20 ms more."""
    bench = Bench("MCH", quirks, sync=False).run(ms=3)
    task = bench.board.scheduler.find("hb_beat")
    cost, task.cost = task.cost, 4 * 60_000
    bench.run(slots=1)
    task.cost = cost
    for i in range(frames):
        bench.board.inbox.push(bench.now + 1000 + i * 50_000, 512, CAN_RX, bench.controller, 900, 8, 0, 0)
    bench.run(ms=4)
    bench.frames.clear()
    served = bench.board.can_controller.rx_source.served
    bench.run(ms=20)
    return bench, bench.board.can_controller.rx_source.served - served


@pytest.mark.parametrize("quirks", [Quirks(), Quirks.firmware_2016()])
def test_a_full_receive_ring_kills_the_board(quirks):
    # robot.md T4.1: 18,800 interrupts in 20 ms, and nothing else ever again
    bench, interrupts = stalled(quirks, 70)
    assert interrupts == pytest.approx(18_800, rel=0.01)
    assert bench.frames == []
    # every frame is somewhere once: in the ring, lost from the buffer that stays full, beside it, or found no buffer
    link, controller = bench.board.can, bench.board.can_controller
    assert (link.received, link.receive_lost) == (63, 1)
    assert link.received + link.receive_lost + 1 + controller.data_overruns == 70


def test_a_receive_ring_that_is_nearly_full_does_not():
    bench, interrupts = stalled(Quirks(), 60)
    assert interrupts == 0 and bench.frames
    assert bench.board.can.receive_lost == 0


def test_a_board_may_be_spared_that_death():
    bench, _ = stalled(Quirks(full_receive_ring_kills=False), 70)
    assert bench.frames and bench.board.can.receive_lost > 0


@pytest.mark.parametrize("report", [True, False])
def test_frames_fill_buffers_1_and_2_and_then_a_ring_of_7(report):
    link = Link(report_full=report)
    link.time.ms = 1234
    sent = [link.can.send_float(100 + i, 1.0) for i in range(10)]
    assert sent == [True] * 9 + [False]
    assert link.requests() == [(1, 100, 8, 0x3F800000, 1234), (2, 101, 8, 0x3F800000, 1234)]
    assert link.can.send_lost == 1
    assert link.errors.totals[codes.CAN_TX_QUEUE_FULL] == (1 if report else 0)
    assert link.can.most_waiting == 7


def test_a_free_buffer_takes_the_oldest_frame_with_its_own_stamp():
    link = Link()
    link.time.ms = 1
    for i in range(3):
        link.can.send_int(100 + i, -i)
    link.requests()
    link.time.ms = 9
    link.push(CAN_TX_DONE, 1, 2, 0)
    assert link.can.feed() == 1
    assert link.requests() == [(2, 102, 8, 0xFFFFFFFE, 1)]
    assert link.can.feed() == 0


def test_after_bus_off_the_controller_is_started_again_at_once():
    from ranger_sim.foundation.events import CAN_STATUS

    link = Link()
    link.push(CAN_STATUS, 1, 4, 256, 0, 1)
    assert link.errors.totals[codes.CAN1_TX_BUSOFF] == 1
    assert link.controller.MOD == 0
    # and CxICR is read on: the same interrupt tells the warning
    assert link.errors.totals[codes.CAN1_ERR_WARN] == 1


def test_a_data_overrun_is_reported_once_and_never_cleared():
    link = Link()
    for _ in range(2):  # nobody takes the frames: two fill the controller's buffers, each further one is lost
        link.chip.vic.detach(link.controller.rx_source)
        for _ in range(4):
            link.push(CAN_RX, 1, 18, 8, 0, 0)
        assert link.errors.totals[codes.CAN1_DATA_OVRN] == 1
        assert link.controller.overrun
    assert link.controller.data_overruns == 6
    link.controller.write_CMR(0x8)  # as no firmware of a satellite does
    link.push(CAN_RX, 1, 18, 8, 0, 0)
    assert link.errors.totals[codes.CAN1_DATA_OVRN] == 2


@pytest.mark.parametrize(
    ("bits", "code"),
    [
        (4, codes.CAN2_ERR_WARN),
        (32, codes.CAN2_ERR_PASS),
        (128, codes.CAN2_BUS_TX),
        (128 | 1 << 21, codes.CAN2_BUS_RX),
        (8, codes.CAN2_DATA_OVRN),
    ],
)
def test_controller_errors_get_the_codes_of_their_controller(bits, code):
    from ranger_sim.foundation.events import CAN_STATUS

    link = Link(number=2)
    link.push(CAN_STATUS, 2, bits, 100, 0, 0)
    assert {number: count for number, count in enumerate(link.errors.totals) if count} == {code: 1}


def test_the_hip_listens_only_to_warnings_and_bus_errors():
    assert Bench("MCH").board.can_controller.IER == 1 | 2 | 4 | 128
    assert Bench("MCFI").board.can_controller.IER == 1 | 4 | 8 | 32 | 128


@pytest.mark.parametrize(("name", "controller"), [("MCH", 1), ("MCFO", 1), ("MCFI", 2), ("MCSI", 2)])
def test_boards_use_the_controller_that_their_ribbon_is_wired_to(name, controller):
    assert Bench(name).board.can_controller.number == controller
