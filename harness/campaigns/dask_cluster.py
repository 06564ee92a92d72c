"""A Dask cluster of this machine's processes for one campaign: TLS, the loopback address, no web pages.

A client of a Dask scheduler can run code as the scheduler's user. Each part of this cluster therefore accepts only
connections with the cluster's own certificate, which is made for one campaign. The HTTP servers that Dask starts in
every part (port 8787, the dashboard) require no certificate, so they are left out.
"""

import contextlib
import logging
import signal
import tempfile
from collections.abc import Iterator
from multiprocessing import resource_tracker
from typing import Any

import cryptography as _  # noqa: F401  (Dask imports it late; its absence is to be named before anything starts)
import distributed

LOOPBACK = "127.0.0.1"


class NoPages:
    """A part of the cluster that starts no HTTP server."""

    def start_http_server(self, *_arguments: Any, **_settings: Any) -> None:
        """Start no HTTP server."""


class Scheduler(NoPages, distributed.Scheduler):
    """The scheduler, without pages."""


class Worker(NoPages, distributed.Worker):
    """A worker, without pages."""


@contextlib.contextmanager
def without_interrupts() -> Iterator[None]:
    """Threads that start within it, and the processes that they ever start, do not see Ctrl-C or the terminal's end.

    A terminal sends both to every process of the command; the workers are ended by this one, and would print where
    they were.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which Dask's first process would start, and which unblocks them
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class OwnCluster:
    """A scheduler in this process and `jobs` workers of one thread in separate processes."""

    def __init__(self, jobs: int) -> None:
        security: Any = distributed.Security.temporary()  # type: ignore[no-untyped-call]
        # spilled data are unpickled: in a folder that only this user can write
        self.folder = tempfile.TemporaryDirectory(prefix="ranger-sim-dask-")
        common = {"host": LOOPBACK, "protocol": "tls://", "security": security}
        worker = {
            "cls": distributed.Nanny,
            "options": {
                **common,
                "worker_class": Worker,
                "nthreads": 1,
                "local_directory": self.folder.name,
                "silence_logs": logging.CRITICAL,
            },
        }
        with without_interrupts():
            self.cluster: Any = distributed.SpecCluster(  # type: ignore[no-untyped-call]
                workers={number: worker for number in range(jobs)},
                scheduler={"cls": Scheduler, "options": {**common, "port": 0, "dashboard": False}},
                security=security,
            )

    def client(self) -> Any:
        """A client with the cluster's certificate."""
        return distributed.Client(self.cluster, timeout="10s")  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """End all processes."""
        self.cluster.close()
        self.folder.cleanup()
