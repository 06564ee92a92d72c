"""`ranger-sim faults`: every place where a fault can be injected, its modes, and the reasons against others.

`python -m ranger_sim.tools.faults` writes the tables of docs/faults.md anew; a test compares them.
"""

import argparse
import json
import math
import pathlib
from typing import Any

from rich.console import Console
from rich.table import Table

from ranger_sim.harness.faults.catalogue import MODES
from ranger_sim.harness.faults.fault import Fault, Parameter, Place
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.tools.command_line import terminal
from ranger_sim.tools.command_line.options import Option
from ranger_sim.tools.command_line.units import word

DOCUMENT = pathlib.Path(__file__).resolve().parent.parent / "docs" / "faults.md"
EXIT_INVALID = 3  # of a run in which a fault did not act: it shows nothing
TABLES_BEGIN = "<!-- written by python -m ranger_sim.tools.faults: begin -->\n"
TABLES_END = "<!-- end -->\n"

FAULT = Option(
    "--fault",
    'inject a fault: "MCH.joint_encoder:stuck@step 12..step 14"; may be given several times; exit code 3 when one '
    "did not act; ranger-sim faults lists places and modes",
    word("PLACE:MODE"),
    "TEXT",
    repeated=True,
)
MODULE = Option(
    "--fault-module",
    "a .py file with fault modes or places of your own (docs/faults.md); may be given several times",
    word("a .py file"),
    "FILE",
    repeated=True,
)


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "faults",
        description="Without PLACE, all places and the modes of each; with PLACE, its modes and their parameters.",
    )
    command.add_argument("place", nargs="?", metavar="PLACE", help="a place, as MCH.joint_encoder")
    command.add_argument("--json", action="store_true", help="print JSON instead of tables")
    MODULE.add(command)
    command.set_defaults(run=run)


def load_modules(options: argparse.Namespace) -> None:
    """Fill the catalogue, with the user's modules."""
    CATALOGUE.load()
    for name in options.fault_module:
        CATALOGUE.load_file(name)


def run(options: argparse.Namespace) -> int:
    """Print the catalogue, or one place of it."""
    load_modules(options)
    places = list(CATALOGUE.places.values())
    if options.place is not None:
        places = [CATALOGUE.find(options.place)]
    if options.json:
        print(json.dumps([place_json(place) for place in places], indent=2))
        return 0
    console = terminal.console(highlight=False)
    if options.place is None:
        table = Table(box=None, pad_edge=False)
        table.add_column("place", no_wrap=True)
        table.add_column("what it is, and the modes that it takes", overflow="fold")
        for place in places:
            table.add_row(place.name, f"{place.what}\n{', '.join(CATALOGUE.modes_of(place))}")
        console.print(table)
        console.print("\nranger-sim faults PLACE prints what they do, and their parameters", soft_wrap=True)
        return 0
    print_place(places[0], console)
    return 0


def print_place(place: Place, console: Console) -> None:
    """Modes of one place with their parameters, where these come from, and what it refuses."""

    def show(text: str) -> None:
        console.print(text, soft_wrap=True)

    show(f"{place.name}: {place.what}")
    sources: dict[str, list[str]] = {}
    for name, kind in CATALOGUE.modes_of(place).items():
        show(f"\n{name:20}{kind.meaning}")
        if kind.permanent:
            show(f"{'':20}stays until: {kind.permanent}")
        for p in kind.parameters:
            unit = "" if p.unit in ("1", "name") else f" {p.unit}"
            show(f"    {p.name:16}{default_text(p)}{unit} ({limits_text(p)}): {p.meaning}")
            sources.setdefault(p.source, []).append(f"{name} {p.name}")
    units = sorted({kind.unit for kind in CATALOGUE.modes_of(place).values() if kind.unit})
    show(f"\nThe difference at the place is given in {' or '.join(units)}. Where the numbers come from:")
    for source, parameters in sources.items():
        show(f"    {', '.join(parameters)}: {source}")
    if reasons := refused(place):
        show("\nWhat cannot act there:")
        for name, reason in reasons.items():
            show(f"    {name:20}{reason}")


def refused(place: Place) -> dict[str, str]:
    """Modes that other places take and this one does not, with the reason."""
    names = sorted({name for _, name in MODES})
    return {name: reason for name in names if (reason := CATALOGUE.refusal(place, name))}


def default_text(parameter: Parameter) -> str:
    """The default as printed; nothing where the parameter's meaning contains it."""
    if isinstance(parameter.default, str):
        return parameter.default or "none"
    return "none" if math.isnan(parameter.default) else f"{parameter.default:g}"


def limits_text(parameter: Parameter) -> str:
    """A parameter's limits as printed; for a name, the word "name"."""
    return "a name" if isinstance(parameter.default, str) else f"{parameter.low:g} to {parameter.high:g}"


def place_json(place: Place) -> dict[str, Any]:
    """A place as plain data, for programs."""
    return {
        "place": place.name,
        "kind": place.kind,
        "what": place.what,
        "modes": [mode_json(name, kind) for name, kind in CATALOGUE.modes_of(place).items()],
        "refused": refused(place),
    }


def mode_json(name: str, kind: type[Fault]) -> dict[str, Any]:
    """A mode as plain data."""
    return {
        "mode": name,
        "meaning": kind.meaning,
        "unit": kind.unit,
        "permanent": kind.permanent or None,
        "parameters": [
            {
                "name": p.name,
                "unit": p.unit,
                "default": None if default_text(p) == "none" else p.default,
                "low": p.low,
                "high": p.high,
                "meaning": p.meaning,
                "source": p.source,
            }
            for p in kind.parameters
        ],
    }


# --- what became of them --------------------------------------------------------------------------------------


def fault_text(fault: dict) -> str:
    """The course of a fault, in a line; for one that did not act, why the run shows nothing about it."""
    name = f"fault {fault['fault']}"
    if fault["gave_way_s"] is not None:
        return (
            f"{name}: INVALID, it gave way at {fault['gave_way_s']:.6g} s: {fault['gave_way_to']}; one fault at a time"
        )
    if fault["activated_s"] is None:
        return f"{name}: INVALID, it did not begin: its start condition never became true"
    begun = f"{name}: began at {fault['activated_s']:.6g} s"
    ended = "" if fault["ended_s"] is None else f", ended at {fault['ended_s']:.6g} s"
    if not fault["acted"]:
        return f"{begun}{ended}: INVALID, it did not act: its place never differed from what it shows without it"
    acted = f", acted from {fault['acted_s']:.6g} s on ({fault['acted_count']} times, up to "
    acted += f"{fault['largest_difference']:.6g} {fault['unit']})".replace(" )", ")")
    if fault["ended_s"] is None:
        cleared = ""
    elif fault["cleared_s"] is None:
        cleared = ", its place is not clear yet"
    else:
        cleared = f", its place was clear at {fault['cleared_s']:.6g} s"
    permanent = f"; what stays: {fault['permanent']}" if fault["permanent"] else ""
    return f"{begun}{acted}{ended}{cleared}{permanent}{proof_text(fault['proof'])}"


def proof_text(proof: dict | None) -> str:
    """The differences from the run without the fault; nothing without a golden run."""
    if proof is None:
        return ""
    first, detected, reacted = proof["first_difference"], proof["detected"], proof["reaction"]
    without = "it" if proof["of_faults"] == 1 else f"the {proof['of_faults']} faults, from the first one's beginning on"
    if first is None:
        return f"; against the run without {without}: NO EFFECT, nothing that the firmware sends differs"
    parts = [f"{first['name']} differs after {first['after_ms']:.4g} ms ({first['where']})"]
    if detected is None:
        parts.append("no error reports it")
    else:
        more = ", more often than without" if detected["rate"] else ""
        parts.append(
            f"reported by {detected['code']} from {detected['board']}{more} after {proof['detection_ms']:.4g} ms"
        )
    if reacted is not None:
        instead = f"{reacted['machine']} in {reacted['state']} instead of {reacted['instead_of']}"
        parts.append(f"{instead} after {proof['reaction_ms']:.4g} ms")
    if proof["fall_ms"] is not None:
        parts.append(f"fell after {proof['fall_ms']:.4g} ms")
    return f"; against the run without {without}: {', '.join(parts)}"


# --- the tables of docs/faults.md -----------------------------------------------------------------------------


def markdown() -> str:
    """The tables of docs/faults.md: kinds of places, their modes and parameters."""
    CATALOGUE.load()
    kinds: dict[str, list[Place]] = {}
    for place in CATALOGUE.places.values():
        kinds.setdefault(place.kind, []).append(place)
    return "\n".join(line for kind, places in sorted(kinds.items()) for line in kind_lines(kind, places))


def kind_lines(kind: str, places: list[Place]) -> list[str]:
    """One kind of place: its places and modes."""
    unit = next((mode.unit for mode in CATALOGUE.modes_of(places[0]).values() if mode.unit), "")
    lines = [f"### {kind}{f', in {unit}' if unit else ''}", ""]
    lines += [f"{', '.join(f'`{place.name}`' for place in places)}", ""]
    lines += ["| mode | what it does | parameters: default (limits) |", "|---|---|---|"]
    for name, mode in CATALOGUE.modes_of(places[0]).items():
        parameters = "; ".join(
            f"`{p.name}` {default_text(p)} ({limits_text(p)}{f' {p.unit}' if p.unit not in ('1', 'name') else ''})"
            for p in mode.parameters
        )
        lines.append(f"| `{name}` | {mode.meaning} | {parameters} |")
    return [*lines, ""]


def with_tables(text: str) -> str:
    """The document with the tables of the present catalogue."""
    before, _, rest = text.partition(TABLES_BEGIN)
    _, _, after = rest.partition(TABLES_END)
    return f"{before}{TABLES_BEGIN}\n{markdown()}\n{TABLES_END}{after}"


def write_document() -> None:
    """Write the tables of docs/faults.md anew."""
    DOCUMENT.write_text(with_tables(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"written: {DOCUMENT.name}")


if __name__ == "__main__":
    write_document()
