"""examples/hip_in_c, the hip board in C, is the Python board bit for bit: frames, errors, slots, with faults too."""

import contextlib
import pathlib
import shutil

import pytest

from ranger_sim.boards.quirks import Quirks
from ranger_sim.ranger.firmware import native_boards
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from tests.firmware_sim.native.support import COMPILER

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = ROOT / "examples" / "hip_in_c"
pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler here")


def folder_at(place, addition=""):
    folder = shutil.copytree(FOLDER, place, ignore=shutil.ignore_patterns("build"))
    with (folder / "firmware.toml").open("a", encoding="utf-8") as file:
        file.write(addition)
    return folder


@pytest.fixture(scope="module")
def hip(tmp_path_factory):
    return native_boards.build(folder_at(tmp_path_factory.mktemp("firmware") / "hip_in_c"))


def seen(firmware, seconds, scenario=None, quirks=None, fault=None):
    """What a run shows from outside, with the hip board in C (`firmware`) or in Python (None)."""
    firmware = {"MCH": firmware} if firmware is not None else None
    with contextlib.closing(Ranger(scenario, quirks=quirks, firmware=firmware, in_process=True)) as robot:
        acted = True
        if fault is not None:
            place, mode, parameters = fault
            robot.run_for(1.0)
            injected = robot.inject(place, mode, **parameters)
            robot.run_for(seconds)
            acted = injected.acted
        else:
            robot.run_for(seconds)
        counters = robot.counters()
        counted = counters["MCH"]
        shown = {
            "digest": robot.trace_digest(),
            "errors": {name: list(each.errors) for name, each in counters.items()},
            "slots": counted.slots,
            "time": counted.time_ms,
            "interrupts": {
                each.name: (each.served, each.merged, each.total_cycles)
                for each in robot.board("MCH").vic.sources.values()
                if each.attached
            },
            "tasks": robot.board("MCH").scheduler.task_cycles(),
        }
        return acted, shown


@pytest.mark.parametrize(
    ("scenario", "seconds"),
    [
        (Scenario(), 4.0),  # held, let go, three steps
        (Scenario(seed=5, start_uptime_ms=2**32 - 1500, controller="reflex"), 3.0),  # the network time wraps
        (Scenario(seed=9, controller="robust", floor_roughness_m=0.001), 3.0),
    ],
    ids=["record", "reflex", "robust"],
)
def test_every_frame_error_slot_and_cycle_is_the_python_boards(hip, scenario, seconds):
    assert hip.warnings == ()
    assert seen(hip, seconds, scenario) == seen(None, seconds, scenario)


@pytest.mark.parametrize(
    ("place", "mode", "parameters"),
    [
        ("MCH.joint_encoder", "stuck", {}),
        ("MCH.joint_encoder", "contact_bounce", {}),
        ("MCH.motor_encoder", "noise", {}),
        ("MCH.absolute_encoder", "bit_flips", {}),
        ("MCH.adc_external", "late_conversion", {}),
        ("MCH.adc_external", "missing_conversion", {}),  # it stands in its wait, and its receive ring kills it
        ("MCH.adc_external", "gain", {"factor": 3.0}),
        ("MCH.adc_internal", "missing_conversion", {}),
        ("MCH.can1", "bus_off", {}),
        ("MCH.can1", "cut", {}),
        ("MCH.can1", "CRC", {}),
        ("can1", "babbling", {}),
        ("MCH.bridge", "one_leg", {}),
        ("MCH.supply", "brown_out", {}),
        ("MCH.processor", "reset", {}),
        ("MCH.processor", "crystal", {}),
        ("MCH.processor", "stuck_interrupt", {"interrupt": "can_receive"}),
        ("MCH.processor", "extra_cycles", {"task": "mc_compliant_control"}),
        ("MCH.processor", "stall", {"task": "error_update"}),
    ],
)
def test_with_a_fault_too(hip, place, mode, parameters):
    expected = seen(None, 0.6, fault=(place, mode, parameters))
    assert expected[0], "the fault did not act"
    assert seen(hip, 0.6, fault=(place, mode, parameters)) == expected


def test_its_schedule_is_the_python_boards_line_by_line(hip):
    with (
        contextlib.closing(Ranger(firmware={"MCH": hip}, in_process=True)) as robot,
        contextlib.closing(Ranger()) as other,
    ):
        tables = [
            [
                (task.name, task.cost, task.limit, task.per_item, task.item, task.kind, task.transmits)
                for task in each.board("MCH").scheduler.schedule.all_tasks()
            ]
            for each in (robot, other)
        ]
        assert tables[0] == tables[1]


def test_with_the_switches_of_the_firmware_of_2016_it_is_the_python_board_with_those(tmp_path):
    firmware = native_boards.build(folder_at(tmp_path / "hip", "[defines]\nFIRMWARE_2016 = 1\n"))
    quirks = Quirks.firmware_2016()
    assert firmware.warnings == ()
    assert seen(firmware, 3.0, quirks=quirks) == seen(None, 3.0, quirks=quirks)
    fault = ("MCH.motor_current", "offset", {"offset": 0.5})
    assert seen(firmware, 0.4, quirks=quirks, fault=fault) == seen(None, 0.4, quirks=quirks, fault=fault)
