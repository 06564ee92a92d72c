"""A campaign as a TOML file: what is run, how it is monitored, what the results must meet. README.md here has the form.

Any mistake in a file is a UserError of one line: file, key, value, what is allowed.
"""

import dataclasses
import fnmatch
import itertools
import math
import pathlib
import string
from collections.abc import Iterator
from typing import Any

from ranger_sim.foundation import toml_file
from ranger_sim.foundation.quantities import in_base_units, nanoseconds
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import CampaignError, UserError, raised
from ranger_sim.harness.campaigns.cases import Case, Settings
from ranger_sim.harness.campaigns.group import Watch, digest_of, rounded, start_of
from ranger_sim.harness.campaigns.outcomes import OUTCOMES, severity
from ranger_sim.harness.campaigns.statistics import CONFIDENCE, INTERVALS, Stopping
from ranger_sim.harness.campaigns.subjects import is_number as number
from ranger_sim.harness.campaigns.subjects import subject_of
from ranger_sim.harness.faults.catalogue import Catalogue

TEXTS = ("title", "description", "fault_module")
TABLES = (*TEXTS, "walk", "machine", "watch", "band", "healthy", "vary", "faults", "tolerance", "sample", "search")
PREFIXES = ("controller.", "body.", "cost.")
MOST_RUNS = 1_000_000
MOST_CHECKED = 10_000  # texts of one fault that are read before anything runs; of more, only this many


@dataclasses.dataclass(frozen=True)
class Range:
    """Any number from `low` to `high`, each as likely as the next; `log`: each factor as likely as the next.

    step: only `low`, `low + step` and so on up to `high`; whole numbers when both are whole. None: any number.
    """

    low: float
    high: float
    log: bool = False
    step: float | None = None

    @property
    def size(self) -> int:
        """How many values a range with a step has."""
        assert self.step is not None
        return 1 + math.floor((self.high - self.low) / self.step + 1e-9)  # includes a last one that rounding put beyond

    @property
    def values(self) -> list[float]:
        """All values of a range with a step."""
        return [self.numbered(number) for number in range(self.size)]

    def numbered(self, number: int) -> float:
        """Value `number` of a range with a step."""
        assert self.step is not None
        value = self.low + number * self.step
        return value if isinstance(value, int) else float(f"{value:.6g}")

    def at(self, share: float) -> float:
        """The value at a share 0-1 of the way, with six digits; of a range with a step one of its values."""
        if self.step is not None:
            return self.numbered(min(self.size - 1, int(share * self.size)))
        if self.log:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + (self.high - self.low) * share
        return float(f"{value:.6g}")

    def text(self) -> str:
        """Text for people."""
        range_text = f"{self.low:g} to {self.high:g}"
        return range_text + (f" by {self.step:g}" if self.step is not None else ", by factors" if self.log else "")


@dataclasses.dataclass(frozen=True)
class Tolerance:
    """A requirement on a time: `share` of the runs within `limit_ms`, with `confidence` when they are a sample."""

    what: str  # "detection" or "reaction"
    limit_ms: float
    share: float = 0.95
    confidence: float = CONFIDENCE


@dataclasses.dataclass(frozen=True)
class Sample:
    """A random sample of `runs`. interval: which confidence interval its shares get."""

    runs: int
    seed: int = 1
    interval: str = "clopper-pearson"
    confidence: float = CONFIDENCE
    stopping: Stopping | None = None


@dataclasses.dataclass(frozen=True)
class Search:
    """Search for the worst case: `first` runs spread over the ranges, then `rounds` of `each` around the worst so far.

    least: the range whose smallest value with this `outcome` is searched for; None: the worst by `severity`.
    """

    first: int = 12
    rounds: int = 4
    each: int = 6
    seed: int = 1
    least: str | None = None
    outcome: str = "fall"

    def hits(self, result: dict[str, Any] | None) -> bool:
        """Whether a run came to the outcome; a robot that fell after damage fell."""
        if result is None:
            return False
        return bool(result["outcome"] == self.outcome or (self.outcome == "fall" and result.get("fall_ms") is not None))

    def badness(self, value: float, result: dict[str, Any] | None) -> tuple[float, float]:
        """Sort key of runs, the worst last. `value`: of the range `least`, as a share of its length."""
        if self.least is not None and self.hits(result):
            return 1.0, -value
        return 0.0, severity(result or {"outcome": "invalid"})


@dataclasses.dataclass(frozen=True)
class Plan:
    """A campaign. axes: what is varied, in order: lists and ranges. `sample` or `search`, or neither: a census."""

    path: str
    title: str
    description: str
    walk: dict[str, Any]
    watch: Watch
    healthy_seeds: tuple[int, ...]
    axes: dict[str, list[Any] | Range]
    tolerances: tuple[Tolerance, ...] = ()
    sample: Sample | None = None
    search: Search | None = None
    fault_module: str | None = None  # a user's file of modes and places
    machine: str = ""  # reference of the subject (subjects.py), whose keywords `walk` has

    @property
    def subject(self) -> Any:
        """What the runs use as machine (subjects.py)."""
        return subject_of(self.machine)

    @property
    def name(self) -> str:
        """The name of its files."""
        return pathlib.Path(self.path).stem

    @property
    def design(self) -> str:
        """census, sample or search."""
        return "sample" if self.sample else "search" if self.search else "census"

    def with_seed(self, seed: int) -> "Plan":
        """The plan whose sample or search draws with another seed. UserError for a census, which draws nothing."""
        if self.sample is not None:
            return dataclasses.replace(self, sample=dataclasses.replace(self.sample, seed=seed))
        if self.search is not None:
            return dataclasses.replace(self, search=dataclasses.replace(self.search, seed=seed))
        raise CampaignError(f"--seed {seed}: {self.path} has neither [sample] nor [search]; a census draws nothing")

    def watch_key(self) -> dict[str, Any]:
        """The settings of monitoring that affect results."""
        found = self.watch.as_dict()
        del found["limit_s"]
        if self.fault_module is not None:
            found["fault_module"] = digest_of(self.fault_module)
        return {**found, "healthy_seeds": list(self.healthy_seeds)}

    def population(self) -> str:
        """The population that the runs represent, in a sentence."""
        parts = []
        for name, values in self.axes.items():
            if isinstance(values, Range):
                parts.append(f"{name} from {values.text()}")
            else:
                parts.append(f"{len(values)} of {name}" if len(values) > 1 else f"{name} {values[0]}")
        return "; ".join(parts) or "one walk"

    def case(self, point: dict[str, Any]) -> Case:
        """The run at one value per axis. UserError when a fault's text is not in the catalogue."""
        walk, controller, body, costs = dict(self.walk), {}, {}, {}
        for name, value in point.items():
            if field := self.subject.field(name):
                walk[field] = walk_value(self.subject, name, value, self.path)
            elif name.startswith("controller."):
                controller[name.partition(".")[2]] = float(value)
            elif name.startswith("body."):
                body[name.partition(".")[2]] = value
            elif name.startswith("cost."):
                costs[name.partition(".")[2]] = float(value)
        walk = {"seed": 1} | walk
        settings = Settings(walk, controller, body, costs, self.machine)
        fault = point.get("fault")
        if fault:
            text = str(fault).format_map({name: shown(value) for name, value in point.items()})
            return Case(settings, text, None, point)
        base = Settings({**self.walk, "seed": walk["seed"]}, machine=self.machine)
        return Case(settings, None, base, point)

    def census(self) -> Iterator[Case]:
        """Every combination of the axes' values."""
        for point in combinations(self.axes):
            yield self.case(point)

    def drawn(self) -> Iterator[Case]:
        """The runs of a sample, in the order in which they were drawn, with replacement."""
        assert self.sample is not None
        stream = RandomStream(self.sample.seed, "campaign sample")
        for _ in range(self.sample.runs):
            yield self.case({name: drawn(values, stream) for name, values in self.axes.items()})

    def cases(self) -> list[Case]:
        """All runs that are known before any has run; those of a search come later."""
        return list(self.drawn() if self.sample else self.census())


def combinations(axes: dict[str, list[Any] | Range]) -> Iterator[dict[str, Any]]:
    """Every combination of the values of lists, and of ranges with a step."""
    lists = [each.values if isinstance(each, Range) else each for each in axes.values()]
    for values in itertools.product(*lists):
        yield dict(zip(axes, values, strict=True))


def drawn(values: list[Any] | Range, stream: Any) -> Any:
    """One value of an axis, by chance."""
    return values.at(stream.uniform()) if isinstance(values, Range) else values[stream.integer(len(values))]


def shown(value: Any) -> str:
    """A value as written in a fault's text."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def walk_value(subject: Any, name: str, value: Any, path: str) -> Any:
    """A value of [walk] in the unit of the subject's field."""
    units = subject.units(name)
    if units is None or not isinstance(value, str):
        return value
    number = in_base_units(value, units)
    if number is None:
        raise CampaignError(
            f"{path}: {name} = {value!r}: a number with one of the units {', '.join(units)} is expected"
        )
    return number


# --- reading --------------------------------------------------------------------------------------------------------


def load(name: str | pathlib.Path, walks: str = "") -> Plan:
    """The plan in a file; `walks`: reference of the subject of one without [machine]."""
    path = pathlib.Path(name)
    return of_data(toml_file.load(path, "campaign file"), str(path), walks)


def of_data(data: dict[str, Any], path: str, walks: str = "") -> Plan:
    """The plan in a file's content; `walks`: reference of the subject of one without [machine]."""
    only(data, TABLES, path)
    own, fields = machine_of(data, path)
    machine = own or walks
    if not machine:
        raise CampaignError(f"{path}: [machine] is missing")
    subject = subject_of(machine)
    module = module_of(data, path, subject)
    if not own:
        walk = table(data, "walk", path)
        only(walk, tuple(subject.keys), f"{path}: [walk]")
        fields = {subject.field(name): walk_value(subject, name, value, path) for name, value in walk.items()}
    check_settings(Settings(fields, machine=machine), f"{path}: [{'machine' if own else 'walk'}]")
    axes = axes_of(data, path, subject)
    sample = sample_of(data, path)
    search = search_of(data, path)
    if sample and search:
        raise CampaignError(f"{path}: [sample] and [search]: one of them, or neither for a census")
    ranges = [name for name, values in axes.items() if isinstance(values, Range)]
    free = [name for name in ranges if axes[name].step is None]  # type: ignore[union-attr]
    if free and not (sample or search):
        raise CampaignError(
            f"{path}: [vary] {free[0]}: a range needs [sample] or [search]; a census takes a list, or a range with step"
        )
    if search and not ranges:
        raise CampaignError(
            f"{path}: [search]: at least one range in [vary] is expected, for instance start and magnitude"
        )
    if search and search.least is not None and search.least not in ranges:
        raise CampaignError(
            f"{path}: [search] least = {search.least!r}: one of the ranges is expected, {', '.join(ranges)}"
        )
    stepped = [] if sample or search else [axes[name].size for name in ranges]  # type: ignore[union-attr]
    runs = math.prod([len(each) for each in axes.values() if not isinstance(each, Range)] + stepped)
    if runs > MOST_RUNS or (sample is None and search is None and runs == 0):
        raise CampaignError(f"{path}: {runs} runs, allowed are 1 to {MOST_RUNS}")
    healthy = table(data, "healthy", path)
    only(healthy, ("seeds",), f"{path}: [healthy]")
    seeds = healthy.get("seeds", [1, 2, 3, 4, 5, 6])
    if not (isinstance(seeds, list) and all(type(each) is int for each in seeds) and len(set(seeds)) >= 2):
        raise CampaignError(f"{path}: [healthy] seeds = {seeds!r}: a list of two or more whole numbers is expected")
    tolerances = tuple(tolerances_of(data, path))
    if search and tolerances:
        raise CampaignError(
            f"{path}: [tolerance] {tolerances[0].what}: runs of a [search] are chosen, do not represent a population"
        )
    plan = Plan(
        path=path,
        title=text(data, "title", path, pathlib.Path(path).stem),
        description=text(data, "description", path, ""),
        walk=fields,
        watch=watch_of(data, path, subject),
        healthy_seeds=tuple(seeds),
        axes=axes,
        tolerances=tolerances,
        sample=sample,
        search=search,
        fault_module=module,
        machine=machine,
    )
    check_axes(plan)
    check_faults(plan)
    return plan


def machine_of(data: dict[str, Any], path: str) -> tuple[str, dict[str, Any]]:
    """[machine]: (FILE.py:NAME with the whole path, the keywords that all runs have); ("", {}) without it."""
    if "machine" not in data:
        return "", {}
    found = dict(table(data, "machine", path))
    if "walk" in data:
        raise CampaignError(f"{path}: [walk] and [machine]: one of them; [walk] is Ranger's")
    make = found.pop("make", None)
    if not isinstance(make, str) or not make:
        raise CampaignError(f"{path}: [machine] make = {make!r}: FILE.py:NAME is expected, relative to the plan")
    try:
        machine = str((pathlib.Path(path).parent / make).resolve())
        subject_of(machine)
    except (UserError, ValueError) as error:
        raise CampaignError(f"{path}: {error}") from None
    return machine, found


def module_of(data: dict[str, Any], path: str, subject: Any) -> str | None:
    """`fault_module`, a file next to the plan: its modes and places are in the catalogue from here on."""
    name = data.get("fault_module")
    if name is None:
        return None
    if not isinstance(name, str) or not name:
        raise CampaignError(
            f"{path}: fault_module = {name!r}: the name of a .py file is expected, relative to the plan"
        )
    found = (pathlib.Path(path).parent / name).resolve()
    try:
        subject.catalogue.load_file(found)
    except UserError as error:
        raise CampaignError(f"{path}: {error}") from None
    return str(found)


def check_settings(settings: Settings, where: str) -> None:
    """UserError, naming `where`, for settings from which no robot can be made."""
    try:
        settings.robot().close()
    except UserError as error:
        raise CampaignError(f"{where}: {error}") from None
    except Exception as error:  # whatever a user's program raises
        raise CampaignError(f"{where}: it raised {raised(error)}") from error


def check_axes(plan: Plan) -> None:
    """UserError for a value of [vary] with which no robot can be made, before anything is run: names, and both ends."""
    for name, values in plan.axes.items():
        if not plan.subject.is_setting(name):
            continue
        some = ends(values) if not isinstance(ends(values)[0], str) else values
        for value in some:  # type: ignore[union-attr]
            check_settings(plan.case({name: value}).settings, f"{plan.path}: [vary] {name} = {value}")


def ends(values: list[Any] | Range) -> list[Any]:
    """The first and the last value of an axis; of a range with a step its last."""
    listed = [values.at(0.0), values.at(1.0)] if isinstance(values, Range) else values
    return [listed[0], listed[-1]]


def check_faults(plan: Plan) -> None:
    """UserError for a fault that the catalogue does not have, before anything is run: with every value in its text."""
    first = {name: ends(values)[0] for name, values in plan.axes.items()}
    for fault in plan.axes.get("fault", []):  # type: ignore[union-attr]
        used = names_in(fault, plan.path) & set(plan.axes)
        several: dict[str, list[Any] | Range] = {}
        for name in sorted(used):
            each = plan.axes[name]
            several[name] = ends(each) if isinstance(each, Range) else each
        for point in itertools.islice(combinations(several), MOST_CHECKED):
            try:
                text = str(plan.case({**first, **point, "fault": fault}).fault)
            except KeyError as error:
                raise CampaignError(f"{plan.path}: fault {fault!r}: {error} is not a name of [vary]") from None
            except (ValueError, IndexError, AttributeError) as error:
                raise CampaignError(f"{plan.path}: fault {fault!r}: {error}") from None
            try:
                plan.subject.condition(start_of(text))
                plan.subject.catalogue.typed(text)
            except UserError as error:
                raise CampaignError(f"{plan.path}: {error}") from None


def names_in(fault: str, path: str) -> set[str]:
    """The names of [vary] in a fault's text. UserError for braces that hold none."""
    try:
        return {name for _, name, _, _ in string.Formatter().parse(fault) if name}
    except ValueError as error:
        raise CampaignError(f"{path}: fault {fault!r}: {error}") from None


def axes_of(data: dict[str, Any], path: str, subject: Any) -> dict[str, list[Any] | Range]:
    """[vary], and the faults of [[faults]] as its axis `fault`."""
    axes: dict[str, list[Any] | Range] = {}
    for name, values in flattened(table(data, "vary", path)).items():
        axes[name] = values_of(subject, name, values, path)
    groups = data.get("faults", [])
    if not isinstance(groups, list):
        raise CampaignError(f"{path}: faults = {groups!r}: tables [[faults]] are expected")
    listed = [fault for group in groups for fault in faults_of(group, path, subject.catalogue)]
    if listed:
        if "fault" in axes:
            raise CampaignError(f"{path}: [vary] fault and [[faults]]: one of them")
        axes["fault"] = listed  # last, so that an interrupted campaign has every fault at the first of the starts
    used: set[str] = set()
    for fault in axes.get("fault", []):  # type: ignore[union-attr]
        used |= names_in(fault, path)
    for name in axes:
        if name == "fault" or name in used or subject.is_setting(name):
            continue
        raise CampaignError(f"{path}: [vary] {name}: not a {subject.settings_text}, and no fault's text has {{{name}}}")
    return axes


def flattened(values: dict[str, Any], before: str = "") -> dict[str, Any]:
    """[vary.body] hip_gear = ... as body.hip_gear = ...; ranges stay whole."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        whole = f"{before}{name}"
        if isinstance(value, dict) and not {"low", "high"} <= set(value):
            found.update(flattened(value, f"{whole}."))
        else:
            found[whole] = value
    return found


def values_of(subject: Any, name: str, values: Any, path: str) -> list[Any] | Range:
    """The values of one axis."""
    if isinstance(values, dict) and name != "fault":
        return range_of(subject, name, values, path)
    listed = values if isinstance(values, list) else [values]
    kinds: tuple[type, ...] = (str, int, float)
    expected = "a list of values, or { low, high },"
    if name == "fault":
        kinds, expected = (str,), "a list of texts"
    elif name.startswith(PREFIXES):
        kinds, expected = (int, float), "a list of numbers, or { low, high },"
    if not listed or not all(type(each) in kinds for each in listed):
        raise CampaignError(f"{path}: [vary] {name} = {values!r}: {expected} is expected")
    return listed


def range_of(subject: Any, name: str, values: dict[str, Any], path: str) -> Range:
    """{ low, high, log } or { low, high, step }, with the units that [walk] takes."""
    where = f"{path}: [vary] {name}"
    only(values, ("low", "high", "log", "step"), where)
    values = (
        {key: walk_value(subject, name, value, path) for key, value in values.items()}
        if subject.field(name)
        else values
    )
    low, high = values["low"], values["high"]
    log, step = bool(values.get("log", False)), values.get("step")
    if not (number(low) and number(high)) or not low < high or (log and low <= 0.0):
        raise CampaignError(f"{where} = {low!r} to {high!r}: low below high" + (", above 0" if log else ""))
    if step is None:
        return Range(float(low), float(high), log)
    if log or not number(step) or not 0.0 < step <= high - low or (high - low) / step >= MOST_RUNS:
        raise CampaignError(f"{where}: step = {step!r}: above 0 and at most high - low is expected, without log")
    return Range(low, high, False, step)


def faults_of(group: Any, path: str, catalogue: Catalogue) -> Iterator[str]:
    """The faults of one [[faults]]: every mode at every place that takes it, both by patterns with * and ?."""
    where = f"{path}: [[faults]]"
    if not isinstance(group, dict):
        raise CampaignError(f"{where}: a table is expected")
    only(group, ("places", "kinds", "modes", "without", "values", "period"), where)
    places = patterns(group, "places", where)
    kinds = patterns(group, "kinds", where)
    modes = patterns(group, "modes", where)
    without = patterns(group, "without", where, [])
    period = group.get("period", "")
    values = "".join(f",{name}={value}" for name, value in table(group, "values", where).items())
    count = 0
    for place in catalogue.places.values():
        if not matches(place.name, places) or not matches(place.kind, kinds):
            continue
        for mode in sorted(catalogue.modes_of(place)):
            text = f"{place.name}:{mode}"
            if matches(mode, modes) and not matches(text, without):
                count += 1
                yield text + values + (f"@{period}" if period else "")
    if not count:
        raise CampaignError(f"{where}: no place and mode fit {places} and {modes}; `ranger-sim faults` lists them")


def patterns(group: dict[str, Any], key: str, where: str, default: Any = ("*",)) -> list[str]:
    """A list of patterns."""
    found = group.get(key, list(default))
    listed = [found] if isinstance(found, str) else found
    if not isinstance(listed, list) or not all(isinstance(each, str) for each in listed):
        raise CampaignError(f"{where}: {key} = {found!r}: a list of texts is expected")
    return listed


def matches(name: str, listed: list[str]) -> bool:
    """Whether a name fits one of the patterns."""
    return any(fnmatch.fnmatchcase(name, each) for each in listed)


def watch_of(data: dict[str, Any], path: str, subject: Any) -> Watch:
    """[watch] and [band]."""
    found = table(data, "watch", path)
    only(found, ("after", "from", "patience", "limit"), f"{path}: [watch]")
    times = {f"{name}_s": nanoseconds(value, f"{path}: [watch] {name}") * 1e-9 for name, value in found.items()}
    for name in ("after", "limit"):
        if times.get(f"{name}_s") == 0.0:
            raise CampaignError(f"{path}: [watch] {name} = {found[name]!r}: it must be above 0")
    band = subject.band(table(data, "band", path), path)
    return Watch(**{**subject.usual, **times}, band=band)


def tolerances_of(data: dict[str, Any], path: str) -> Iterator[Tolerance]:
    """[tolerance]: detection = { within = "50 ms", share = 0.95, confidence = 0.95 }."""
    for name, value in table(data, "tolerance", path).items():
        where = f"{path}: [tolerance] {name}"
        if name not in ("detection", "reaction"):
            raise CampaignError(f"{where}: allowed are detection, reaction")
        if not isinstance(value, dict) or "within" not in value:
            raise CampaignError(f"{where}: a table with `within` is expected")
        only(value, ("within", "share", "confidence"), where)
        share, confidence = value.get("share", 0.95), value.get("confidence", CONFIDENCE)
        if not all(number(each) and 0.0 < each < 1.0 for each in (share, confidence)):
            raise CampaignError(f"{where}: share {share!r} and confidence {confidence!r} must be above 0 and below 1")
        yield Tolerance(name, rounded(nanoseconds(value["within"], where) * 1e-6), share, confidence)


def sample_of(data: dict[str, Any], path: str) -> Sample | None:
    """[sample], with [sample.stop] when it may stop early."""
    if "sample" not in data:
        return None
    found = table(data, "sample", path)
    where = f"{path}: [sample]"
    only(found, ("runs", "seed", "interval", "confidence", "stop"), where)
    runs = whole(found, "runs", where, None, 1, MOST_RUNS)
    interval = found.get("interval", "clopper-pearson")
    if not isinstance(interval, str) or interval not in INTERVALS:
        raise CampaignError(f"{where}: interval = {interval!r}: allowed are {', '.join(INTERVALS)}")
    confidence = found.get("confidence", CONFIDENCE)
    if not isinstance(confidence, float) or not 0.5 <= confidence < 1.0:
        raise CampaignError(f"{where}: confidence = {confidence!r}: from 0.5 to below 1 is expected")
    stopping = None
    if "stop" in found:
        stop = table(found, "stop", where)
        only(stop, ("outcome", "limit", "looks", "rule"), f"{where} stop")
        outcome = stop.get("outcome")
        if outcome not in OUTCOMES:
            raise CampaignError(f"{where} stop: outcome = {outcome!r}: allowed are {', '.join(OUTCOMES)}")
        limit: Any = stop.get("limit")
        rule = stop.get("rule", Stopping.rule)
        if not number(limit) or not isinstance(rule, str):
            raise CampaignError(f"{where} stop: limit = {limit!r}, rule = {rule!r}: a share and a name are expected")
        looks = whole(stop, "looks", f"{where} stop", Stopping.looks, 1, 50)
        try:
            stopping = Stopping(outcome, limit, runs, looks, rule, confidence)
        except UserError as error:
            raise CampaignError(f"{where} stop: {error}") from None
    return Sample(runs, whole(found, "seed", where, 1, -(2**63), 2**63), interval, confidence, stopping)


def search_of(data: dict[str, Any], path: str) -> Search | None:
    """[search]."""
    if "search" not in data:
        return None
    found = table(data, "search", path)
    where = f"{path}: [search]"
    only(found, ("first", "rounds", "each", "seed", "least", "outcome"), where)
    least, outcome = found.get("least"), found.get("outcome", "fall")
    if outcome not in OUTCOMES:
        raise CampaignError(f"{where}: outcome = {outcome!r}: allowed are {', '.join(OUTCOMES)}")
    if least is not None and not isinstance(least, str):
        raise CampaignError(f"{where}: least = {least!r}: the name of a range in [vary] is expected")
    if "outcome" in found and least is None:
        raise CampaignError(
            f"{where}: outcome = {outcome!r}: it needs `least`, the range whose smallest value is wanted"
        )
    return Search(
        whole(found, "first", where, 12, 1, 100_000),
        whole(found, "rounds", where, 4, 0, 1000),
        whole(found, "each", where, 6, 1, 100_000),
        whole(found, "seed", where, 1, -(2**63), 2**63),
        least,
        outcome,
    )


def only(data: dict[str, Any], allowed: tuple[str, ...], where: str) -> None:
    """UserError for a key that is not allowed."""
    for key in data:
        if key not in allowed:
            raise CampaignError(f"{where}: unknown key {key!r}; allowed are {', '.join(allowed)}")


def table(data: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    """A table of a file, empty when it is missing."""
    value = data.get(key, {})
    if not isinstance(value, dict):
        raise CampaignError(f"{where}: {key} = {value!r}: a table is expected")
    return value


def text(data: dict[str, Any], key: str, where: str, default: str) -> str:
    """A text of a file."""
    value = data.get(key, default)
    if not isinstance(value, str):
        raise CampaignError(f"{where}: {key} = {value!r}: text is expected")
    return value


def whole(data: dict[str, Any], key: str, where: str, default: int | None, low: int, high: int) -> int:
    """A whole number of a file."""
    value = data.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise CampaignError(f"{where}: {key} = {value!r}: a whole number from {low} to {high} is expected")
    return value
