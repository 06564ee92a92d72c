"""Pools that do the runs: processes of this machine, or the workers of a Dask cluster.

Either way groups of runs have a process (`group`) with one thread, so that it may fork. One of this machine works on
one group after another and keeps what it has imported and walked; Dask's workers have several threads and start one for
each group. Results that a process returned before it died are kept, the rest of its group is requested again; a run at
which `ATTEMPTS` processes died is "crashed".
"""

import contextlib
import functools
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
    pass_on(request, process)
    return process


def pass_on(request: Request, process: "subprocess.Popen[str]") -> None:
    """Give a process its next request; where it has died, that shows when its results are read."""
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):
        process.stdin.write(json.dumps(request) + "\n")
        process.stdin.flush()


def end(process: "subprocess.Popen[str]") -> None:
    """End a process in any state."""
    process.kill()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
    process.wait()


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


def results_of(request: Request, start: Callable[[Request], "subprocess.Popen[str]"]) -> Iterator[Result]:
    """The results of a request, each as it arrives, in as many processes as needed.

    `start` gives the request to a process; the one that ends the request can take another one after this.
    """
    left: Request | None = request
    deaths = 0
    while left is not None:
        process = start(left)
        done: set[str] = set()
        assert process.stdout is not None
        for line in process.stdout:
            if not line.endswith("\n"):
                break  # it died while it wrote
            result = json.loads(line)
            if "ended" in result:
                return
            if "refused" in result:
                end(process)
                raise CampaignError(result["refused"])
            done.add(result["key"])
            yield result
        code = process.wait()
        end(process)
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


class Worker:
    """One process at a time, which works on one request after another. `settings`: of its latest golden run."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[str] | None = None
        self.settings: Any = None
        self.released = False
        self.thread: threading.Thread | None = None

    def start(self, request: Request) -> "subprocess.Popen[str]":
        """Give the request to its process, or to a new one where that has ended."""
        self.settings = request.get("settings")
        if self.process is not None and self.process.poll() is None:
            pass_on(request, self.process)
        else:
            self.process = process_for(request)
        return self.process

    def close(self) -> None:
        """End its process."""
        if self.process is not None:
            end(self.process)


class LocalPool:
    """`jobs` processes of this machine, kept until the pool is released or closed.

    Each has a separate thread, which starts it and lives as long: the kernel ends a process with the thread that
    started it (`die_with`).
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self.description = f"{jobs} process{'es' if jobs > 1 else ''} of this machine"
        self.workers: list[Worker] = []
        self.waiting: list[tuple[Request, queue.Queue[Any]]] = []
        self.changed = threading.Condition()
        self.closed = False

    def run(self, requests: list[Request]) -> Iterator[Result]:
        """The results of all requests, each as it arrives."""
        results: queue.Queue[Any] = queue.Queue()
        with self.changed:
            if self.closed:
                return
            self.waiting += [(request, results) for request in requests]
            while len(self.workers) < min(self.jobs, len(requests)):
                worker = Worker()
                worker.thread = threading.Thread(target=self._work, args=(worker,), daemon=True)
                worker.thread.start()
                self.workers.append(worker)
            self.changed.notify_all()
        left = len(requests)
        try:
            while left:
                result = results.get()
                if result is None:  # the end of a request
                    left -= 1
                elif isinstance(result, BaseException):
                    self.close()
                    raise result
                else:
                    yield result
        finally:
            with self.changed:
                self.waiting = [each for each in self.waiting if each[1] is not results]

    def _work(self, worker: Worker) -> None:
        """One request after another, until the worker is released."""
        while (taken := self._next(worker)) is not None:
            request, results = taken
            try:
                for result in results_of(request, functools.partial(self._start, worker)):
                    results.put(result)
            except ClosedError:
                pass
            except BaseException as error:  # raised where the results are awaited
                results.put(error)
            results.put(None)
        worker.close()

    def _next(self, worker: Worker) -> "tuple[Request, queue.Queue[Any]] | None":
        """Wait for a request, rather one whose golden run the worker knows; None: it has been released."""
        with self.changed:
            while not self.waiting and not worker.released:
                self.changed.wait()
            if worker.released:
                return None
            same = [at for at, each in enumerate(self.waiting) if each[0].get("settings") == worker.settings]
            return self.waiting.pop(same[0] if same else 0)

    def _start(self, worker: Worker, request: Request) -> "subprocess.Popen[str]":
        """Give a request to a worker's process, in its thread; ClosedError when the pool has been closed."""
        with self.changed:
            if self.closed or worker.released:
                raise ClosedError
            return worker.start(request)

    def close(self) -> None:
        """End what still runs; nothing is started after this."""
        with self.changed:
            self.closed = True
            for _, results in self.waiting:
                results.put(None)
            self.waiting.clear()
        self.release()

    def release(self) -> None:
        """End the processes; a later `run` starts new ones. For a pool whose requests have all been answered."""
        with self.changed:
            ended, self.workers = self.workers, []
            for worker in ended:
                worker.released = True
                if worker.process is not None:
                    worker.process.kill()
            self.changed.notify_all()
        for worker in ended:  # each closes its pipes
            if worker.thread is not None and worker.thread is not threading.current_thread():
                worker.thread.join()


def work_of(request: Request) -> list[Result]:
    """The work of a Dask worker: all results of a request."""
    with contextlib.closing(Worker()) as worker:
        return list(results_of(request, worker.start))


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

    def release(self) -> None:
        """Nothing: a cluster's workers keep no process."""

    def close(self) -> None:
        """Leave the cluster; end it when it is our own."""
        self.client.close()
        if self.cluster is not None:
            self.cluster.close()
