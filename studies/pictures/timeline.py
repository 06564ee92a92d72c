"""Draws docs/timeline.svg: the hip angle's way from the sensor to the motor, out of docs/timeline_step.json.

    python -m studies.pictures.timeline              # draw it again: the same file gives the same bytes
    python -m studies.pictures.timeline --record     # walk to step 5, keep that step's way in the file, and draw it

Everything is to scale in time; whatever happened on these boards, this bus and this link meanwhile is drawn pale.
"""

import json
import pathlib
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
STEP_FILE = ROOT / "docs" / "timeline_step.json"
FIGURE = ROOT / "docs" / "timeline.svg"
STEP = 5
STEP_S = 0.6
LEAST_CURRENT_A = 0.5  # of the command that came of it, so that the motor's answer can be seen

WIDTH, LEFT, RIGHT = 1160, 150, 1140
AXIS_Y = 56
LANE_TOP, LANE, BAR = 78, 58, 24
INK, SOFT, LINE, PALE, RED, BLUE, GREEN, GOLD = (
    "#24292f", "#667085", "#e3e6ec", "#dfe3ea", "#c8452f", "#2460a7", "#2e7d4f", "#b07a10",
)  # fmt: skip
LANES = (
    ("edges", "hip, its motor", "encoder edges"),
    ("MCH interrupts", "hip board MCH", "interrupts"),
    ("MCH", "", "slots of 0.5 ms"),
    ("can1", "CAN1", "3 Mbit/s"),
    ("CSR", "router CSR", "interrupts, main loop"),
    ("link", "serial link", "every 200 µs"),
    ("MB", "main brain MB", "slots of 2 ms"),
    ("duty", "hip motor", "duty of its bridge"),
)
COLOURS = {"MCH": BLUE, "MCH interrupts": BLUE, "can1": RED, "CSR": GREEN, "link": GOLD, "MB": BLUE}


# --- recording ------------------------------------------------------------------------------------------------


class Way:
    """A timeline's slices, and where the flows lead."""

    def __init__(self, events: object) -> None:
        self.slices = []
        for track in events.slices:
            level = track
            while level is not None:
                self.slices.append(level)
                level = level.inside
        begins, self.next = {}, {}
        for slices in self.slices:
            for at, number, ends in zip(slices.flow_at, slices.flow_id, slices.flow_ends, strict=True):
                if not ends:
                    begins[int(number)] = (id(slices), int(at))
        for slices in self.slices:
            for at, number, ends in zip(slices.flow_at, slices.flow_id, slices.flow_ends, strict=True):
                if ends:
                    self.next.setdefault(begins[int(number)], []).append((slices, int(at)))

    def track(self, *path: str, inside: bool = False) -> object:
        found = [slices for slices in self.slices if slices.path == path]
        return found[-1 if inside else 0]

    def following(self, slices: object, at: int, track: str, name: str = "") -> tuple | None:
        """The slice on `track` (the last two parts of its path) to which a flow leads from this one."""
        for other, place in self.next.get((id(slices), at), []):
            if " ".join(other.path[-2:]) == track and (not name or other.names[other.name[place]] == name):
                return other, place
        return None


def times(found: tuple) -> list:
    slices, at = found
    return [int(slices.start_ns[at]), int(slices.end_ns[at])]


def first_after(slices: object, name: str, time_ns: int) -> tuple:
    """The next slice of that name from `time_ns` on."""
    at, starts = slices.starts_of(name)
    return slices, int(at[np.searchsorted(starts, time_ns)])


def way_from(way: Way, frame: int) -> dict | None:
    """The stations of one frame of the hip angle, or None when no command came of it in the same slot."""
    can1 = way.track("Buses", "can1", "frames")
    mch_tasks = way.track("Boards", "MCH", "slots", inside=True)
    mch_slots = way.track("Boards", "MCH", "slots")
    mb_tasks = way.track("Boards", "MB", "slots", inside=True)
    start = int(can1.start_ns[frame])
    slot = int(np.searchsorted(mch_slots.start_ns, start, side="right")) - 1
    slot_ns = int(mch_slots.start_ns[slot])
    stations = {"ae_update": times(first_after(mch_tasks, "ae_update", slot_ns))}
    services = way.track("Boards", "MCH", "interrupts")
    stations["ae_read"] = times(first_after(services, "ae_read", slot_ns))
    stations["MCH_ANGLE"] = times(first_after(mch_tasks, "MCH_ANGLE", slot_ns))
    stations["can_transmit"] = times(first_after(mch_tasks, "can_transmit", slot_ns))
    stations["frame up"] = times((can1, frame))
    here = (can1, frame)
    for key, track, name in (
        ("CSR received", "CSR interrupts", "can1 receive"),
        ("link up", "Link to the main brain", ""),
        ("MB received", "MB interrupts", "ssp"),
        ("parse_ssp", "MB slots", "parse_ssp"),
    ):
        found = way.following(*here, track, name)
        if found is None:
            return None
        stations[key] = times(found)
        here = found
    parsed = stations["parse_ssp"][0]
    for task in ("estimator", "controller", "send_ssp"):
        stations[task] = times(first_after(mb_tasks, task, parsed))
    sends = first_after(mb_tasks, "send_ssp", parsed)
    for exchange in way.next.get((id(sends[0]), sends[1]), []):
        heard = way.following(*exchange, "CSR interrupts", "ssp")
        for turn in way.next.get((id(heard[0]), heard[1]), []) if heard else []:
            sent = way.following(*turn, "can1 frames", "MCH_COMMAND_CURRENT")
            if sent and turn[0].path[-1] == "main loop":
                board = way.following(*sent, "MCH interrupts", "can_receive")
                task = way.following(*board, "MCH slots", "can_rx_dispatch_all") if board else None
                if task:
                    stations["link down"], stations["CSR got"] = times(exchange), times(heard)
                    stations["turn"], stations["frame down"] = times(turn), times(sent)
                    stations["MCH received"], stations["dispatch"] = times(board), times(task)
                    control = first_after(mch_tasks, "mc_compliant_control", stations["dispatch"][0])
                    stations["control"] = times(control)
                    stations["value up"] = float(can1.notes["value"][frame])
                    stations["value down"] = float(sent[0].notes["value"][sent[1]])
                    return stations
    return None


def record() -> dict:
    """Walk, and keep the way of one hip angle with all that happened around it."""
    from ranger_sim import Ranger, Scenario
    from ranger_sim.ranger.timeline import Timeline

    robot = Ranger(Scenario())
    robot.until(f"step {STEP}", within="10 s")
    timeline = Timeline(robot)
    robot.run_for(STEP_S)
    events = timeline.events()
    timeline.close()
    way = Way(events)
    can1 = way.track("Buses", "can1", "frames")
    for frame in can1.starts_of("MCH_ANGLE")[0].tolist():
        stations = way_from(way, int(frame)) if can1.start_ns[frame] > events.begin_ns + 2_000_000 else None
        if stations and abs(stations["value down"]) > LEAST_CURRENT_A:
            break
    else:
        raise SystemExit("no hip angle led to a command in the same slot of the main brain")
    begin = stations["ae_update"][0]
    end = stations["control"][1]
    lanes = {
        "MCH": whole(way, begin, end, ("Boards", "MCH", "slots"), True),
        "MCH interrupts": whole(way, begin, end, ("Boards", "MCH", "interrupts"), False),
        "can1": whole(way, begin, end, ("Buses", "can1", "frames"), False),
        "CSR": whole(way, begin, end, ("Boards", "CSR", "interrupts"), True)
        + whole(way, begin, end, ("Boards", "CSR", "main loop"), False),
        "link": whole(way, begin, end, ("Link", "to the main brain"), False)
        + whole(way, begin, end, ("Link", "to the router"), False),
        "MB": whole(way, begin, end, ("Boards", "MB", "slots"), True),
    }
    duty = events.counter("Boards", "MCH", "duty")
    near = (duty.time_ns > begin - 1_000_000) & (duty.time_ns < end + 500_000)
    edges = way.track("Boards", "MCH", "interrupts", inside=True)
    ours = np.isin(edges.name, [edges.names.index(name) for name in ("encoder_edge_0", "encoder_edge_2")])
    seen = ours & (edges.start_ns > begin - 300_000) & (edges.start_ns < end + 300_000)
    robot.close()
    return {
        "run": timeline.title(),
        "step": STEP,
        "digest": robot.trace_digest(),
        "begin_ns": begin,
        "stations": stations,
        "lanes": lanes,
        "duty": [duty.time_ns[near].tolist(), duty.values[near].tolist()],
        "edges": edges.start_ns[seen].tolist(),
    }


def whole(way: Way, begin: int, end: int, path: tuple, inside: bool) -> list:
    """[start, end, name] of every slice of a track near the way."""
    slices = way.track(*path, inside=inside)
    near = (slices.end_ns > begin - 300_000) & (slices.start_ns < end + 300_000)
    rows = zip(slices.start_ns[near], slices.end_ns[near], slices.name[near], strict=True)
    return [[int(start), int(stop), slices.names[name]] for start, stop, name in rows]


# --- drawing --------------------------------------------------------------------------------------------------


class Figure:
    """The parts of the picture, and where times and lanes lie in it."""

    def __init__(self, kept: dict) -> None:
        self.kept = kept
        self.stations = kept["stations"]
        self.zero = kept["begin_ns"]
        last = self.stations["control"][1] - self.zero
        self.from_ns, self.to_ns = -60_000, last + 90_000
        self.parts: list[str] = []

    def x(self, time_ns: float) -> float:
        """Pixels from the left of a time in ns."""
        share = (time_ns - self.zero - self.from_ns) / (self.to_ns - self.from_ns)
        return round(LEFT + share * (RIGHT - LEFT), 1)

    def text(
        self,
        x: float,
        y: float,
        words: str,
        anchor: str = "start",
        size: int = 12,
        colour: str = INK,
        bold: bool = False,
    ) -> None:
        style = f'font-size="{size}" text-anchor="{anchor}" fill="{colour}"' + ' font-weight="600"' * bold
        self.parts.append(f'<text x="{x:g}" y="{y:g}" {style}>{words}</text>')

    def line(self, x1: float, y1: float, x2: float, y2: float, colour: str = LINE, width: float = 1.0) -> None:
        self.parts.append(
            f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke="{colour}" stroke-width="{width:g}"/>'
        )

    def bar(self, lane: str, start: int, end: int, colour: str) -> None:
        left, right = max(self.x(start), LEFT), min(self.x(end), RIGHT)
        if right > LEFT and left < RIGHT:
            width = max(right - left, 1.0)
            self.parts.append(
                f'<rect x="{left:g}" y="{top_of(lane)}" width="{width:.1f}" height="{BAR}" fill="{colour}"/>'
            )


def top_of(lane: str) -> int:
    """Where the bars of a lane begin."""
    return LANE_TOP + LANE * [name for name, _, _ in LANES].index(lane)


# station, its lane, what is said of it below the picture
WAY = (
    ("ae_update", "MCH", "the slot's task ae_update starts the transfer of the absolute encoder's word"),
    ("ae_read", "MCH interrupts", "14 µs later the word is there: interrupt ae_read"),
    ("MCH_ANGLE", "MCH", "the row's line makes a frame of the angle"),
    ("can_transmit", "MCH", "can_transmit asks the controller to send it"),
    ("frame up", "can1", "frame MCH_ANGLE on CAN1"),
    ("CSR received", "CSR", "the router's receive interrupt"),
    ("link up", "link", "the next exchange over the serial link takes it along"),
    ("MB received", "MB", "the main brain's interrupt at its end"),
    ("parse_ssp", "MB", "parse_ssp puts it into the data table, as soon as a slot begins"),
    ("estimator", "MB", "estimator and controller work with it"),
    ("send_ssp", "MB", "send_ssp sends the current that the hip shall have"),
    ("link down", "link", "back over the serial link"),
    ("CSR got", "CSR", "the router has it, its main loop routes it"),
    ("frame down", "can1", "frame MCH_COMMAND_CURRENT on CAN1"),
    ("MCH received", "MCH interrupts", "the hip board's receive interrupt"),
    ("dispatch", "MCH", "can_rx_dispatch_all hands it over, in the next slot"),
    ("control", "MCH", "mc_compliant_control sets the PWM: the motor feels it"),
)


def drawn() -> str:
    """The figure as SVG."""
    figure = Figure(json.loads(STEP_FILE.read_text(encoding="utf-8")))
    draw_axis(figure)
    draw_lanes(figure)
    draw_motor(figure)
    draw_way(figure)
    height = draw_legend(figure)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
            'font-family="Helvetica, Arial, sans-serif">',
            f'<rect width="{WIDTH}" height="{height}" fill="white"/>',
            *figure.parts,
            "</svg>",
            "",
        ]
    )


def draw_axis(figure: Figure) -> None:
    """Title, and a line every 100 µs."""
    stations = figure.stations
    angle, current = stations["value up"], stations["value down"]
    figure.text(20, 26, "The hip angle's way from the sensor to the motor", size=17, bold=True)
    at = figure.zero * 1e-9
    figure.text(
        RIGHT, 26, f"step {figure.kept['step']}, {at:.4f} s: {angle:.4f} rad up, {current:.3f} A down", "end", 13, SOFT
    )
    bottom = LANE_TOP + LANE * len(LANES) - 14
    for hundreds in range(0, int((figure.to_ns) // 100_000) + 1):
        x = figure.x(figure.zero + hundreds * 100_000)
        figure.line(x, AXIS_Y + 6, x, bottom)
        if hundreds % 2 == 0:
            figure.text(x, AXIS_Y, f"{hundreds / 10:g} ms" if hundreds else "0", "middle", 11, SOFT)


def draw_lanes(figure: Figure) -> None:
    """Names at the left, and pale everything that happened."""
    for lane, name, more in LANES:
        y = top_of(lane)
        figure.text(20, y + 11, name, bold=True)
        figure.text(20, y + (25 if name else 16), more, size=11, colour=SOFT)
        if lane not in ("edges", "duty"):
            figure.line(LEFT, y + BAR + 0.5, RIGHT, y + BAR + 0.5)
        for start, end, _ in figure.kept["lanes"].get(lane, []):
            figure.bar(lane, start, end, PALE)
    y = top_of("edges")
    figure.line(LEFT, y + BAR + 0.5, RIGHT, y + BAR + 0.5)
    for time in figure.kept["edges"]:
        if LEFT <= figure.x(time) <= RIGHT:
            figure.line(figure.x(time), y + 4, figure.x(time), y + BAR, SOFT, 1.2)


def draw_motor(figure: Figure) -> None:
    """The bridge's duty over time, as steps, scaled to what it is here."""
    times_ns, duties = figure.kept["duty"]
    low, high = min(duties), max(duties)
    bottom = top_of("duty") + BAR + 6
    points, last = [], None
    for time, duty in zip(times_ns, duties, strict=True):
        x = min(max(figure.x(time), LEFT), RIGHT)
        y = round(bottom - (duty - low) / ((high - low) or 1.0) * (BAR + 6), 1)
        points += [f"{x:g},{last:g}"] if last is not None else []
        points.append(f"{x:g},{y:g}")
        last = y
    points.append(f"{RIGHT},{last:g}")
    figure.parts.append(f'<polyline points="{" ".join(points)}" fill="none" stroke="{INK}" stroke-width="1.6"/>')
    figure.text(RIGHT, bottom + 16, f"duty from {100 * low:.1f} to {100 * high:.1f} % here", "end", 11, SOFT)


def middle(figure: Figure, station: str, lane: str, end: bool = False) -> tuple[float, float]:
    """Where an arrow touches a station: at its begin, or at its end."""
    start, stop = figure.stations[station]
    return figure.x(stop if end else start), top_of(lane) + BAR / 2


def draw_way(figure: Figure) -> None:
    """The stations in colour, an arrow from each to the next, and their numbers."""
    previous = None
    for station, lane, _ in WAY:
        start, end = figure.stations["controller" if station == "estimator" else station]
        figure.bar(lane, figure.stations[station][0], end, COLOURS[lane])
        here = middle(figure, station, lane)
        if previous is not None and abs(previous[0] - here[0]) + abs(previous[1] - here[1]) > 3:
            figure.line(*previous, *here, RED, 1.3)
        previous = (figure.x(end), here[1])
    control = middle(figure, "control", "MCH")
    figure.line(control[0], control[1], control[0], top_of("duty") + BAR + 6, RED, 1.3)
    badges: dict[str, float] = {}
    for number, (station, lane, _) in enumerate(WAY, start=1):
        start, end = figure.stations[station]
        x = max((figure.x(start) + figure.x(end)) / 2, badges.get(lane, 0.0) + 17)
        badges[lane] = x
        y = top_of(lane) - 9
        figure.parts.append(f'<circle cx="{x:g}" cy="{y}" r="8" fill="white" stroke="{COLOURS[lane]}"/>')
        figure.text(x, y + 4, str(number), "middle", 11, COLOURS[lane])


def draw_legend(figure: Figure) -> int:
    """What the numbers mean, and when; returns the height of the whole."""
    top = LANE_TOP + LANE * len(LANES) + 24
    half = (len(WAY) + 1) // 2
    for place, (station, lane, words) in enumerate(WAY):
        x = 20 + (place // half) * 600
        y = top + (place % half) * 22
        start = (figure.stations[station][0] - figure.zero) / 1000
        figure.parts.append(f'<circle cx="{x + 8}" cy="{y - 4}" r="8" fill="white" stroke="{COLOURS[lane]}"/>')
        figure.text(x + 8, y, str(place + 1), "middle", 11, COLOURS[lane])
        figure.text(x + 92, y, f"{start:.1f} µs", "end", 12, SOFT)
        figure.text(x + 102, y, words)
    return top + half * 22 + 6


if __name__ == "__main__":
    if "--record" in sys.argv:
        STEP_FILE.write_text(json.dumps(record(), separators=(",", ":")) + "\n", encoding="utf-8")
    FIGURE.write_text(drawn(), encoding="utf-8")
