"""The only file that reads the wall clock or sleeps; everything else runs on virtual time."""

import datetime
import time


def monotonic_s() -> float:
    """Seconds of a monotonic clock; only differences are meaningful."""
    return time.perf_counter()


def epoch_ns() -> int:
    """Nanoseconds since 1970 in UTC, for the stamps of frames sent to other CAN programs."""
    return time.time_ns()


def process_cpu_s() -> float:
    """Seconds of processor time this process has used (user and system)."""
    return time.process_time()


def today_iso() -> str:
    """Today's date in UTC as YYYY-MM-DD, for benchmark records only."""
    return datetime.datetime.now(datetime.UTC).date().isoformat()


def sleep_s(seconds: float) -> None:
    """Sleep for about this long."""
    time.sleep(seconds)


def monotonic_ns() -> int:
    """Monotonic clock shared by all processes of the machine, in ns; only differences are meaningful."""
    return time.monotonic_ns()
