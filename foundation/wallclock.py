"""The only file that reads the wall clock or sleeps; everything else runs on virtual time."""

import datetime
import time


def monotonic_s() -> float:
    """Seconds of a clock that never runs backwards; only differences mean anything."""
    return time.perf_counter()


def process_cpu_s() -> float:
    """Seconds of processor time this process has used (user and system)."""
    return time.process_time()


def today_iso() -> str:
    """Today's date in UTC as YYYY-MM-DD, for benchmark records only."""
    return datetime.datetime.now(datetime.UTC).date().isoformat()


def sleep_s(seconds: float) -> None:
    """Give the processor away for about this long."""
    time.sleep(seconds)
