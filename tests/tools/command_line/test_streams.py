"""The standard streams of a command: readers that leave, results alone, and what is printed below Python."""

import contextlib
import io
import json
import os
import subprocess
import sys

import pytest

from ranger_sim.tools.command_line import streams

PRINTS_BELOW_PYTHON = """
import ctypes, os, sys
from ranger_sim.tools.command_line import streams
assert streams.take_over() and streams.take_over()
with streams.results_alone():
    print("of a fault module")
    ctypes.CDLL(None).puts(b"of a library in C")
    os.system("echo of another program")
    streams.print_result('{"a": 1}')
print("at the end")
"""


def run(program, **settings):
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, **settings)


def test_only_results_reach_standard_output_while_it_is_for_them_alone():
    done = run(PRINTS_BELOW_PYTHON)
    assert done.stdout == '{"a": 1}\nat the end\n'
    assert sorted(done.stderr.splitlines()) == ["of a fault module", "of a library in C", "of another program"]


def test_in_a_process_of_another_program_its_streams_stay(capsys):
    before = sys.stdout
    assert not streams.take_over() and sys.stdout is before
    with streams.results_alone():
        print("aside")
        streams.print_result("result")
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("result\n", "aside\n") and sys.stdout is before


def test_what_is_printed_to_a_reader_that_has_left_vanishes():
    read, write = os.pipe()
    os.close(read)
    with contextlib.closing(streams.PatientFile(write, expendable=False)) as file:
        assert file.write(b"lost") == 4
        assert file.write(b"lost as well") == 12
    os.close(write)


def test_a_descriptor_that_was_closed_takes_everything():
    read, write = os.pipe()
    os.close(read)
    file = streams.PatientFile(write, expendable=False)
    os.close(write)
    assert file.write(b"lost") == 4
    os.close(write)  # it leads nowhere now
    file.close()


def test_a_full_disk_loses_a_result_and_not_a_line_of_progress():
    with open("/dev/full", "wb", buffering=0) as full:
        with contextlib.closing(streams.PatientFile(full.fileno(), expendable=False)) as file:
            with pytest.raises(OSError, match="No space left"):
                file.write(b"result")
        with contextlib.closing(streams.PatientFile(full.fileno(), expendable=True)) as file:
            assert file.write(b"progress") == 8


def test_a_reader_that_is_slow_gets_everything_although_the_descriptor_does_not_block():
    read, write = os.pipe()
    os.set_blocking(write, False)
    program = f"import os; data = b''\nwhile len(data) < 1_000_000: data += os.read({read}, 1 << 16)"
    with subprocess.Popen([sys.executable, "-c", program], pass_fds=[read]) as reader:
        with io.BufferedWriter(streams.PatientFile(write, expendable=False)) as file:
            file.write(bytes(1_000_000))
        assert reader.wait(60) == 0
    os.close(read)
    os.close(write)


def test_a_program_that_closes_its_error_output_in_a_run_changes_nothing():
    program = (
        "import os, sys; from ranger_sim.tools.command_line import streams; streams.take_over(); os.close(2);"
        "print('lost', file=sys.stderr); print('kept')"
    )
    done = run(program)
    assert (done.stdout, done.stderr) == ("kept\n", "")


def test_the_result_of_a_command_is_json_also_when_a_fault_module_prints(tmp_path):
    module = tmp_path / "chatty.py"
    module.write_text("print('loaded')\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "ranger_sim", "walk", "--time", "1ms", "--fault-module", module, "--json", "-"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert json.loads(done.stdout)["time_s"] == 0.001 and done.stderr == "loaded\n"
