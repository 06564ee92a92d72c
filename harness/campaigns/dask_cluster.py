"""A Dask cluster of this machine's processes for one campaign: TLS, the loopback address, no web pages.

A client of a Dask scheduler can run code as the scheduler's user. Each part of this cluster therefore accepts only
connections with the cluster's own certificate, which is made for one campaign. The HTTP servers that Dask starts in
every part (port 8787, the dashboard) require no certificate, so they are left out.
"""

import logging
import tempfile
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
