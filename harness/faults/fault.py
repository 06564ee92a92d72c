"""One fault: what every kind of fault has, from arming until its place is back to normal.

A fault sits at a physical place: on a wire, in a sensor, a winding, a bus, the floor. It never writes what firmware
keeps. Its life, each stamp in ns of virtual time, -1 for not yet:

    armed_ns        it waits for its start condition
    activated_ns    it began to work on its place
    acted_ns        the value at its place differed for the first time from what it would be without the fault
    ended_ns        its end condition came true; from here on it does nothing
    cleared_ns      its place showed again what it shows without a fault

A fault that never acted proves nothing, whatever the robot did.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

from ranger_sim.foundation.quantities import nanoseconds
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.waiting import Condition, Wanted


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A number that a mode takes. `source`: where default and limits come from, or why we chose them.

    default: NaN for none; `source` then describes the effect, such as keeping the present level.
    """

    name: str
    unit: str
    default: float
    low: float
    high: float
    meaning: str
    source: str

    def checked(self, value: Any, where: str) -> float:
        """`value` as a number within the limits, or a UserError naming `where`."""
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = float("nan")
        if not self.low <= number <= self.high:
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise FaultError(
                f"{where}: {self.name} is {value!r}, allowed are {self.low:g} to {self.high:g}{unit}".rstrip()
            )
        return number


@dataclasses.dataclass(frozen=True)
class WholeNumber(Parameter):
    """A parameter that counts or numbers something."""

    def checked(self, value: Any, where: str) -> float:
        """`value` as a whole number within the limits, or a UserError naming `where`."""
        number = Parameter.checked(self, value, where)
        if not number.is_integer():
            raise FaultError(f"{where}: {self.name} is {value!r}, a whole number is expected")
        return number


@dataclasses.dataclass(frozen=True)
class Place:
    """Where a fault can sit. `name` as typed ("MCH.joint_encoder"); `kind` decides which modes are possible.

    `details`: what the modes of this kind need in order to find it on a robot, from harness/wiring/ranger.py.
    """

    name: str
    kind: str
    what: str
    details: Mapping[str, Any] = dataclasses.field(default_factory=dict)


class Lasting(Condition):
    """The end of a fault a given time after its start, as "+50 ms"."""

    def __init__(self, text: str) -> None:
        Condition.__init__(self, text)
        self.length_ns = nanoseconds(text.removeprefix("+").strip(), "fault: its length")
        self.since_ns = -1

    def met(self) -> bool:
        return bool(self.since_ns >= 0 and self.robot.loop.time - self.since_ns >= self.length_ns)

    def nearest(self) -> str:
        return "it has not begun" if self.since_ns < 0 else "it has not lasted so long"


def end_condition(wanted: Wanted | None, condition: Callable[[Wanted], Condition]) -> Condition | None:
    """The condition that ends a fault: any that `condition` can make, or a length as "+50 ms"; None: none."""
    if isinstance(wanted, str) and wanted.strip().startswith("+"):
        return Lasting(" ".join(wanted.split()))
    return None if wanted is None else condition(wanted)


class Fault(StepWatch):
    """A mode at a place. Subclasses are modes: they define their names and effects.

    `mode`, `kinds` of places, `meaning` (one sentence), `parameters`, `unit` of the difference at the place.
    `needs`: what a place must have for it, named where the fault is refused ("a serial word").
    `permanent`: what ends its consequence ("a power cycle"), empty when the place is clear as soon as the fault ends.
    """

    mode: ClassVar[str]
    kinds: ClassVar[tuple[str, ...]]
    meaning: ClassVar[str]
    needs: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    unit: str = ""
    permanent: str = ""
    # The board whose processor or converters it acts inside, and the one that it removes and restores; "": none.
    inside: str = ""
    restarts: str = ""

    def __init__(self, place: Place, start: Condition | None, end: Condition | None, values: Mapping[str, Any]) -> None:
        StepWatch.__init__(self)
        self.place = place
        self.start = start
        self.end = end
        self.values = dict(values)
        self.robot: Any = None
        self.armed_ns = self.activated_ns = self.acted_ns = self.ended_ns = self.cleared_ns = -1
        self.acted_count = 0
        self.largest_difference = 0.0
        self.stop_wanted = False
        self.gives_way = False  # where another fault still works it never begins; otherwise the conflict ends the run
        self.gave_way_ns = -1
        self.gave_way_to = ""  # the fault that had its place when it was due
        self.twin: Any = None  # harness.faults.twin.Twin: of a fault that is to be proven

    @classmethod
    def asked(
        cls,
        place: Place,
        start: Wanted | None,
        end: Wanted | None,
        parameters: Mapping[str, Any],
        condition: Callable[[Wanted], Condition],
    ) -> Self:
        """Make an unarmed one; `condition` makes the machine's conditions. UserError for a parameter or value
        that the mode does not have.
        """
        known = {parameter.name: parameter for parameter in cls.parameters}
        values = {name: parameter.default for name, parameter in known.items()}
        where = f"fault {place.name}:{cls.mode}"
        for name, value in parameters.items():
            if name not in known:
                raise FaultError(f"{where}: there is no parameter {name!r}, but {', '.join(known) or 'none at all'}")
            values[name] = known[name].checked(value, where)
        return cls(place, None if start is None else condition(start), end_condition(end, condition), values)

    # --- what a mode defines -----------------------------------------------------------------------------------

    def connect(self) -> None:
        """Find, once, when it is armed, the place on `self.robot`. UserError when it cannot act there."""

    def claims(self) -> tuple[str, ...]:
        """What it claims while it works: its place, or finer where several can act at one place together."""
        return (self.place.name,)

    def begin(self, now_ns: int) -> None:
        """Begin to work."""

    def before(self, now_ns: int) -> None:
        """Act before each step of the plant while it works."""

    def after(self, start_ns: int, end_ns: int) -> None:
        """Act, while it works, when a step's sensors are known and no board has read them."""

    def finish(self, now_ns: int) -> None:
        """Stop working: restore all that it changed at its place."""

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether the place shows what it shows without a fault; called after its end, once per step until true."""
        return True

    # --- life cycle ------------------------------------------------------------------------------------------

    @property
    def acted(self) -> bool:
        """The value at the place differed at least once from the unfaulted one."""
        return self.acted_count > 0

    @property
    def active(self) -> bool:
        """It works on its place now."""
        return self.activated_ns >= 0 > self.ended_ns

    @property
    def over(self) -> bool:
        """It is finished: its place is clear, or it was stopped before it began."""
        return self.cleared_ns >= 0 or (self.stop_wanted and self.activated_ns < 0)

    def arm(self, robot: Any) -> None:
        """Wait on `robot` for its start; without a start condition it begins with the next step."""
        self.robot = robot
        self.random = RandomStream(robot.seed, f"fault {len(robot.faults)} {self.place.name} {self.mode}")
        self.connect()
        if self.gives_way and self.start is None and (taken := self._in_its_way()):
            raise FaultError(f"fault {self.text()}: {taken}; one fault at a time")
        for each in (self.start, self.end):
            if each is not None:
                each.begin(robot)
        self.armed_ns = robot.loop.time
        robot.loop.watchers.append(self)

    def stop(self) -> None:
        """End it with the next step of the plant, regardless of its end condition; an unstarted fault never begins."""
        self.stop_wanted = True

    def note(self, time_ns: int, difference: float) -> None:
        """Record, for modes, that the place at `time_ns` differed by `difference` (`unit`) from the unfaulted one."""
        if self.acted_count == 0:
            self.acted_ns = time_ns
        self.acted_count += 1
        if abs(difference) > abs(self.largest_difference):
            self.largest_difference = difference

    def before_step(self, now_ns: int) -> None:
        if self.ended_ns >= 0:
            return
        if self.activated_ns < 0:
            if self.stop_wanted:
                self.robot.loop.watchers.remove(self)
                return
            if self.start is None or self.start.met():
                if taken := self._in_its_way():
                    if not self.gives_way:
                        raise FaultError(f"fault {self.text()}: {taken}; one fault at a time")
                    self.gave_way_ns, self.gave_way_to = now_ns, taken
                    self.stop()
                    self.robot.loop.watchers.remove(self)
                    return
                self.activated_ns = now_ns
                if isinstance(self.end, Lasting):
                    self.end.since_ns = now_ns
                self.begin(now_ns)
            else:
                return
        end = self.end
        if self.stop_wanted or (end is not None and end.met()):
            self.ended_ns = now_ns
            self.finish(now_ns)
        else:
            self.before(now_ns)

    def _in_its_way(self) -> str:
        """The uncleared fault that has one of its claims, or "": two could be neither proved nor undone."""
        for other in self.robot.faults:
            if other is self or other.activated_ns < 0 or other.cleared_ns >= 0:
                continue
            common = [each for each in self.claims() if each in other.claims()]
            if other.restarts and other.restarts in (self.inside, self.restarts):
                common.append(f"{other.restarts}, which is not back yet")
            if self.restarts and self.restarts == other.inside and other.active:  # a restart may cure an ended fault
                common.append(f"{other.inside}, which would be taken away under it")
            if common:
                return f"{other.text()} still works at {common[0]}"
        return ""

    def after_step(self, start_ns: int, end_ns: int) -> None:
        if self.activated_ns < 0:
            return
        if self.ended_ns < 0:
            self.after(start_ns, end_ns)
        elif self.cleared_ns < 0 and self.is_clear(start_ns, end_ns):
            self.cleared_ns = end_ns
            self.robot.loop.watchers.remove(self)

    # --- what it did, compared with the golden run -----------------------------------------------------------------

    def proof(self) -> Any:
        """A `harness.faults.proof.Proof` until now. UserError for a fault that was injected without `proof=True`.

        What the golden run raised since the fault was armed is normal. A detection by rate alone (`rate`) can therefore
        be a false alarm: one walk does not show how noisy another healthy one is; a campaign walks several.
        Faults that share one golden run, as those of `walk --proof`, are compared with it together, from the first
        one's activation on: the comparison does not attribute a difference to one of them.
        """
        if self.twin is None:
            raise FaultError(f"fault {self.text()}: it has no golden run; Ranger.inject(..., proof=True) gives it one")
        from ranger_sim.harness.faults import proof  # only here: it imports numpy for the comparison

        golden, faulty = self.twin.records()
        together = self._together()
        began_ns = min((each.activated_ns for each in together), default=self.activated_ns)
        return proof.prove(golden, faulty, began_ns, any(each.acted for each in together))

    def _together(self) -> list["Fault"]:
        """The faults that have begun and share this one's golden run."""
        return [each for each in self.robot.faults if each.twin is self.twin and each.activated_ns >= 0]

    @property
    def detected(self) -> Any:
        """The first error that reveals it (`code`, `board`), None: none does. As `proof`."""
        return self.proof().detected

    @property
    def detection_ms(self) -> float | None:
        """Activation to the first error that reveals it, ms. As `proof`."""
        found: float | None = self.proof().detection_ms
        return found

    @property
    def reaction(self) -> Any:
        """The first machine (`machine`) that is in another state (`state`) than golden (`instead_of`). As `proof`."""
        return self.proof().reaction

    def text(self) -> str:
        """As typed after --fault."""
        values = "".join(
            # every digit, to reproduce the run
            f",{name}={value if isinstance(value, str) else repr(value).removesuffix('.0')}"
            for name, value in self.values.items()
            if value != self.default(name) and (isinstance(value, str) or not math.isnan(value))
        )
        period = f"@{self.start.text if self.start else '0 s'}" if self.start or self.end else ""
        return f"{self.place.name}:{self.mode}{values}{period}" + (f"..{self.end.text}" if self.end else "")

    @classmethod
    def default(cls, name: str) -> Any:
        """Default of a parameter."""
        return next(parameter.default for parameter in cls.parameters if parameter.name == name)

    def summary(self) -> dict[str, Any]:
        """Its result; times in s since power-up, None for not yet. proof: None without a golden run."""

        def seconds(stamp_ns: int) -> float | None:
            return None if stamp_ns < 0 else (stamp_ns - self.robot.start_ns) * 1e-9

        return {
            "fault": self.text(),
            "armed_s": seconds(self.armed_ns),
            "activated_s": seconds(self.activated_ns),
            "acted_s": seconds(self.acted_ns),
            "ended_s": seconds(self.ended_ns),
            "cleared_s": seconds(self.cleared_ns),
            "acted": self.acted,
            "acted_count": self.acted_count,
            "largest_difference": self.largest_difference,
            "unit": self.unit,
            "permanent": self.permanent or None,
            "gave_way_s": seconds(self.gave_way_ns),
            "gave_way_to": self.gave_way_to or None,
            "proof": {**self.proof().summary(), "of_faults": len(self._together())}
            if self.twin is not None and self.activated_ns >= 0
            else None,
        }
