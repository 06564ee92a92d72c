"""Results on disk: one line of JSON each, permanent before the next is requested.

A killed campaign loses only the runs that were in progress. A line that was being written when the
machine stopped is cut off; a result that comes twice (a worker was thought dead) counts once; two campaigns cannot
write one file at a time.
"""

import json
import os
import pathlib
from typing import Any

from ranger_sim.foundation import systems
from ranger_sim.foundation.user_error import CampaignError


class Store:
    """The file `path`, opened for one writer. `results`: {key: result}; `repeated`: results that arrived again."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.results: dict[str, dict[str, Any]] = {}
        self.repeated = 0
        self.file = open(path, "a+b")  # noqa: SIM115
        try:
            systems.lock(self.file.fileno())
        except OSError:
            self.file.close()
            raise CampaignError(f"{path}: another campaign is writing here") from None
        self._read()

    def _read(self) -> None:
        self.file.seek(0)
        whole = 0
        for number, line in enumerate(self.file, start=1):
            if not line.endswith(b"\n"):
                break  # the machine stopped while it was written
            try:
                result = json.loads(line)
                self.results[result["key"]] = result
            except (ValueError, KeyError, TypeError):
                self.file.close()
                raise CampaignError(f"{self.path}:{number}: this is not a result; move the file away") from None
            whole += len(line)
        self.file.truncate(whole)
        self.file.seek(0, os.SEEK_END)

    def add(self, result: dict[str, Any]) -> bool:
        """Store a result; False when it exists already. It is on disk when this returns."""
        if result["key"] in self.results:
            self.repeated += 1
            return False
        self.file.write(json.dumps(result, sort_keys=True).encode() + b"\n")
        self.file.flush()
        os.fsync(self.file.fileno())
        self.results[result["key"]] = result
        return True

    def forget(self, key: str) -> None:
        """Forget a result that is to be computed again; in the file the later one counts."""
        self.results.pop(key, None)

    def close(self) -> None:
        """Release the file for another writer."""
        self.file.close()
