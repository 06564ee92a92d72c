"""What holds for every test."""

import collections
import gc
import os
import shutil
import signal

import pytest

from ranger_sim import loading
from tests.examples import register_profiles

register_profiles()

# A thread of linear algebra for each test and each program that it starts: two threads of two tests side by side wait
# for each other, and a diagnosis takes up to twice the processor time. Read when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
COMPILERS = ("cc", "gcc", "clang")
CROSS_COMPILERS = ("arm-none-eabi-gcc",)
DEBUGGERS = ("gdb-multiarch", "arm-none-eabi-gdb")
OURS = ("anon_inode", "pipe", "socket")  # kinds of descriptors that a test may leave open only by mistake

# Files that take longest, the longest first: side by side they begin before the many short ones, so that at the end
# neither process waits for the other (from 250 s of processor down to 15 s each, 30 November 2026, AMD EPYC). The
# last five take as long interpreted (`make test-interpreted`).
LONGEST = (
    "sysid/test_parameters_that_change.py",
    "sysid/test_leg_swing_machine.py",
    "system/test_processes.py",
    "system/test_campaigns.py",
    "harness/processes/test_firmware_that_breaks.py",
    "test_packaging.py",
    "system/test_determinism.py",
    "sysid/test_driven_joints.py",
    "sysid/test_diagnose.py",
    "sysid/test_machines_of_a_user.py",
    "test_wheel.py",
    "sysid/test_matrix.py",
    "tools/panel/test_page_of_recordings.py",
    "sysid/test_input_limits.py",
    "tools/test_bench.py",
    "blind/test_generator.py",
    "tools/command_line/test_missing_libraries.py",
    "sysid/test_ankle_machine.py",
    "system/test_campaign_designs.py",
    "ranger/testing/test_firmware_in_tests.py",
    "tools/panel/test_keyboard.py",
    "sysid/test_left_over.py",
    "sysid/test_model_file.py",
    "sysid/test_free_simulation.py",
    "ranger/faults/test_sensor_faults.py",
    "sysid/test_identify.py",
    "ranger/testing/test_forked_tests.py",
    "sysid/test_api.py",
    "ranger/testing/test_forked_tests_among_plugins.py",
    "boards/test_main_brain_walks_the_bare_body.py",
    "harness/test_supervision.py",
    "can_bus/test_fd_bus.py",
    "plant/test_ranger_plant.py",
    "firmware_sim/native/test_sanitizers.py",
)


def pytest_collection_modifyitems(items):
    """The longest files first; each file stays whole and as it is."""
    places = {f"tests/{name}": place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.nodeid.partition("::")[0], len(places)))


def descriptors_of_this_process():
    """How many of each kind in OURS are open."""
    found = collections.Counter()
    for number in os.listdir("/proc/self/fd"):
        try:
            found[os.readlink(f"/proc/self/fd/{number}").partition(":")[0]] += 1
        except OSError:
            continue  # the listing's own
    return {kind: found[kind] for kind in OURS}


@pytest.fixture(autouse=True, scope="module")
def nothing_stays_open():
    """A module's tests close what they open: in a suite of thousands a few each soon are more than `select` knows."""
    if not os.path.isdir("/proc/self/fd"):
        yield
        return
    before = descriptors_of_this_process()
    yield
    if (after := descriptors_of_this_process()) != before:
        gc.collect()
        after = descriptors_of_this_process()
    more = {kind: after[kind] - before[kind] for kind in OURS if after[kind] > before[kind]}
    assert not more, f"left open by this module's tests: {more}"


def pytest_configure(config):
    """Programs inherit which signals this process ignores: SIGINT in a background job, SIGHUP under nohup."""
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


def missing_for_ci():
    """What tests would skip for in silence: a browser, C compilers, a debugger, the compiled library if asked for."""
    missing = [
        names[0] for names in (BROWSERS, COMPILERS, CROSS_COMPILERS, DEBUGGERS) if not any(map(shutil.which, names))
    ]
    if not (loading.RUNS_COMPILED or loading.interpreted_is_forced()):
        missing.append(f"the compiled library ({loading.RUNS_INTERPRETED_BECAUSE})")
    return missing


def pytest_sessionstart(session):
    """Where CI=true says that all must be tested, nothing is left out for want of a program."""
    if os.environ.get("CI") == "true" and (missing := missing_for_ci()):
        raise pytest.UsageError(f"CI=true, and there is no {', no '.join(missing)}: tests would be skipped")
