"""The content of `summary.json`: each figure's place, type, unit and meaning, and when it is null.

One table. The JSON Schema (`ranger-sim summary-schema`) and the tables of docs/summary.md are made from it; a test
compares the summaries of walks with it, key by key.
"""

import dataclasses
from typing import Any

# Types, by their names in JSON Schema.
COUNT, WHOLE, REAL, FLAG, TEXT, TEXTS, OBJECT = "count", "integer", "number", "boolean", "string", "strings", "object"


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure. `place`: keys with dots between them; `{bus}` means each name of its kind, `[]` each entry.

    `unit`: "" for words, flags and counts, "1" for ratios. `null`: when it is null, empty when it never is.
    """

    place: str
    kind: str
    unit: str
    meaning: str
    null: str = ""


NO_STEP = "no step after the fifth"
TOO_FEW_STEPS = "fewer than two steps after the fifth"
NO_TIME = "no time has passed"
NOT_YET = "not yet"
NO_STRIKE = "no step yet, or a contact whose strikes last"

NO_COVERAGE = "--coverage was not asked for"

FIGURES = (
    # the walk
    Figure("steps", COUNT, "", "steps walked"),
    Figure("fell", FLAG, "", "the walk ended before it was to: the robot fell, or its batteries gave out"),
    Figure("fall_cause", TEXT, "", "what ended it", "it did not fall"),
    Figure("failed_boards", TEXTS, "", "boards that finished no slot's work within the last 20 slots"),
    Figure("distance_m", REAL, "m", "from where the standing foot was put down to the last strike's contact point"),
    Figure("time_s", REAL, "s", "virtual time since power-up"),
    Figure("walked_h", REAL, "h", "virtual time since the robot was let go"),
    Figure("mean_step_length_m", REAL, "m", "mean without the first five steps", NO_STEP),
    Figure("std_step_length_m", REAL, "m", "standard deviation of these steps, divided by their number", TOO_FEW_STEPS),
    Figure("mean_step_time_s", REAL, "s", "mean without the first five steps", NO_STEP),
    Figure("std_step_time_s", REAL, "s", "standard deviation of these steps, divided by their number", TOO_FEW_STEPS),
    Figure("double_stance_s", REAL, "s", "mean time from a strike until the trailing foot leaves, same steps", NO_STEP),
    Figure("speed_m_per_s", REAL, "m/s", "length of these steps over their time", NO_STEP),
    # power
    Figure(
        "motor_power_W",
        REAL,
        "W",
        "mean of all motors since the robot was let go; what they give back is not credited",
        NO_TIME,
    ),
    Figure("motor_powers_W.{motor}", REAL, "W", "the same of each motor, at the battery", NO_TIME),
    Figure("electronics_power_W", REAL, "W", "computers and sensors, at the battery"),
    Figure("total_power_W", REAL, "W", "motors and electronics", NO_TIME),
    Figure("tcot", REAL, "1", "total cost of transport: total power over weight times speed", NO_STEP),
    Figure("energy_Wh.{consumer}", REAL, "Wh", "taken from the battery since the robot was let go, and `total`"),
    Figure("battery.capacity_Wh", REAL, "Wh", "of all packs together, as asked for"),
    Figure("battery.charge_at_start", REAL, "1", "at power-up; 1 is full"),
    Figure("battery.charge", REAL, "1", "now; what motors gave back has been charged"),
    Figure("battery.delivered_Wh", REAL, "Wh", "at the terminals, since power-up"),
    Figure("battery.lost_inside_Wh", REAL, "Wh", "heat in the packs' resistance, since power-up"),
    Figure("battery.empty", FLAG, "", "their protection has opened"),
    Figure("battery_V", REAL, "V", "at the terminals now"),
    # heel strikes
    Figure(
        "heel_strike_delay_ms.mean",
        REAL,
        "ms",
        "from a strike to the begin of the main brain's slot that notices it",
        "none was noticed",
    ),
    Figure("heel_strike_delay_ms.std", REAL, "ms", "standard deviation of these delays", "none was noticed"),
    Figure("heel_strike_delay_ms.count", COUNT, "", "strikes that were noticed"),
    Figure("heel_strike_delay_ms.unmatched", COUNT, "", "flips of the swing leg without a new strike"),
    Figure("heel_strike_delay_ms.missed", COUNT, "", "strikes that no flip reported"),
    # not in a textbook gait
    Figure("oddities.contact", TEXT, "", "how feet meet the floor: coulomb, sticking, unilateral or compliant"),
    Figure("oddities.touches", COUNT, "", "times that a foot met the floor"),
    Figure("oddities.lift_offs", COUNT, "", "times that a foot left it, other than in the strike of the other one"),
    Figure("oddities.bounces", COUNT, "", "touches of a leading foot that had left the floor and returned to it"),
    Figure("oddities.recontacts", COUNT, "", "touches out of turn"),
    Figure(
        "oddities.scuffs", COUNT, "", "times that the swing foot's sole touched after it had passed the stance foot"
    ),
    Figure("oddities.flights", COUNT, "", "times that no foot was on the floor"),
    Figure("oddities.slides", COUNT, "", "times that a standing foot began to slide"),
    Figure("oddities.jams", COUNT, "", "slides that could not be, and were stopped by an impulse"),
    Figure("oddities.lead_lifts", COUNT, "", "times that the leading foot left the floor first"),
    Figure("oddities.tensile_strikes", COUNT, "", "strikes whose rule pulled at the trailing foot", NO_STRIKE),
    Figure("oddities.tensile_impulse_min_Ns", REAL, "N s", "worst of these pulls; below zero", NO_STRIKE),
    Figure(
        "oddities.friction_ratio_max",
        REAL,
        "1",
        "worst ratio of friction to normal force above 5 N",
        "the robot was not let go yet",
    ),
    Figure("oddities.slip_s", REAL, "s", "time in which a foot slid, or asked for more than the floor's friction"),
    Figure(
        "oddities.normal_force_min_N",
        REAL,
        "N",
        "least of the floor's forces on a standing foot",
        "the robot was not let go yet",
    ),
    Figure("oddities.pull_s", REAL, "s", "time in which the floor pulled with more than 1 N"),
    Figure(
        "oddities.min_clearance_m",
        REAL,
        "m",
        "lowest clearance of the swing foot while it passes, from the second step on",
        "less than two steps",
    ),
    # buses
    Figure("can.{bus}.frames", COUNT, "", "frames that went over the bus whole"),
    Figure(
        "can.{bus}.load_mean",
        REAL,
        "1",
        "share of the bits that were taken; stuff bits, intermission and error frames included",
    ),
    Figure("can.{bus}.load_max", REAL, "1", "the same in the fullest 10 ms"),
    Figure(
        "can.{bus}.lost",
        COUNT,
        "",
        "frames accepted for sending that a receiving board did not get, on the wire or in its buffers",
    ),
    Figure(
        "can.{bus}.queue_full", COUNT, "", "frames that a full transmit ring of a board or of the router did not take"
    ),
    Figure(
        "can.{bus}.single_shot_skipped",
        COUNT,
        "",
        "time stamps, which are sent once or not at all, that did not go out",
    ),
    Figure("can.{bus}.errors", COUNT, "", "error frames"),
    # boards
    Figure("slots.{board}.count", COUNT, "", "slots that began"),
    Figure("slots.{board}.overruns", COUNT, "", "slots that began before the work of the one before was done"),
    Figure(
        "slots.{board}.max_execution_us",
        REAL,
        "us",
        "longest work of a slot with interrupts; an image's that polls: the slot",
    ),
    Figure("slots.{board}.budget_us", REAL, "us", "length of a slot"),
    Figure(
        "errors.{board}.{error}",
        COUNT,
        "",
        "how often the board itself noted this error of the master table; 0 is left out",
    ),
    # the run
    Figure("realtime_factor", REAL, "1", "virtual time over wall-clock time of the stepping loop"),
    Figure("cpu_factor", REAL, "1", "virtual time over the processor's time for it", "it took no measurable time"),
    Figure("compiled", FLAG, "", "compiled modules ran, not the plain sources"),
    Figure("controller", TEXT, "", "parameter set, as asked for"),
    Figure("body", TEXT, "", "body that walked, as asked for"),
    Figure("profile", TEXT, "", "profile of buses and boards", "none was asked for"),
    Figure("model_file", TEXT, "", "file of additional model terms", "none was asked for"),
    Figure("seed", WHOLE, "", "chose crystals, phases, noise and footholds"),
    Figure("slope_rad", REAL, "rad", "of the floor, positive downhill"),
    Figure("floor_roughness_m", REAL, "m", "standard deviation of the footholds' heights"),
    Figure("electronics_off", TEXTS, "", "electronics that drew no power"),
    Figure("trace_digest", TEXT, "", "BLAKE2b-256 of every frame and of the body's samples: equal for equal runs"),
    Figure("interrupted", FLAG, "", "Ctrl-C or another signal ended the walk"),
    Figure("command", TEXT, "", "walks the same again: equal digest, unless anything arrived from outside"),
    Figure("complete", FLAG, "", "every file of the run's folder is whole"),
    Figure("files.{file}", TEXT, "", "`complete`, or `incomplete` and why: then it has `.partial` in its name"),
    # firmware images
    Figure("images.{board}.file", TEXT, "", "the firmware image that this board ran, as asked for"),
    Figure("images.{board}.lost_s", REAL, "s", "when its program could not go on, since power-up", "it could"),
    Figure("images.{board}.why", TEXT, "", "the exception without a handler, its address and function", "it went on"),
    # programs in C
    Figure("firmware.{board}.name", TEXT, "", "of the program in C that this board ran"),
    Figure("firmware.{board}.folder", TEXT, "", "where its sources are, as asked for"),
    Figure("firmware.{board}.own_process", FLAG, "", "it had a separate process, which it could end alone"),
    Figure("firmware.{board}.confined", TEXT, "", "how that process was confined: yes, partly (what lacks), no"),
    Figure("firmware.{board}.lost_s", REAL, "s", "when its process was gone, since power-up", "it was not"),
    Figure(
        "firmware.{board}.why",
        TEXT,
        "",
        "what ended it: signal or exit with function, file and line, or its process's end",
        "it was not",
    ),
    Figure("firmware.{board}.findings[].file", TEXT, "", "where a sanitizer found something, relative to the folder"),
    Figure("firmware.{board}.findings[].line", COUNT, "", "its line; 0 where it is not known"),
    Figure("firmware.{board}.findings[].function", TEXT, "", "its function; empty where it is not known"),
    Figure("firmware.{board}.findings[].text", TEXT, "", "what is wrong there"),
    Figure(
        "firmware.{board}.findings[].count",
        COUNT,
        "",
        "reports; a process reports a place once. A source that several boards run counts for the first of them",
    ),
    Figure("firmware.{board}.coverage.lines", COUNT, "", "lines with code", NO_COVERAGE),
    Figure("firmware.{board}.coverage.covered", COUNT, "", "of them those that ran", NO_COVERAGE),
    Figure("firmware.{board}.coverage.branches", COUNT, "", "ways out of decisions", NO_COVERAGE),
    Figure("firmware.{board}.coverage.taken", COUNT, "", "of them those that were taken", NO_COVERAGE),
    Figure("firmware.{board}.coverage.whole", FLAG, "", "false: the board ended before it could write", NO_COVERAGE),
    Figure("firmware.{board}.coverage.files[].file", TEXT, "", "a source, relative to the folder"),
    Figure("firmware.{board}.coverage.files[].lines", COUNT, "", "its lines with code"),
    Figure("firmware.{board}.coverage.files[].covered", COUNT, "", "of them those that ran"),
    Figure("firmware.{board}.coverage.files[].branches", COUNT, "", "ways out of its decisions"),
    Figure("firmware.{board}.coverage.files[].taken", COUNT, "", "of them those that were taken"),
    Figure("firmware.{board}.coverage.files[].missed", TEXT, "", "lines that did not run, as 3-7, 12"),
    # faults that were injected
    Figure("faults[].fault", TEXT, "", "as typed: place, mode, parameters, begin, end"),
    Figure("faults[].armed_s", REAL, "s", "when it was armed, since power-up", NOT_YET),
    Figure("faults[].activated_s", REAL, "s", "when it began", NOT_YET),
    Figure("faults[].acted_s", REAL, "s", "when its place first showed something else for it", NOT_YET),
    Figure("faults[].ended_s", REAL, "s", "when it ended", NOT_YET),
    Figure("faults[].cleared_s", REAL, "s", "when its place was as it should be again", NOT_YET),
    Figure("faults[].acted", FLAG, "", "it acted; a run with a fault that did not shows nothing about it"),
    Figure("faults[].acted_count", COUNT, "", "how often"),
    Figure("faults[].largest_difference", REAL, "", "largest difference at its place, in the unit that `unit` names"),
    Figure("faults[].unit", TEXT, "", "of that difference"),
    Figure("faults[].permanent", TEXT, "", "what ends its consequences", "they end with it"),
    Figure(
        "faults[].gave_way_s", REAL, "s", "when it was to begin and its place was taken: it never begins", "it was not"
    ),
    Figure("faults[].gave_way_to", TEXT, "", "which fault still worked there", "it did not give way"),
    Figure(
        "faults[].proof",
        OBJECT,
        "",
        "what differs from the walk without it (docs/faults.md), times in ms after its begin",
        "--proof was not asked for",
    ),
)

JSON_TYPES: dict[str, dict[str, Any]] = {
    COUNT: {"type": "integer", "minimum": 0},
    WHOLE: {"type": "integer"},
    REAL: {"type": "number"},
    FLAG: {"type": "boolean"},
    TEXT: {"type": "string"},
    TEXTS: {"type": "array", "items": {"type": "string"}},
    OBJECT: {"type": "object"},
}


def json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of `summary.json`; `unit` is our own keyword in addition to the standard ones."""
    top = branch()
    for figure in FIGURES:
        at = top
        *inside, last = figure.place.split(".")
        for key in inside:
            at = below(at, key)
        put(at, last, leaf(figure))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "summary.json of a walk of ranger-sim",
        **top,
    }


def branch() -> dict[str, Any]:
    """An object without keys so far."""
    return {"type": "object", "additionalProperties": False, "properties": {}, "required": []}


def leaf(figure: Figure) -> dict[str, Any]:
    """The schema of one figure."""
    schema: dict[str, Any] = dict(JSON_TYPES[figure.kind])
    schema["description"] = figure.meaning + (f"; null: {figure.null}" if figure.null else "")
    if figure.null:
        schema["type"] = [schema["type"], "null"]
    if figure.unit:
        schema["unit"] = figure.unit
    return schema


def below(at: dict[str, Any], key: str) -> dict[str, Any]:
    """The object under a key, made when it is missing."""
    if key.startswith("{"):
        if not at["additionalProperties"]:
            at["additionalProperties"] = branch()
        inside: dict[str, Any] = at["additionalProperties"]
        return inside
    name = key.removesuffix("[]")
    if name not in at["properties"]:
        put(at, name, {"type": "array", "items": branch()} if name != key else branch())
    found: dict[str, Any] = at["properties"][name]
    return found["items"] if name != key else found


def put(at: dict[str, Any], key: str, what: dict[str, Any]) -> None:
    """Put `what` under a required key, or under every name."""
    if key.startswith("{"):
        at["additionalProperties"] = what
        return
    at["properties"][key] = what
    at["required"].append(key)


def markdown() -> str:
    """The table of docs/summary.md."""
    lines = ["| figure | unit | meaning | null |", "|---|---|---|---|"]
    for figure in FIGURES:
        unit = figure.unit or {FLAG: "true, false", COUNT: "count"}.get(figure.kind, "")
        lines.append(f"| `{figure.place}` | {unit} | {figure.meaning} | {figure.null} |")
    return "\n".join(lines)
