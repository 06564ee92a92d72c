"""Campaigns of the whole robot: a branch is the run, and whichever process is killed, the results are the same."""

import contextlib
import importlib.util
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys

import pytest

from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.harness.campaigns import engine, group, plan, pools
from ranger_sim.ranger.walks import REFERENCE

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLAN = """
title = "a few faults"
[watch]
after = "0.8 s"
[healthy]
seeds = [1, 2]
[vary]
seed = [1, 2]
fault = [
  "MCH.absolute_encoder:stuck@{start}",
  "UI.imu:gyro_bias@{start}",
  "MCFO.left_foot:contact_stuck@{start}",
]
start = ["step 2"]
"""
RUNS, HEALTHY = 6, 1
PATIENCE_S = 300.0  # on a machine that does other things

needs_dask = pytest.mark.skipif(not importlib.util.find_spec("distributed"), reason="Dask is not installed")


@pytest.fixture
def few(tmp_path):
    path = tmp_path / "few.toml"
    path.write_text(PLAN)
    return path


def results_in(folder):
    """{key: result} of a campaign's file, without what the run cost; every key is there once."""
    lines = [json.loads(line) for line in (folder / "results.jsonl").read_bytes().splitlines()]
    assert len({line["key"] for line in lines}) == len(lines)
    return {line["key"]: {name: value for name, value in line.items() if name != "spent"} for line in lines}


@pytest.fixture(scope="module")
def whole_results(tmp_path_factory):
    """The results of the campaign in one go, without Dask."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "few.toml").write_text(PLAN)
    run(folder / "few.toml", folder / "out", "--jobs", "2")
    return results_in(folder / "out")


def campaign_command(path, folder, *more):
    return [sys.executable, "-m", "ranger_sim", "campaign", str(path), "--out", str(folder), *more]


def run(path, folder, *more):
    done = subprocess.run(
        campaign_command(path, folder, *more), cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )
    assert done.returncode == 0, done.stderr
    return done


def until_results(process, folder, count):
    """Wait until so many results of runs are on the disk; the process must not have ended before."""
    deadline = wallclock.monotonic_s() + PATIENCE_S
    while wallclock.monotonic_s() < deadline:
        with contextlib.suppress(FileNotFoundError):
            if (folder / "results.jsonl").read_bytes().count(b'"outcome"') >= count:
                return
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=0.02)
            pytest.fail("it ended before it could be killed")
    pytest.fail(f"not {count} results within {PATIENCE_S} s")


def descendants(process):
    """The processes that a process has started, and those that these have."""
    found = []
    for task in pathlib.Path(f"/proc/{process}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            with contextlib.suppress(FileNotFoundError):  # it has just ended
                found += [child, *descendants(child)]
    return found


def test_a_run_branched_off_the_golden_run_is_the_run_from_power_up(few, tmp_path):
    campaign = engine.Campaign(plan.load(few, REFERENCE), tmp_path)
    try:
        campaign.run(pools.LocalPool(1), lambda done, what: None)
        for case in campaign.cases[:3]:
            branched = campaign.result(case)
            alone = group.alone(case, campaign.plan.watch, campaign.healthy_of(case))
            assert branched["digest"] == alone["digest"]
            unlike = ("key", "spent", "cpu_s")
            alone["fault"]["armed_s"] = branched["fault"]["armed_s"]  # of the branch: shortly before its start
            assert {k: v for k, v in branched.items() if k not in unlike} == {
                k: v for k, v in alone.items() if k not in unlike
            }
        assert {campaign.result(case)["fault"]["acted"] for case in campaign.cases} == {True}
    finally:
        campaign.close()


@pytest.mark.parametrize("pool", ["local", pytest.param("dask", marks=needs_dask)])
def test_a_killed_campaign_goes_on_and_loses_and_doubles_nothing(few, whole_results, tmp_path, pool):
    killed = tmp_path / "killed"
    process = subprocess.Popen(
        campaign_command(few, killed, "--jobs", "1", "--pool", pool), cwd=ROOT, stderr=subprocess.DEVNULL
    )
    until_results(process, killed, 2)
    workers = []
    for each in descendants(process.pid):
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            workers.append(os.pidfd_open(each))
    process.send_signal(signal.SIGKILL)
    process.wait()
    for worker in workers:  # none of them outlives it, neither the group's process nor a branch of that
        assert descriptors.wait([worker], [], PATIENCE_S)[0]
        os.close(worker)
    before = results_in(killed)
    assert HEALTHY + 2 <= len(before) < HEALTHY + RUNS
    reported = run(few, killed, "--jobs", "2").stderr
    assert f"{len(before) - HEALTHY} of them have results already" in reported
    after = results_in(killed)
    assert len(after) == HEALTHY + RUNS and after == whole_results
    assert {key: after[key] for key in before} == before


TABLES = ("tcp", "tcp6", "udp", "udp6")
LOOPBACK = "0100007F"  # 127.0.0.1 as proc(5) writes it
UNIX_LISTENS = 0x10000  # __SO_ACCEPTCON


def listening(process):
    """[(process, kind, local address)]: sockets of a process and its descendants at which others can arrive.

    Every TCP and UDP socket counts that is not a connection, and every Unix socket that listens.
    """
    owners = {}
    for each in [process, *descendants(process)]:
        with contextlib.suppress(FileNotFoundError):  # it has just ended, or closed one
            for descriptor in pathlib.Path(f"/proc/{each}/fd").iterdir():
                with contextlib.suppress(FileNotFoundError):
                    owners[os.readlink(descriptor)] = each
    found = []
    for table in (*TABLES, "unix"):
        for line in pathlib.Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if table == "unix":
                place, accepts = 6, int(fields[3], 16) & UNIX_LISTENS
            else:
                place, accepts = 9, fields[2].endswith(":0000")  # no remote end
            owner = owners.get(f"socket:[{fields[place]}]")
            if owner is not None and accepts:
                found.append((owner, table, fields[1]))
    return found


def go_on(processes):
    for each in processes:
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.kill(each, signal.SIGCONT)


def command_line(process):
    """Its words; none of a process that has ended."""
    with contextlib.suppress(FileNotFoundError):
        return pathlib.Path(f"/proc/{process}/cmdline").read_bytes()
    return b""


def runs_of_groups(processes):
    """Those that run a group of the campaign (group.py), or a branch of one."""
    return [each for each in processes if b"campaigns.group" in command_line(each)]


@contextlib.contextmanager
def campaign_at_work(path, folder, *more):
    """A campaign that has a result and has not ended, every process of it stopped inside."""
    process = subprocess.Popen(
        campaign_command(path, folder, *more), cwd=ROOT, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        until_results(process, folder, 1)
        tree = [process.pid, *descendants(process.pid)]
        for each in tree:
            os.kill(each, signal.SIGSTOP)
        yield process
        go_on(tree)
        assert process.wait(PATIENCE_S) == 0
    finally:
        process.kill()
        process.wait()


def test_what_listens_is_seen():
    """The reader that the next tests trust."""
    with socket.create_server(("127.0.0.1", 0)) as listener, socket.socket(socket.AF_UNIX) as local:
        local.bind("")
        local.listen()
        port = listener.getsockname()[1]
        with socket.socket(type=socket.SOCK_DGRAM) as datagrams:
            datagrams.bind(("127.0.0.1", 0))
            found = [(table, address) for _, table, address in listening(os.getpid())]
    assert ("tcp", f"{LOOPBACK}:{port:04X}") in found
    assert {table for table, _ in found} >= {"tcp", "udp", "unix"}


def test_a_campaign_opens_no_network_port(few, tmp_path):
    """Whatever is installed: Dask works only where it is asked for."""
    with campaign_at_work(few, tmp_path / "out", "--jobs", "2") as process:
        assert runs_of_groups(descendants(process.pid))
        assert listening(process.pid) == []


STRANGER = """
import os, socket, ssl, sys
import distributed

def answer(port, wrapped):
    with socket.create_connection(("127.0.0.1", port), 10) as plain:
        with wrapped(plain) as it:
            it.settimeout(10)
            it.sendall(b"GET / HTTP/1.0\\r\\n\\r\\n")
            return it.recv(100)

encrypted = ssl.create_default_context()
encrypted.check_hostname, encrypted.verify_mode = False, ssl.CERT_NONE
other = distributed.Security.temporary()
if os.geteuid() == 0:  # another user, where that is possible; from here on, as the interpreter may be root's alone
    os.setgroups([])
    os.setresuid(65534, 65534, 65534)
for port in map(int, sys.argv[1:]):
    for wrapped in (lambda plain: plain, encrypted.wrap_socket):
        try:
            got = answer(port, wrapped)
        except OSError:
            got = b""
        assert got in (b"",) or got[:1] == b"\\x15", (port, got)  # nothing, or the alert record of TLS
    for address, security in ((f"tcp://127.0.0.1:{port}", None), (f"tls://127.0.0.1:{port}", other)):
        try:
            distributed.Client(address, timeout="1s", security=security)
        except OSError:
            continue
        raise AssertionError(f"{address} serves a stranger")
print("refused")
"""


@needs_dask
def test_its_own_dask_cluster_is_on_the_loopback_address_and_refuses_clients_without_its_certificate(
    few, whole_results, tmp_path
):
    out = tmp_path / "out"
    with campaign_at_work(few, out, "--pool", "dask", "--jobs", "2") as process:
        found = listening(process.pid)
        assert {table for _, table, _ in found} == {"tcp"}
        assert {address.partition(":")[0] for _, _, address in found} == {LOOPBACK}
        ports = sorted(int(address.partition(":")[2], 16) for _, _, address in found)
        assert len(ports) == 5  # the scheduler, and a worker and its nanny twice; no pages
        tree = [process.pid, *descendants(process.pid)]
        waiting = runs_of_groups(tree)
        assert waiting  # so the cluster is there until the stranger has tried everything
        go_on(set(tree) - set(waiting))
        stranger = subprocess.run(
            [sys.executable, "-c", STRANGER, *map(str, ports)],
            cwd="/",
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
        assert stranger.stdout == "refused\n", stranger.stderr
    assert results_in(out) == whole_results


@pytest.fixture
def outside_cluster(tmp_path):
    """(address, options, scheduler, workers) of Dask's own programs, with TLS."""
    import distributed

    security = distributed.Security.temporary()
    files = {"ca-file": security.tls_ca_file, "cert": security.tls_client_cert, "key": security.tls_client_key}
    options = []
    for name, text in files.items():
        path = tmp_path / f"{name}.pem"
        path.write_text(text)
        options += [f"--tls-{name}", str(path)]
    where = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT}
    with contextlib.ExitStack() as started:

        def start(program, *more):
            command = [sys.executable, "-m", f"distributed.cli.{program}", "--scheduler-file", str(where), *options]
            process = subprocess.Popen([*command, "--no-dashboard", *more], **quiet)
            started.callback(process.wait)
            started.callback(process.kill)
            return process

        scheduler = start("dask_scheduler", "--port", "0", "--host", "tls://127.0.0.1")
        workers = [start("dask_worker", "--nthreads", "1", "--no-nanny", "--name", name) for name in ("a", "b")]
        yield address_in(where, workers[0], security), options, scheduler, workers


@needs_dask
@pytest.mark.parametrize("killed", ["worker", "scheduler"])
def test_a_dask_cluster_that_loses_a_part_gives_the_same_results(few, whole_results, tmp_path, outside_cluster, killed):
    """A worker's work is done by another; without a scheduler the campaign ends in a line, and goes on without Dask."""
    address, options, scheduler, workers = outside_cluster
    cluster = tmp_path / "cluster"
    process = subprocess.Popen(
        campaign_command(few, cluster, "--scheduler", address, *options), cwd=ROOT, stderr=subprocess.PIPE, text=True
    )
    try:
        until_results(process, cluster, 1)
        (scheduler if killed == "scheduler" else workers[0]).kill()
        _, reported = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    assert "Traceback" not in reported
    if killed == "scheduler":
        assert process.returncode == 2, reported
        assert f"campaign: the Dask scheduler at {address} ended" in reported
        run(few, cluster)
    else:
        assert process.returncode == 0, reported
        assert "warning" not in reported
    assert results_in(cluster) == whole_results


def address_in(where, worker, security):
    """The scheduler's address, when two workers have come to it."""
    import distributed

    deadline = wallclock.monotonic_s() + PATIENCE_S
    while wallclock.monotonic_s() < deadline:
        with contextlib.suppress(subprocess.TimeoutExpired):
            worker.wait(timeout=0.1)
            pytest.fail("the worker ended")
        with contextlib.suppress(FileNotFoundError, ValueError):
            address = json.loads(where.read_text())["address"]
            break
    with distributed.Client(address, timeout="60s", security=security) as client:
        client.wait_for_workers(2, timeout=PATIENCE_S)
    return address


@needs_dask
def test_a_scheduler_without_tls_is_used_with_a_warning_of_one_line(few, tmp_path):
    done = refused(few, tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1")
    warning, mistake = done.stderr.splitlines()
    assert warning.startswith("warning: the Dask scheduler at tcp://127.0.0.1:1 is used without TLS: ")
    assert "no Dask scheduler there" in mistake


@pytest.mark.parametrize(
    "options, wanted",
    [
        (["--tls-cert", "x"], "--tls-cert: only with --scheduler"),
        (["--scheduler", "tcp://h:1", "--tls-cert", "x"], "--scheduler tcp://h:1: with --tls-cert the address begins"),
        (["--scheduler", "tls://h:1", "--tls-ca-file", "none"], "--tls-ca-file none: no such file"),
        (["--scheduler", "tls://h:1", "--tls-ca-file", __file__], "--tls-ca-file: --tls-cert is missing"),
        (["--scheduler", "tls://h:1", "--pool", "local"], "--scheduler and --pool local"),
    ],
)
def test_options_of_tls_that_do_not_fit_are_refused_in_one_line(few, tmp_path, options, wanted):
    (line,) = refused(few, tmp_path / "out", *options).stderr.splitlines()
    assert wanted in line


@needs_dask
def test_files_that_are_not_certificates_are_refused_in_one_line(few, tmp_path):
    given = [each for option in ("ca-file", "cert", "key") for each in (f"--tls-{option}", __file__)]
    (line,) = refused(few, tmp_path / "out", "--scheduler", "tls://127.0.0.1:1", *given).stderr.splitlines()
    assert "--scheduler tls://127.0.0.1:1: TLS files: " in line


def test_unreachable_and_unreadable_inputs_are_reported_in_one_line(few, tmp_path):
    for arguments, wanted in (
        ((few, tmp_path / "out", "--replay", "nothing"), "the plan has no such run of this version"),
        ((tmp_path / "none.toml", tmp_path / "out"), "No such file"),
    ):
        assert wanted in refused(*arguments).stderr


def refused(path, folder, *more):
    """A campaign that does not begin."""
    done = subprocess.run(
        campaign_command(path, folder, *more), cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )
    assert done.returncode == 2 and "Traceback" not in done.stderr
    return done


def test_json_prints_the_summary_of_the_folder_alone_and_a_census_takes_no_seed(few, tmp_path):
    printed = run(few, tmp_path / "all", "--report", "--json", "-")
    assert json.loads(printed.stdout) == json.loads((tmp_path / "all" / "summary.json").read_text(encoding="utf-8"))
    assert printed.stderr == ""
    run(few, tmp_path / "all", "--report", "--json", str(tmp_path / "all.json"))
    assert (tmp_path / "all.json").read_bytes() == (tmp_path / "all" / "summary.json").read_bytes()
    words = campaign_command(few, tmp_path / "all", "--seed", "7")
    refused = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert refused.returncode == 2
    assert refused.stderr == f"ranger-sim: --seed 7: {few} has neither [sample] nor [search]; a census draws nothing\n"
