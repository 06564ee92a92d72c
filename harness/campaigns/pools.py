"""Pools that do the runs: processes of this machine, or the workers of a Dask cluster.

Either way a group of runs has its own process (`group`), with one thread, so that it may fork; Dask's workers have
several threads and start such a process for each group. Results that a process returned before it died are kept, the
rest of its group is requested again; a run at which `ATTEMPTS` processes died is "crashed".
"""

import contextlib
import importlib
import json
import logging
import queue
import ssl
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

from ranger_sim.foundation.user_error import CampaignError

ATTEMPTS = 3
DASK_LOGS = ("distributed", "distributed.client")  # those that print by themselves
COMMAND = (sys.executable, "-m", "ranger_sim.harness.campaigns.group")

Request = dict[str, Any]
Result = dict[str, Any]


def process_for(request: Request) -> "subprocess.Popen[str]":
    """A process that works on a request, which it has received. Ctrl-C does not reach it, only its parent process."""
    process = subprocess.Popen(
        COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):
        process.stdin.write(json.dumps(request) + "\n")
        process.stdin.close()
    return process


def asked(request: Request) -> list[str]:
    """The keys of a request's cases."""
    return [case["key"] for case in request["cases"]] if "cases" in request else [request["key"]]


def without(request: Request, done: set[str]) -> Request | None:
    """What is left of a request; None when nothing is left."""
    if not set(asked(request)) - done:
        return None
    if "cases" not in request:
        return request
    return {**request, "cases": [case for case in request["cases"] if case["key"] not in done]}


def results_of(request: Request, start: Callable[[Request], "subprocess.Popen[str]"] = process_for) -> Iterator[Result]:
    """The results of a request, each as it arrives, in as many processes as needed. `start` starts one."""
    left: Request | None = request
    deaths = 0
    while left is not None:
        process = start(left)
        done: set[str] = set()
        assert process.stdout is not None
        with process.stdout:
            for line in process.stdout:
                if not line.endswith("\n"):
                    break  # it died while it wrote
                result = json.loads(line)
                if "refused" in result:
                    process.wait()
                    raise CampaignError(result["refused"])
                done.add(result["key"])
                yield result
        code = process.wait()
        left = without(left, done)
        if left is None:
            return
        deaths = 1 if done else deaths + 1
        if deaths == ATTEMPTS:
            first = asked(left)[0]
            if "cases" not in left:
                raise CampaignError(f"campaign: the process of the healthy walks ended with {code}, {ATTEMPTS} times")
            yield {"key": first, "outcome": "crashed", "why": f"its process ended with {code}, {ATTEMPTS} times"}
            left = without(left, {first})
            deaths = 0


class ClosedError(Exception):
    """The pool was closed: nothing is started any more."""


class LocalPool:
    """`jobs` processes of this machine at a time."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self.description = f"{jobs} process{'es' if jobs > 1 else ''} of this machine"
        self.latest: dict[int, subprocess.Popen[str]] = {}  # by thread: each has one process at a time
        self.lock = threading.Lock()
        self.closed = False

    def run(self, requests: list[Request]) -> Iterator[Result]:
        """The results of all requests, each as it arrives."""
        waiting: queue.Queue[Request] = queue.Queue()
        for request in requests:
            waiting.put(request)
        results: queue.Queue[Result | BaseException | None] = queue.Queue()

        def work() -> None:
            try:
                while True:
                    for result in results_of(waiting.get_nowait(), self._start):
                        results.put(result)
            except (queue.Empty, ClosedError):
                pass
            except BaseException as error:  # raised where the results are awaited
                results.put(error)
            results.put(None)

        workers = [threading.Thread(target=work, daemon=True) for _ in range(min(self.jobs, len(requests)))]
        for worker in workers:
            worker.start()
        left = len(workers)
        while left:
            result = results.get()
            if result is None:
                left -= 1
            elif isinstance(result, BaseException):
                self.close()
                raise result
            else:
                yield result

    def _start(self, request: Request) -> "subprocess.Popen[str]":
        """Start a process for a request, in the calling thread; ClosedError when the pool has been closed."""
        with self.lock:
            if self.closed:
                raise ClosedError
            process = self.latest[threading.get_ident()] = process_for(request)
            return process

    def close(self) -> None:
        """End what still runs; nothing is started after this."""
        with self.lock:
            self.closed = True
        for process in self.latest.values():
            process.kill()
            process.wait()


def work_of(request: Request) -> list[Result]:
    """The work of a Dask worker: all results of a request."""
    return list(results_of(request))


class DaskPool:
    """The workers of a Dask cluster: that of the scheduler at `address`, or one of `jobs` workers on this machine.

    Our own cluster is encrypted, accepts only its own certificate and is bound to the loopback address
    (dask_cluster.py). tls: Dask's names of the certificate files for `address` (`tls_ca_file`, `tls_client_cert`,
    `tls_client_key`). A worker that dies returns nothing; the scheduler gives its groups to another one. UserError when
    scheduler cannot be reached or goes away.
    """

    def __init__(self, address: str | None, jobs: int, tls: dict[str, str] | None = None) -> None:
        self.distributed: Any = importlib.import_module("distributed")  # only here: most campaigns need no Dask
        for name in DASK_LOGS:  # a lost connection is a line of ours, not a traceback in a log
            for handler in logging.getLogger(name).handlers:
                handler.setLevel(logging.CRITICAL)
        self.address = address
        self.cluster: Any = None
        if address is None:
            from ranger_sim.harness.campaigns.dask_cluster import OwnCluster

            self.cluster = OwnCluster(jobs)
            self.client: Any = self.cluster.client()
        else:
            self.client = self._client_of(address, tls or {})
        workers = len(self.client.scheduler_info(n_workers=-1)["workers"])
        self.jobs = max(1, workers)
        self.description = f"{workers} Dask worker{'s' if workers != 1 else ''}" + (f" at {address}" if address else "")

    def _client_of(self, address: str, tls: dict[str, str]) -> Any:
        """The client of a scheduler that runs already."""
        encrypted = {**tls, "require_encryption": True} if tls else {}
        try:
            security = self.distributed.Security(**encrypted)
            return self.distributed.Client(address, timeout="10s", security=security)
        except OSError as error:
            if error.filename or isinstance(error, ssl.SSLError):  # a file of the certificates, not the scheduler
                raise CampaignError(f"--scheduler {address}: TLS files: {error}") from None
            raise CampaignError(f"--scheduler {address}: no Dask scheduler there ({error})") from None
        except (TimeoutError, ValueError, RuntimeError) as error:
            raise CampaignError(f"--scheduler {address}: no Dask scheduler there ({error})") from None

    def run(self, requests: list[Request]) -> Iterator[Result]:
        """The results of all requests, those of a group together."""
        futures = [self.client.submit(work_of, request, pure=False) for request in requests]
        try:
            for done in self.distributed.as_completed(futures):
                try:
                    yield from done.result()
                except self.distributed.KilledWorker as error:
                    raise CampaignError(f"campaign: Dask's workers died repeatedly: {error}") from None
                except (self.distributed.CancelledError, self.distributed.comm.CommClosedError):
                    where = f" at {self.address}" if self.address else ""
                    raise CampaignError(
                        f"campaign: the Dask scheduler{where} ended; results are kept, and the same command continues"
                    ) from None
                done.release()
        finally:
            with contextlib.suppress(self.distributed.comm.CommClosedError):
                self.client.cancel([future for future in futures if not future.done()])

    def close(self) -> None:
        """Leave the cluster; end it when it is our own."""
        self.client.close()
        if self.cluster is not None:
            self.cluster.close()
