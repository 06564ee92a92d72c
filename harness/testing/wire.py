"""Timing on the wire: how regularly frames come, and the time from a cause to its effect, as assertions.

It works on every backend, because it needs only frames with the times at which receivers had them. On real
hardware it is the slot test, together with the EXECUTION_TIME variables that every board publishes.

    ranger.wire("can1").assert_period("MCH_ANGLE", "2 ms", jitter="100 us")
    ranger.wire("can1").assert_latency("MCH_ANGLE", "MCH_COMMAND_CURRENT", at_most="5 ms")
    ranger.wire("can1").assert_execution_time("MCH", at_most="450 us")
"""

import bisect
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from ranger_sim.foundation.quantities import Duration, duration_ns, duration_text, given_text
from ranger_sim.harness.testing.figures import Observed
from ranger_sim.harness.testing.frames import WINDOW_S, Frame, FrameKeeper

SHOWN = 3  # offending places in a message


@dataclasses.dataclass(frozen=True)
class Intervals:
    """Times between frames, or from causes to effects, all in ns. `pairs`: the frames of each, in their order."""

    what: str
    pairs: Sequence[tuple[Frame, Frame]]

    @property
    def each(self) -> list[int]:
        """Every interval."""
        return [later.time_ns - earlier.time_ns for earlier, later in self.pairs]

    @property
    def count(self) -> int:
        """The number of intervals."""
        return len(self.pairs)

    @property
    def min(self) -> int:
        """The shortest."""
        return min(self.each)

    @property
    def max(self) -> int:
        """The longest."""
        return max(self.each)

    @property
    def mean(self) -> float:
        """Their mean."""
        return sum(self.each) / self.count

    @property
    def jitter(self) -> float:
        """The largest distance of an interval from the mean."""
        return max(self.max - self.mean, self.mean - self.min)

    def text(self) -> str:
        """The intervals in one line."""
        return (
            f"{self.count} intervals, least {duration_text(self.min)}, mean {duration_text(self.mean)}, "
            f"most {duration_text(self.max)}"
        )


class Wire:
    """Frames on bus `bus` from `since_s` on; None: all that are kept (the last 20 s; frames.py).

    UserError where no frames can be kept: since a time before the keeping began, or in a machine that passed
    time before the first request. Assertions are recorded in `observed.figures`, for reports.
    """

    def __init__(self, observed: Observed, bus: str, since_s: float | None = None, now_s: float = 0.0) -> None:
        self.observed = observed
        self.bus = bus
        self.since_s = since_s
        self.now_s = now_s
        self.keeper = observed.keeper
        self.keeper.frames(bus, set())  # an unknown bus is reported now

    def frames(self, *names: str | int) -> list[Frame]:
        """Frames of these variables (or identifiers), in their order; without a name, all."""
        wanted = {self.keeper.names.identifier(name) for name in names} if names else None
        since_ns = None if self.since_s is None else round(self.since_s * 1e9)
        self.keeper.check(self.bus, since_ns)
        return list(self.keeper.frames(self.bus, wanted, since_ns or 0))

    # --- periods ------------------------------------------------------------------------------------------

    def period(self, name: str | int) -> Intervals:
        """Between frames of a variable. AssertionError with fewer than two of them."""
        __tracebackhide__ = True
        frames = self.frames(name)
        if len(frames) < 2:
            self._fail(f"{name} on {self.bus}: {len(frames)} frames, a period needs two", frames)
        return Intervals(f"{name} on {self.bus}", list(zip(frames, frames[1:], strict=False)))

    def assert_period(self, name: str | int, period: Duration, jitter: Duration = "0 us") -> Intervals:
        """Assert that every interval between frames of a variable is `period` plus or minus `jitter`."""
        __tracebackhide__ = True
        wanted, allowed = duration_ns(period, "period"), duration_ns(jitter, "jitter")
        found = self.period(name)
        limit = f"{given_text(period)} +- {given_text(jitter)}"
        self.observed.note(f"period of {found.what}", found.text(), limit)
        self._hold(found, limit, lambda each: abs(each - wanted) <= allowed)
        return found

    # --- from cause to effect -----------------------------------------------------------------------------

    def latency(
        self,
        cause: str | int,
        effect: str | int,
        cause_if: Callable[[Frame], bool] | None = None,
        effect_if: Callable[[Frame], bool] | None = None,
    ) -> Intervals:
        """From each frame of `cause` to the first of `effect` after it. AssertionError when none has an effect.

        `can3:MCFO_HS` is a frame on another bus. `cause_if`, `effect_if`: only frames for which it is true count. A
        cause at the end of what was recorded may have no effect yet: it is left out.
        """
        __tracebackhide__ = True
        causes = [each for each in self._elsewhere(cause) if cause_if is None or cause_if(each)]
        effects = [each for each in self._elsewhere(effect) if effect_if is None or effect_if(each)]
        times = [each.time_ns for each in effects]
        pairs = []
        for each in causes:
            place = bisect.bisect_right(times, each.time_ns)
            if place < len(effects):
                pairs.append((each, effects[place]))
        if not pairs:
            counts = f"{len(causes)} frames of {cause}, {len(effects)} of {effect}"
            self._fail(f"{cause} to {effect} on {self.bus}: no effect after any cause ({counts})", causes[-1:])
        return Intervals(f"{cause} to {effect} on {self.bus}", pairs)

    def assert_latency(self, cause: str | int, effect: str | int, at_most: Duration, **conditions: Any) -> Intervals:
        """Assert that one of `effect` follows each frame of `cause` within `at_most`; `conditions` as of `latency`.

        A cause without an effect is a miss if more than `at_most` has passed since.
        """
        __tracebackhide__ = True
        allowed = duration_ns(at_most, "at_most")
        found = self.latency(cause, effect, **conditions)
        self.observed.note(f"latency of {found.what}", found.text(), given_text(at_most))
        self._hold(found, f"at most {given_text(at_most)}", lambda each: each <= allowed)
        answered = found.pairs[-1][0].time_ns
        condition = conditions.get("cause_if")
        for each in self._elsewhere(cause):
            waited = round(self.now_s * 1e9) - each.time_ns
            if each.time_ns > answered and waited > allowed and (condition is None or condition(each)):
                why = f"no effect for {duration_text(waited)}, allowed is at most {given_text(at_most)}"
                self._fail(f"{found.what}: {why}", [each])
        return found

    # --- values -------------------------------------------------------------------------------------------

    def assert_execution_time(self, board: str, at_most: Duration) -> float:
        """Assert that the longest slot that `board` measured and sent is not longer; returns it in s."""
        __tracebackhide__ = True
        allowed = duration_ns(at_most, "at_most")
        known = self.keeper.names.ids
        names = [f"{board}_EXECUTION_TIME", *(each for each in [f"{board}_MAX_EXECUTION_TIME"] if each in known)]
        frames = self.frames(*names)
        if not frames:
            self._fail(f"{' and '.join(names)} on {self.bus}: no frame", [])
        longest = max(frames, key=lambda each: each.value)
        measured = duration_text(longest.value * 1e9)
        self.observed.note(f"execution time of {board}", measured, given_text(at_most))
        if longest.value * 1e9 > allowed:
            self._fail(f"{board} measured a slot of {measured}, allowed is at most {given_text(at_most)}", [longest])
        return longest.value

    # --- inside -------------------------------------------------------------------------------------------

    def _elsewhere(self, name: str | int) -> list[Frame]:
        """Frames of `can3:NAME`, or of a name on this bus."""
        bus, colon, rest = name.partition(":") if isinstance(name, str) else ("", "", "")
        if not colon:
            return self.frames(name)
        return Wire(self.observed, bus, self.since_s, self.now_s).frames(rest)

    def _hold(self, found: Intervals, limit: str, holds: Callable[[int], bool]) -> None:
        """AssertionError with the first offending frames when an interval does not hold."""
        __tracebackhide__ = True
        bad = [pair for pair, each in zip(found.pairs, found.each, strict=True) if not holds(each)]
        if not bad:
            return
        worst = max(bad, key=lambda pair: pair[1].time_ns - pair[0].time_ns)
        shown = bad[:SHOWN] if worst in bad[:SHOWN] else [*bad[: SHOWN - 1], worst]
        lines = [f"{found.what}: allowed is {limit}, {len(bad)} of {found.count} are outside ({found.text()})"]
        for earlier, later in shown:
            lines.append(f"  {earlier.text()}")
            lines.append(f"  {later.text()}   after {duration_text(later.time_ns - earlier.time_ns)}")
        raise AssertionError("\n".join(lines))

    @staticmethod
    def _fail(text: str, frames: Sequence[Frame]) -> NoReturn:
        """AssertionError with these frames."""
        __tracebackhide__ = True
        raise AssertionError("\n".join([text, *(f"  {each.text()}" for each in frames)]))


def observe(robot: Any) -> Observed:
    """Records kept with `robot`; its frames are kept from the first call on, before it those of its log."""
    if robot.observed is None:
        streams = {bus.name: stream for bus, stream in zip(robot.buses, robot.recorder.frames, strict=True)}
        now_ns, log = robot.loop.time, robot.logbook
        late = now_ns > robot.start_ns
        from_ns = max(robot.start_ns, now_ns - min(round(WINDOW_S * 1e9), log.reach_ns)) if late else 0
        keeper = FrameKeeper(streams, robot.names, from_ns=0 if from_ns == robot.start_ns else from_ns)
        for number, bus in enumerate(streams, start=1):
            for rows in log.kept(f"can{number}") if late else ():
                keeper.add_earlier(bus, rows[rows[:, 0] >= from_ns].tobytes())
        robot.observed = Observed(keeper)
    return robot.observed


def wire_of(robot: Any, bus: str, since_s: float | None = None) -> Wire:
    """The frames on a bus of the robot."""
    start_s = robot.start_ns * 1e-9
    return Wire(observe(robot), bus, None if since_s is None else since_s + start_s, robot.loop.time * 1e-9)
