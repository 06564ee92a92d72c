"""A process that runs a program in C reaches nothing but what it needs, and reports what its confinement lacks."""

import contextlib
import ctypes
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

from ranger_sim.firmware_sim.native import confinement
from ranger_sim.firmware_sim.native.confinement import PROCESSORS, Needs, confine, describe, program_of
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.robot import Ranger
from tests.firmware_sim.native.support import COMPILER, folder_with
from tests.harness.processes.test_firmware_that_breaks import MANIFEST, WELL, program, walked

pytestmark = [
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="confinement needs Linux"),
    pytest.mark.skipif(not COMPILER, reason="no C compiler here"),
]


def grants_all():
    """Whether this kernel grants user namespaces, Landlock and seccomp, asked otherwise than `confine` asks."""
    if not shutil.which("unshare") or not pathlib.Path("/proc/sys/kernel/seccomp/actions_avail").exists():
        return False
    alone = subprocess.run(
        ["unshare", "--user", "--net", "--ipc", "--uts", "true"], capture_output=True, check=False, timeout=60
    )
    version = ctypes.CDLL(None).syscall(444, None, ctypes.c_size_t(0), 1)  # landlock_create_ruleset of every processor
    return alone.returncode == 0 and version >= 1


needs_all = pytest.mark.skipif(not grants_all(), reason="this kernel, or a container, does not grant every confinement")

# Each returns what the kernel answered: 0 done, otherwise errno.
HOSTILE = """
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
static void *thread(void *given) { return given; }
static void answer(const char *what, int failed) { printf("%s %d\\n", what, failed ? errno : 0); }
static void break_down(void)
{
    static int done;
    pthread_t made;
    if (done++)
        return;
    answer("socket", socket(AF_INET, SOCK_STREAM, 0) < 0);
    answer("unix socket", socket(AF_UNIX, SOCK_STREAM, 0) < 0);
    answer("fork", fork() < 0);
    answer("exec", execl("/bin/true", "true", (char *)0) < 0);
    answer("signal", kill(getppid(), SIGTERM) < 0);
    answer("signal all", kill(-1, SIGTERM) < 0);
    answer("ptrace", ptrace(PTRACE_ATTACH, getppid(), 0, 0) < 0);
    answer("read", open("/etc/passwd", O_RDONLY) < 0);
    answer("write", open("VICTIM", O_WRONLY | O_TRUNC) < 0);
    answer("create", open("VICTIM.new", O_WRONLY | O_CREAT, 0600) < 0);
    answer("remove", unlink("VICTIM") < 0);
    answer("own folder", open("FOLDER/small.c", O_RDONLY) < 0);
    printf("thread %d\\n", pthread_create(&made, 0, thread, 0));
    fflush(stdout);
}
"""


def hostile(folder, victim):
    """A folder with the program above."""
    source = program(HOSTILE.replace("VICTIM", str(victim)).replace("FOLDER", str(folder)))[0]
    return folder_with(folder, "#define _GNU_SOURCE\n" + source, MANIFEST)


@needs_all
def test_a_board_reaches_no_network_process_thread_or_file_of_others(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("kept", encoding="utf-8")
    out = tmp_path / "run"
    done, found = walked(hostile(tmp_path / "fw", victim), "--out", str(out))
    assert found["firmware"]["MCH"]["confined"] == "yes", done.stderr
    (printed,) = out.rglob("printed*MCH*")
    answers = dict(line.rsplit(" ", 1) for line in printed.read_text(encoding="utf-8").splitlines())
    assert answers.pop("own folder") == "0"
    assert set(answers.values()) <= {"1", "11", "13"}  # EPERM, EAGAIN of a thread, EACCES
    assert len(answers) == 12
    assert (victim.read_text(encoding="utf-8"), done.returncode) == ("kept", 0)


@needs_all
def test_what_cannot_be_had_is_named_and_refused_where_all_is_required(tmp_path, monkeypatch):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    monkeypatch.setattr(confinement, "_restrict_files", lambda libc, needs: "no Landlock: Function not implemented")
    with contextlib.closing(Ranger(firmware={"MCH": folder})) as robot:
        robot.run_for("2 ms")
        assert robot.deaths == []
        confined = robot.summary()["firmware"]["MCH"]["confined"]
    assert confined == "partly (files are not restricted: no Landlock: Function not implemented)"
    with pytest.raises(UserError, match=re.escape(f"--require-confined): {confined}")):
        Ranger(firmware={"MCH": folder}, require_confined=True)


def test_a_walk_that_requires_confinement_ends_before_it_runs_where_the_program_is_in_its_own_process(tmp_path):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    done, found = walked(folder, "--require-confined", "--in-process")
    assert (done.returncode, found) == (2, None)
    assert done.stderr == (
        "ranger-sim: MCH: every program in C is to be confined (--require-confined): no (its program runs in the run's "
        "own process)\n"
    )


@needs_all
def test_a_walk_that_requires_confinement_runs_where_it_is_granted(tmp_path):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    assert walked(folder, "--require-confined")[1]["firmware"]["MCH"]["confined"] == "yes"


@needs_all
def test_where_user_namespaces_are_forbidden_the_rest_holds(tmp_path):
    """The C library's call is replaced by one that fails as the kernel's does in many containers."""
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        libc = ctypes.CDLL(None, use_errno=True)
        libc.unshare = lambda flags: ctypes.set_errno(1) or -1
        real = ctypes.CDLL
        try:
            ctypes.CDLL = lambda *a, **k: libc
            lacks = confine(Needs(), [writing])
            try:
                open(tmp_path / "new", "w", encoding="utf-8").close()
            except PermissionError:
                lacks.append("refused")
            os.write(writing, json.dumps(lacks).encode())
        finally:
            ctypes.CDLL = real
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        lacks = json.loads(pipe.read())
    os.waitpid(process, 0)
    assert lacks == [
        "no separate process numbers: not asked for",
        "no separate namespaces: Operation not permitted",
        "refused",
    ]


@needs_all
def test_a_board_has_separate_process_numbers_and_nothing_of_it_is_left(tmp_path):
    """It is the second process of its namespace, after an init, and a child of the run's process nevertheless."""
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    before = children_of(os.getpid())
    with contextlib.closing(Ranger(firmware={"MCH": folder})) as robot:
        robot.run_for("1 ms")
        board = robot.processes.children["MCH"]
        status = pathlib.Path(f"/proc/{board}/status").read_text(encoding="utf-8")
        assert re.search(rf"^NSpid:\t{board}\t2$", status, re.MULTILINE)
        assert board in children_of(os.getpid())
        assert robot.deaths == []
    assert children_of(os.getpid()) == before


@needs_all
def test_a_board_runs_without_separate_process_numbers_where_the_kernel_does_not_grant_them(tmp_path, monkeypatch):
    monkeypatch.setattr(confinement, "CLONE_NEWPID", 1)  # not a flag of unshare
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    with contextlib.closing(Ranger(firmware={"MCH": folder})) as robot:
        robot.run_for("1 ms")
        assert robot.deaths == []
        confined = robot.summary()["firmware"]["MCH"]["confined"]
    assert confined == "partly (no separate process numbers: Invalid argument)"


def children_of(parent):
    """Every process whose parent it is, zombies as well."""
    found = set()
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            if int(fields[1]) == parent:
                found.add(int(stat.parent.name))
    return found


def test_the_walks_own_process_never_loads_the_library(tmp_path):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    with contextlib.closing(Ranger(firmware={"MCH": folder})) as robot:
        robot.run_for("1 ms")
        with open("/proc/self/maps", encoding="utf-8") as maps:
            assert str(folder) not in maps.read()
        board = robot.processes.children["MCH"]
        with open(f"/proc/{board}/maps", encoding="utf-8") as maps:
            assert str(robot.firmware["MCH"].library) in maps.read()


@pytest.mark.parametrize("name", PROCESSORS)
def test_every_jump_of_the_filter_ends_at_an_instruction(name):
    code = program_of(PROCESSORS[name], 1234)
    steps = [(int.from_bytes(code[i : i + 2], "little"), code[i + 2], code[i + 3]) for i in range(0, len(code), 8)]
    for at, (operation, then, other) in enumerate(steps):
        if operation in (confinement.JUMP_EQUAL, confinement.JUMP_GREATER_EQUAL):
            assert max(at + 1 + then, at + 1 + other) < len(steps)
    assert steps[-1][0] == confinement.RETURN


def test_the_words_of_a_confinement():
    assert (describe([]), describe(["a", "b"]), describe(None)) == ("yes", "partly (a; b)", "no")


# Makes everything shared writable that the kernel lets it, and fills it.
SCRIBBLING = """
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
static void break_down(void)
{
    static int done;
    char line[512], rights[8];
    unsigned long first[64], end[64];
    int count = 0, writable = 0;
    if (done++)
        return;
    FILE *list = fopen("/proc/self/maps", "r");
    while (count < 64 && fgets(line, sizeof line, list))
        if (sscanf(line, "%lx-%lx %7s", &first[count], &end[count], rights) == 3 && rights[3] == 's')
            count++;
    for (int part = 0; part < count; part++)
        if (mprotect((void *)first[part], end[part] - first[part], PROT_READ | PROT_WRITE) == 0) {
            writable++;
            if (SCRIBBLES)
                memset((void *)first[part], 0x55, end[part] - first[part]);
        }
    printf("%d writable\\n", writable);
    fflush(stdout);
}
"""
# Prints what its converter measures in every slot.
MEASURING = """
#include <stdio.h>
static void break_down(void)
{
    fw_adc_start(1);
    printf("%u\\n", (unsigned)fw_adc_result());
}
"""


@needs_all
def test_a_board_that_writes_over_all_shared_memory_that_it_can_write_changes_nothing_for_others(tmp_path):
    """Of the shared memory in its process it can write its own block alone."""
    measuring = program(MEASURING)[0].replace("mch_table", "mcfi_table")
    measuring = measuring.replace("fw_can_start(1", "fw_adc_start_clock(13); fw_can_start(2")
    other = folder_with(tmp_path / "other", measuring, MANIFEST.replace("mch", "mcfi"))
    measured, printed = [], []
    for scribbles in (0, 1):
        source = program(SCRIBBLING.replace("SCRIBBLES", str(scribbles)))[0]
        folder = folder_with(tmp_path / f"fw{scribbles}", "#define _GNU_SOURCE\n" + source, MANIFEST)
        out = tmp_path / f"run{scribbles}"
        done, found = walked(folder, "--firmware", f"MCFI={other}", "--board-deadline", "3s", "--out", str(out))
        assert found, done.stderr
        assert "MCFI" not in found["failed_boards"], done.stderr
        (text,) = out.rglob("printed*MCH*")
        printed.append(text.read_text(encoding="utf-8"))
        (text,) = out.rglob("printed*MCFI*")
        measured.append(text.read_text(encoding="utf-8"))
    assert printed == ["1 writable\n"] * 2
    assert len(set(measured[0].split())) > 3
    assert measured[0] == measured[1]
