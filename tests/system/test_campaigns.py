"""Campaigns of the whole robot: a branch is the run, and whoever is killed, the results are the same."""

import contextlib
import json
import os
import pathlib
import signal
import subprocess
import sys

import pytest

from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.harness.campaigns import engine, group, plan, pools

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


@pytest.fixture
def few(tmp_path):
    path = tmp_path / "few.toml"
    path.write_text(PLAN)
    return path


def results_in(folder):
    """{key: result} of a campaign's file, without what the run cost; every key stands there once."""
    lines = [json.loads(line) for line in (folder / "results.jsonl").read_bytes().splitlines()]
    assert len({line["key"] for line in lines}) == len(lines)
    return {line["key"]: {name: value for name, value in line.items() if name != "spent"} for line in lines}


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
    campaign = engine.Campaign(plan.load(few), tmp_path)
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


def test_a_killed_campaign_goes_on_and_loses_and_doubles_nothing(few, tmp_path):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    run(few, whole, "--pool", "local", "--jobs", "2")
    process = subprocess.Popen(
        campaign_command(few, killed, "--pool", "local", "--jobs", "1"), cwd=ROOT, stderr=subprocess.DEVNULL
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
    told = run(few, killed, "--pool", "local", "--jobs", "2").stderr
    assert f"{len(before) - HEALTHY} of them are there already" in told
    after = results_in(killed)
    assert len(after) == HEALTHY + RUNS and after == results_in(whole)
    assert {key: after[key] for key in before} == before


def test_a_dask_cluster_that_loses_a_worker_gives_the_same_results(few, tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed")
    local, cluster = tmp_path / "local", tmp_path / "cluster"
    run(few, local, "--pool", "local", "--jobs", "2")
    where = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli."]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT}
    with contextlib.ExitStack() as started:

        def start(program, *options):
            command = [*dask[:2], dask[2] + program, "--scheduler-file", str(where), "--no-dashboard", *options]
            process = subprocess.Popen(command, **quiet)
            started.callback(process.wait)
            started.callback(process.kill)
            return process

        start("dask_scheduler", "--port", "0", "--host", "127.0.0.1")
        workers = [start("dask_worker", "--nthreads", "1", "--no-nanny", "--name", name) for name in ("a", "b")]
        address = address_in(where, workers[0])
        process = subprocess.Popen(
            campaign_command(few, cluster, "--scheduler", address), cwd=ROOT, stderr=subprocess.PIPE, text=True
        )
        started.callback(process.kill)
        until_results(process, cluster, 1)
        os.kill(workers[0].pid, signal.SIGKILL)
        _, told = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, told
    assert results_in(cluster) == results_in(local)


def address_in(where, worker):
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
    with distributed.Client(address, timeout="60s") as client:
        client.wait_for_workers(2, timeout=PATIENCE_S)
    return address


def test_what_cannot_be_reached_or_read_is_told_in_one_line(few, tmp_path):
    for arguments, wanted in (
        ((few, tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1"), "no Dask scheduler there"),
        ((few, tmp_path / "out", "--replay", "nothing"), "the plan has no such run of this version"),
        ((tmp_path / "none.toml", tmp_path / "out"), "No such file"),
    ):
        if "--scheduler" in arguments and not pools.importlib.util.find_spec("distributed"):
            wanted = "Dask is not installed"
        done = subprocess.run(
            campaign_command(*arguments), cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE_S
        )
        assert done.returncode == 2 and wanted in done.stderr and "Traceback" not in done.stderr
