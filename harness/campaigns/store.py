"""Results on disk: one line of JSON each, there for good before the next is asked for.

A campaign that is killed has lost nothing but the runs that were under way. A line that was being written when the
machine stopped is cut off; a result that comes twice (a worker was thought dead) counts once; two campaigns cannot
write one file at a time.
"""

import fcntl
import json
import os
import pathlib
from typing import Any

from ranger_sim.foundation.user_error import UserError


class Store:
    """The file `path`, opened for one writer. `results`: {key: result}; `repeated`: results that came once more."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.results: dict[str, dict[str, Any]] = {}
        self.repeated = 0
        self.file = open(path, "a+b")  # noqa: SIM115
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self.file.close()
            raise UserError(f"{path}: another campaign is writing here") from None
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
                raise UserError(f"{self.path}:{number}: this is no result; move the file away") from None
            whole += len(line)
        self.file.truncate(whole)
        self.file.seek(0, os.SEEK_END)

    def add(self, result: dict[str, Any]) -> bool:
        """Keep a result; False when it is there already. It is on the disk when this returns."""
        if result["key"] in self.results:
            self.repeated += 1
            return False
        self.file.write(json.dumps(result, sort_keys=True).encode() + b"\n")
        self.file.flush()
        os.fsync(self.file.fileno())
        self.results[result["key"]] = result
        return True

    def forget(self, key: str) -> None:
        """A result that is to be had anew; in the file the later one counts."""
        self.results.pop(key, None)

    def close(self) -> None:
        """Let another one write."""
        self.file.close()
