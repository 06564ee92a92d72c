"""The golden run of a live robot: a forked process that is the robot as it was before the fault was armed.

It sleeps until a proof is requested, then walks on without the fault to the robot's present time and returns its
record. So it is right also when the robot was changed before (a function replaced, another fault); it does not get
input from outside after the fault was armed (a key, a parameter, a second fault), which then shows as a
difference.
"""

import contextlib
import os
import pickle
import signal
import sys
from typing import Any

from ranger_sim.foundation import systems
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.branching import fork
from ranger_sim.harness.faults.evidence import Evidence, Record
from ranger_sim.harness.faults.fault import Fault
from ranger_sim.harness.stop_rule import StopRule

LENGTH_BYTES = 8


class Twin:
    """Twin of `robot`, a `ranger.robot.Ranger`, from now on. UserError for one not wholly in this process."""

    def __init__(self, robot: Any) -> None:
        if robot.polled:
            raise FaultError("proof of a fault: something outside takes part in this run, so it has no golden twin")
        if not systems.can_fork():
            raise FaultError(
                f"proof of a fault: its golden run needs a system that can fork (Linux, macOS), this is {sys.platform}"
            )
        self.evidence = Evidence(robot)
        self.robot = robot
        self.closed = False
        asked, self.asking = os.pipe()
        self.answers, answering = os.pipe()
        self.process = fork()
        if self.process == 0:
            os.close(self.asking)
            os.close(self.answers)
            self._be_the_twin(asked, answering)
        os.close(asked)
        os.close(answering)

    def records(self) -> tuple[Record, Record]:
        """(golden, faulty) until now."""
        if self.closed:
            raise FaultError("proof of a fault: the robot was closed before it was asked for")
        faulty = self.evidence.record()
        with contextlib.suppress(BrokenPipeError):
            os.write(self.asking, faulty.end_ns.to_bytes(LENGTH_BYTES, "little"))
        length = int.from_bytes(_read(self.answers, LENGTH_BYTES), "little")
        golden: Record = pickle.loads(_read(self.answers, length))
        return golden, faulty

    def close(self) -> None:
        """End the twin's process."""
        if not self.closed:
            self.closed = True
            os.close(self.asking)
            os.close(self.answers)
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process, signal.SIGKILL)
            os.waitpid(self.process, 0)

    def _be_the_twin(self, asked: int, answering: int) -> None:
        """Walk to each requested time, and leave without any of the parent's clean-up."""
        try:
            robot, evidence = self.robot, self.evidence
            # other watchers of the robot write into the parent's files; faults that were armed before stay
            robot.loop.watchers[:] = [each for each in robot.loop.watchers if isinstance(each, Fault)]
            robot.loop.watchers.append(evidence.watch)
            evidence.alone()
            while wanted := os.read(asked, LENGTH_BYTES):
                until_s = (int.from_bytes(wanted, "little") - robot.start_ns) * 1e-9
                while robot.time_s < until_s and not robot.ended:
                    robot.run(StopRule(time_s=until_s), until_s)
                answer = pickle.dumps(evidence.record(), protocol=pickle.HIGHEST_PROTOCOL)
                _write(answering, len(answer).to_bytes(LENGTH_BYTES, "little") + answer)
        finally:
            os._exit(0)


def _read(pipe: int, length: int) -> bytes:
    """Read `length` bytes; UserError when the other end is gone."""
    parts = bytearray()
    while len(parts) < length:
        part = os.read(pipe, min(1 << 20, length - len(parts)))
        if not part:
            raise FaultError("proof of a fault: the process of the golden run has died")
        parts += part
    return bytes(parts)


def _write(pipe: int, content: bytes) -> None:
    """Write all of `content`."""
    view = memoryview(content)
    while view:
        view = view[os.write(pipe, view) :]
