"""Small programs in C for tests, built into folders of their own."""

import pathlib
import shutil

from ranger_sim.firmware_sim.native.build import build
from ranger_sim.firmware_sim.native.compiler import COMPILERS
from ranger_sim.firmware_sim.native.manifest import load

EXAMPLE = pathlib.Path(__file__).parent / "example"
COMPILER = any(shutil.which(each) for each in COMPILERS)
TIMER = """
#include <ranger_sim/firmware.h>
#ifndef TASK
#define TASK
#endif
static int32_t calls;
static int32_t task(void) { calls++; TASK; return 0; }
static const fw_task every[] = {{task, "task", 100}};
static const fw_schedule schedule = {.slot_ns = 500000, .every = FW_TASKS(every), .tick_vic_slot = 4};
"""
SCHEDULE = "const fw_schedule *firmware_schedule(void) { return &schedule; }\n"
START = "void firmware_start(void) {}\n"


def folder_with(folder, source, manifest="[firmware]\nname = 'small'\n"):
    """A folder of firmware with one source."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "small.c").write_text(source, encoding="utf-8")
    (folder / "firmware.toml").write_text(manifest, encoding="utf-8")
    return folder


def library_of(folder, **how):
    """The library built of a folder of firmware."""
    return build(load(folder), **how).path
