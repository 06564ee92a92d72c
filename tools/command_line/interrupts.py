"""Ctrl-C, and the signals by which a system ends programs or a terminal hangs up: they count as Ctrl-C."""

import contextlib
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
EXIT_INTERRUPTED = 130


def end_in_order() -> None:
    """From now on the first of them raises KeyboardInterrupt, so that files and processes are closed.

    The second ends this process at once, without a message.
    """

    def note(_number: int, _frame: FrameType | None) -> None:
        end_at_once()
        # an object that was half made when the signal arrived fails when it is deleted (an event loop), or warns
        # (a coroutine that no loop had taken yet)
        sys.unraisablehook = lambda _failure: None
        warnings.filterwarnings("ignore", "coroutine .* was never awaited", RuntimeWarning)
        raise KeyboardInterrupt

    _set(note)


def end_at_once() -> None:
    """From now on each of them ends this process, without a message."""
    _set(signal.SIG_DFL)


def leave_to_parent() -> None:
    """In a process that its parent ends: from now on ignore all of them."""
    _set(signal.SIG_IGN)


@contextlib.contextmanager
def noted() -> Iterator[list[bool]]:
    """Inside, the first of them only fills the list, so that the files are finished; the second interrupts."""
    interrupted: list[bool] = []

    def note(_number: int, _frame: FrameType | None) -> None:
        if interrupted:
            raise KeyboardInterrupt
        interrupted.append(True)

    previous = _set(note)
    try:
        yield interrupted
    finally:
        for each, handler in previous.items():
            signal.signal(each, handler)


def _set(handler: Callable[[int, FrameType | None], Any] | signal.Handlers) -> dict[signal.Signals, Any]:
    """Set a handler for those that are not ignored (nohup ignores one); returns the previous handlers."""
    wanted = [each for each in ENDING if signal.getsignal(each) is not signal.SIG_IGN]
    return {each: signal.signal(each, handler) for each in wanted}
