"""The page of `ranger-sim diagnose`: the fault, where it shows, how certain it is, and what to check."""

from __future__ import annotations

import pathlib
from typing import Any

import jinja2
from markupsafe import Markup, escape

from ranger_sim.sysid import inspection, predicted_ties
from ranger_sim.sysid.diagnosis import Diagnosis
from ranger_sim.sysid.naming import Named
from ranger_sim.tools.diagnose import figures, twin_figure, twin_words, words
from ranger_sim.tools.report.figures import library

HERE = pathlib.Path(__file__).parent
MOST_RIVALS = 6
NOTABLE = 0.02  # of a regime's residual that repeats: lower shares occur by chance


def render(found: Diagnosis, command: str = "", files: dict[str, str] | None = None) -> str:
    """The page as text. command: repeats the diagnosis; files: {name: description} of files next to the page."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=jinja2.select_autoescape(["j2"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["figure"] = lambda value: f"{value:.4g}"
    environment.filters["share"] = lambda value: f"{100.0 * value:.0f} %"
    environment.filters["breakable"] = breakable
    environment.filters["small"] = lambda value: "below 1e-300" if value == 0.0 else f"{value:.2g}"
    answer = found.answer
    evidence = answer["evidence"]
    sides = figures.sides(found)
    kind, headline = words.verdict(answer)
    telling = figures.telling(found, sides) if answer["detected"] else None
    over_time = [figures.two_sides(found, side) for side in list(sides.values())[: figures.MOST_EQUATIONS]]
    return environment.get_template("template.html.j2").render(
        answer=answer,
        evidence=evidence,
        name=found.machine.name,
        recordings=[recording.table.name for recording in found.recordings],
        samples=sum(len(recording.table) for recording in found.recordings),
        kind=kind,
        headline=headline,
        told=words.in_sentences(found),
        errors=evidence.get("held_out_errors") or {},
        twins=twin_words.lines(answer),
        unusual=twin_figure.unusual(evidence.get("twins")),
        unseen=sorted((evidence.get("smallest_visible") or {}).items()),
        numerics=words.numerics(answer),
        causes=[cause_of(found, each, cause, sides) for each, cause in named(found)],
        telling=telling,
        over_time=over_time,
        parameters=parameters(found),
        notable=[each for each in answer["misfit"] if each["regime"] == "all" or each["repeatable_fraction"] > NOTABLE],
        gain=gain_of(answer),
        steps=words.next_steps(found),
        command=command,
        files=files or {},
        library=library(),
    )


def breakable(identifier: str) -> Markup:
    """An identifier that may go on in the next line after each of its underscores."""
    return Markup(str(escape(identifier)).replace("_", "_<wbr>"))


def named(found: Diagnosis) -> list[tuple[Named, dict[str, Any]]]:
    """The effects that the equations name with the answer's entry for each; empty when it abstains."""
    effects = {(each.effect.cause, each.effect.at): each for each in reversed(found.named)}
    causes = [(effects.get((cause["name"], cause["at"])), cause) for cause in found.answer["causes"]]
    return [(each, cause) for each, cause in causes if each is not None]


def cause_of(found: Diagnosis, each: Named, cause: dict[str, Any], sides: dict[str, figures.Sides]) -> dict[str, Any]:
    """All data on the page about one cause."""
    rivals = sorted(cause["evidence"]["behind"].items(), key=lambda pair: pair[1])[:MOST_RIVALS]
    tied = {tie.name: tie for tie in each.tied}
    looks = {each.effect.name: inspection.look_at(cause["name"], cause["at"])}
    looks |= {name: inspection.look_at(tie.cause, tie.at) for name, tie in tied.items()}
    return {
        "name": cause["name"],
        "at": cause["at"],
        "balance": cause["balance"],
        "meaning": words.meaning(found, cause),
        "parameters": cause["parameters"],
        "waves": cause.get("waves", {}),
        "chi2": cause["evidence"]["chi2"],
        "p": cause["evidence"]["p"],
        "bic": cause["evidence"]["bic"],
        "predicted": [
            f"{line[0].upper()}{line[1:]}" for line in predicted_ties.described(cause["evidence"]["predicted"])
        ],
        "rivals": [
            {"name": name, "behind": behind, "standing": "a tie" if name in tied else words.standing(behind)}
            for name, behind in rivals
        ],
        "figure": figures.of_cause(found, each, sides),
        "looks": once(looks),
    }


def once(texts: dict[str, str]) -> dict[str, str]:
    """Each text under the first of its names; empty ones left out."""
    first: dict[str, str] = {}
    for name, text in texts.items():
        if text and text not in first.values():
            first[name] = text
    return first


def parameters(found: Diagnosis) -> list[dict[str, Any]]:
    """The machine's own parameters: simulated and fitted values."""
    values = found.answer["evidence"]["parameters"]
    known = {each.name: each for each in found.machine.parameters}
    impossible = found.answer["evidence"]["impossible"]
    rows = []
    for name, fitted in values.items():
        each = known.get(name)
        rows.append(
            {
                "name": name,
                "unit": each.unit if each else "",
                "meaning": each.meaning if each else "",
                "simulation": each.value if each else None,
                **fitted,
                "differs": each is not None and not fitted["ci95"][0] <= each.value <= fitted["ci95"][1],
                "impossible": name in impossible,
            }
        )
    return rows


def gain_of(answer: dict[str, Any]) -> dict[str, Any] | None:
    """The gain with the ends of its bar, all within 0 and 1; None when nothing was named that could gain."""
    gain = answer["gain"]
    if gain is None or not answer["causes"]:
        return None
    low, high = gain["ci95"]
    ends = [min(1.0, max(0.0, each)) for each in (low, high, gain["fraction_of_achievable"])]
    return {**gain, "low": low, "high": high, "left": ends[0], "width": max(0.004, ends[1] - ends[0]), "at": ends[2]}
