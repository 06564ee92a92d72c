"""Ctrl-C, and the signals by which a system ends programs or a terminal hangs up: they count as Ctrl-C."""

import _thread
import contextlib
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

from ranger_sim.foundation import wallclock

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
EXIT_INTERRUPTED = 130
AGAIN_AFTER_S = 0.01  # long enough that the callback that lost an interrupt has returned


def end_in_order() -> None:
    """From now on the first of them raises KeyboardInterrupt, so that files and processes are closed.

    The second ends this process at once, without a message.
    """
    received: list[int] = []
    others = sys.unraisablehook

    def note(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        end_at_once()
        # a coroutine that no loop had taken yet
        warnings.filterwarnings("ignore", "coroutine .* was never awaited", RuntimeWarning)
        raise KeyboardInterrupt

    def unraisable(failure: Any) -> None:
        if received and failure.exc_type is KeyboardInterrupt and not sys.is_finalizing():
            # it was raised in a callback of the garbage collector or a finalizer, where Python drops it
            _set(note)
            _thread.start_new_thread(_again, (received[-1],))
        elif not received:  # else an object that was half made when the signal arrived (an event loop)
            others(failure)

    sys.unraisablehook = unraisable
    _set(note)


def _again(number: int) -> None:
    """Raise in the main thread what the signal raised there; in a separate thread."""
    wallclock.sleep_s(AGAIN_AFTER_S)
    if hasattr(signal, "pthread_kill"):  # also ends a wait, which interrupt_main does not
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        _thread.interrupt_main(signal.Signals(number))


def end_at_once() -> None:
    """From now on each of them ends this process, without a message."""
    _set(signal.SIG_DFL)


def count_as_handled() -> None:
    """Keep the exit code of a program whose KeyboardInterrupt was caught.

    CPython marks one that ends exec(TEXT) (dataclasses and named tuples run text while a module loads) as unhandled,
    and `python -m` then ends by SIGINT instead of with the exit code. The next text that runs removes the mark.
    """
    exec("")


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
