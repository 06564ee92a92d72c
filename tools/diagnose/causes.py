"""`ranger-sim causes`: the catalogue of causes, and what the channels of an experiment can show of it.

Without an experiment the catalogue; with one, before any data: which causes its channels show, which they do not, which
look alike and why, and which other channel or experiment would separate them.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

from rich.table import Table

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import causes, channels, inspection
from ranger_sim.tools.command_line import terminal

REASONS = {
    "structure": "no equation shows one without the other, and they look alike",
    "signature": "equations could show one without the other, but they look alike once the parameters are fitted",
}


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "causes",
        description="Without --experiment the catalogue of causes. With it: which causes its channels can show and "
        "distinguish, before any data are taken.",
    )
    command.add_argument("cause", nargs="?", metavar="CAUSE", help="everything about one cause")
    command.add_argument("--experiment", metavar="NAME", help=f"one of {', '.join(channels.EXPERIMENTS)}")
    command.add_argument(
        "--channels", nargs="+", metavar="CHANNEL", help="what is measured (default: all that the experiment has)"
    )
    command.add_argument("--json", action="store_true", help="print JSON instead of text")
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the catalogue, one cause, or what channels can show."""
    if options.channels and options.experiment is None:
        raise UserError("--channels: of which experiment? give --experiment NAME")
    if options.experiment is not None:
        if options.cause is not None:
            raise UserError(f"{options.cause}: either one cause or an experiment, not both")
        told = analysis_json(options.experiment, options.channels)
        print(json.dumps(told, indent=2)) if options.json else print_analysis(told)
        return 0
    chosen = list(causes.CAUSES.values()) if options.cause is None else [causes.find(options.cause)]
    if options.json:
        told_causes = [{**causes.as_json(cause), "look_at": inspection.LOOK_AT[cause.key]} for cause in chosen]
        print(json.dumps(told_causes, indent=2))
    elif options.cause is None:
        print_catalogue()
    else:
        print_cause(chosen[0])
    return 0


def print_catalogue() -> None:
    """All causes as a table."""
    console = terminal.console(highlight=False)
    table = Table(box=None, pad_edge=False)
    for heading in ("no.", "cause", "balance", "what it is"):
        table.add_column(heading, overflow="fold", no_wrap=heading == "cause")
    for cause in causes.CAUSES.values():
        table.add_row(str(cause.number), cause.key, " ".join(cause.balances), cause.meaning)
    console.print(table)
    console.print()
    for letter, meaning in causes.BALANCES.items():
        console.print(f"{letter}  {meaning}", soft_wrap=True, markup=False)


def print_cause(cause: causes.Cause) -> None:
    """Everything about one cause, as text."""
    print(f"{cause.key} (number {cause.number}): {cause.meaning}")
    print(f"balances: {'; '.join(causes.BALANCES[letter] for letter in cause.balances)}")
    print(f"signature: {cause.signature}")
    print(f"look at: {inspection.LOOK_AT[cause.key]}")
    print(f"similar: {', '.join(causes.rivals(cause)) or 'nothing that is known'}")
    print(f"in a model file: {f'form = {cause.form!r}' if cause.form else 'there is no form for it yet'}")
    from ranger_sim.sysid import isolability  # with scipy, which a first `make walk` does without

    for name in channels.EXPERIMENTS:
        status = isolability.analyse(name).status.get(cause.key)
        if status is not None:
            print(f"by {name} with all its channels: {status}")


def analysis_json(experiment: str, given: list[str] | None) -> dict[str, Any]:
    """What channels can show, for programs."""
    from ranger_sim.sysid import isolability

    analysis = isolability.analyse(experiment, given)
    model = isolability.model_of(experiment)
    rows = [
        {
            "cause": cause,
            "number": causes.CAUSES[cause].number,
            "status": analysis.status[cause],
            "at": model.places.get(cause),
            "left_by_fitted_parameters": round(analysis.left[cause], 4),
            "separate_by_structure": len(analysis.by_structure.get(cause, ())),
        }
        for cause in causes.CAUSES
        if cause in analysis.status
    ]
    ties = [
        {"causes": [tie.first, tie.second], "reason": tie.reason, "cosine": round(tie.cosine, 4)}
        for tie in analysis.ties
    ]
    helps = [
        {
            "causes": list(each.causes),
            "channels": list(each.channels),
            "experiments": list(each.experiments),
            "motion": each.motion or None,
        }
        for each in isolability.advice(analysis)
    ]
    return {
        "experiment": experiment,
        "channels": list(analysis.channels),
        "excitation": model.excitation,
        "causes": rows,
        "ties": ties,
        "not_in_this_experiment": [cause for cause in causes.CAUSES if cause not in analysis.status],
        "what_would_help": helps,
    }


def print_analysis(told: dict[str, Any]) -> None:
    """The same for a person."""
    console = terminal.console(highlight=False)

    def tell(text: str = "") -> None:
        console.print(text, soft_wrap=True)

    tell(f"{told['experiment']} by {', '.join(told['channels'])}")
    tell(f"on a reference motion: {told['excitation']}")
    from ranger_sim.sysid import isolability

    headings = {
        isolability.SHOWN: "These channels show, whatever the fitted parameters are",
        isolability.AS_PARAMETER: "Seen only as another value of a fitted parameter, against its known value",
        isolability.HIDDEN: "Not shown by these channels",
    }
    for status, heading in headings.items():
        names = [f"{each['cause']} (at {each['at']})" if each["at"] else each["cause"] for each in told["causes"]
                 if each["status"] == status]  # fmt: skip
        tell(f"\n{heading} ({len(names)}):")
        tell(f"    {', '.join(names) or 'none'}")
    tell(f"\nNot distinguished ({len(told['ties'])} pairs):")
    for tie in told["ties"]:
        tell(f"    {' and '.join(tie['causes'])}: {REASONS[tie['reason']]} (cosine {tie['cosine']:.3f})")
    helps = told["what_would_help"]
    tell(f"\nNot a part of this experiment ({len(told['not_in_this_experiment'])}):")
    tell(f"    {', '.join(told['not_in_this_experiment']) or 'none'}")
    tell("\nWhat would help:" if helps else "\nNothing here needs another channel.")
    for text, names in grouped(helps).items():
        tell(f"    {', '.join(names)}: {text}")


def grouped(helps: list[dict[str, Any]]) -> dict[str, list[str]]:
    """{advice in words: what it is for}, so that one advice is printed once."""
    found: dict[str, list[str]] = {}
    for each in helps:
        parts = []
        if each["channels"]:
            which = "the channel" if len(each["channels"]) == 1 else "one of the channels"
            parts.append(f"{which} {', '.join(each['channels'])}")
        if each["motion"]:
            parts.append(each["motion"])
        if each["experiments"]:
            parts.append(f"the experiment {' or '.join(each['experiments'])}")
        text = ", or ".join(parts) or "nothing that is known here: another motion of the same experiment may"
        found.setdefault(text, []).append(" against ".join(each["causes"]))
    return found
