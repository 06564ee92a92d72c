"""The sentences of a diagnosis: the same on the console, in the page, and for the person who repairs the machine."""

from __future__ import annotations

from typing import Any

from ranger_sim.sysid import inspection, plausibility
from ranger_sim.sysid.diagnosis import Diagnosis
from ranger_sim.sysid.machine import PARAMETER
from ranger_sim.sysid.naming import PAYS, TIE


def sentence(found: Diagnosis) -> str:
    """The fault, in one sentence."""
    answer = found.answer
    name = found.machine.name
    if doubts(answer):
        return f"{name}: {doubted(answer)}."
    if not answer["detected"]:
        return f"{name}: {nothing(answer)}."
    if answer["abstained"] and answer["subsystem"] == "gait":
        likeliest = " or ".join(answer["evidence"]["suspects"])
        return (
            f"{name}: the gait is not that of a sound robot, and no cause of the catalogue explains it; the nearest: "
            f"{likeliest}."
        )
    if answer["abstained"]:
        suspects = answer["evidence"]["suspects"]
        also = f"; {', '.join(suspects)} would explain {answer['evidence']['explained']:.0%} of it" if suspects else ""
        return (
            f"{name}: something is wrong in the {answer['subsystem']} part, and no cause of the catalogue explains it"
            f"{also}.{learned(answer)} Fitted parameters are not physical until it is resolved."
        )
    names = " and ".join(f"{each['name']} at {each['at']}{_size(each)}" for each in answer["causes"])
    part = answer["subsystem"]
    what = "a parameter changes during the run" if part == PARAMETER else f"the {part} part is wrong"
    return f"{name}: {what}: {names}{_gained(answer)}{_more_left(answer)}."


def _size(cause: dict[str, Any]) -> str:
    """How large a cause is and how sure: its values with their 95 % intervals, after a comma."""
    values = (
        f"{name} {each['value']:.4g} ({each['ci95'][0]:.4g} to {each['ci95'][1]:.4g})"
        for name, each in sizes(cause).items()
    )
    return "".join(f", {each}" for each in values)


def _gained(answer: dict[str, Any]) -> str:
    """The errors of the equation that gains most on held-out data, after a semicolon; "" without such data."""
    errors = answer["evidence"].get("held_out_errors") or {}
    if not errors:
        return ""
    name = min(errors, key=lambda each: errors[each]["after"] / max(errors[each]["before"], 1e-300))
    return f"; {_errors(name, errors[name], named=True)}"


def _more_left(answer: dict[str, Any]) -> str:
    """What is left far above the noise with the causes in the model, after a semicolon; "" where nothing is."""
    above = answer["evidence"].get("above_noise_floor")
    return f"; {'; '.join(_left(answer['evidence'], name) for name in above)}: more is missing" if above else ""


def _errors(name: str, each: dict[str, Any], named: bool) -> str:
    """The errors of an equation on held-out data: before, after where causes are named, and of a black box."""
    text = f"held-out error of {name}: {each['before']:.2%} before"
    text += f", {each['after']:.2%} after" if named else ""
    return text + (f", {each['black_box']:.2%} by a black box" if each["black_box"] is not None else "")


def nothing(answer: dict[str, Any]) -> str:
    """The sentence for a diagnosis without a finding; a residual far above the noise does not prove a sound machine."""
    evidence = answer["evidence"]
    if lacking := evidence.get("learnable"):
        errors = evidence["held_out_errors"]
        shares = "; ".join(
            f"a black box of the training data leaves {errors[name]['black_box']:.2%} of the held-out {name}, where "
            f"the equation leaves {errors[name]['before']:.2%}"
            for name in lacking
        )
        return f"no shape of the catalogue explains what is missing: {shares}"
    if short := evidence.get("too_short_s"):
        name, needed_s = max(short.items(), key=lambda one: one[1])
        return (
            f"too short for this noise: what the {name} equation leaves is so slow that these recordings have fewer "
            f"than 20 independent stretches of it, and nothing is concluded; {needed_s:g} s like these would be enough"
        )
    if above := evidence.get("above_noise_floor"):
        return (
            f"no cause was found, and {'; '.join(_left(evidence, name) for name in above)}: something may be missing "
            "that no candidate explains"
        )
    if evidence["impossible"]:
        return (
            "no cause was found, and the equations fit only with values that no machine has: the model lacks "
            "something, or a channel is not what its name says"
        )
    if "smallest_visible" in evidence:  # in the noise of all candidates, where p is that of its own tests
        return "nothing that these data could show is missing from the equations"
    return f"nothing that these data could show is missing from the equations (p {evidence['p_general']:.2g})"


def _left(evidence: dict[str, Any], name: str) -> str:
    """What an equation leaves and its noise, in words."""
    each = evidence["noise_floor"][name]
    where = " of the held-out data" if each["held_out"] else ""
    return (
        f"the {name} equation leaves {each['left']:.3g} {each['unit']}{where}, "
        f"{each['left'] / max(each['channel'], 1e-300):.3g} times its channels' own noise of {each['channel']:.3g}"
    )


def held_out(answer: dict[str, Any]) -> list[str]:
    """The three errors on held-out data, an equation a line; empty without held-out data."""
    errors = answer["evidence"].get("held_out_errors") or {}
    return [_errors(name, each, bool(answer["causes"])) for name, each in errors.items()]


def unseen(answer: dict[str, Any]) -> list[str]:
    """What these channels cannot show, and the smallest sizes that they could; empty where a cause was found."""
    evidence = answer["evidence"]
    if answer["causes"] or "smallest_visible" not in evidence:
        return []
    lines = [
        f"{name} would have been named from {', '.join(f'{key} {size:.3g}' for key, size in sizes.items())} on"
        for name, sizes in evidence["smallest_visible"].items()
    ]
    if evidence["cannot_be_seen"]:
        lines.append(f"not distinguishable from the machine's own parameters: {', '.join(evidence['cannot_be_seen'])}")
    return lines


def between_rows(answer: dict[str, Any]) -> list[str]:
    """How a simulated machine's inputs go from a row to the next, a recording a line."""
    return [
        f"between rows of {recording}: {', '.join(f'{name} {way}' for name, way in ways.items())}"
        for recording, ways in answer["evidence"].get("between_rows", {}).items()
    ]


def numerics(answer: dict[str, Any]) -> list[str]:
    """What the simulator's own numerics move, a cause a line, and what is not named because of them."""
    lines = []
    for each in answer["causes"]:
        if moved := each["evidence"].get("moved_by_numerics"):
            sizes = ", ".join(f"{name} by {size:.2g}" for name, size in moved.items())
            lines.append(f"{each['name']} at {each['at']}: half the step and other ways between samples move {sizes}")
    lines += [
        f"{name} is hardly larger than what the simulator's numerics, and other ways of its inputs between rows, "
        "move it by: not named"
        for name in answer["evidence"].get("below_numerics", ())
    ]
    return lines


def learned(answer: dict[str, Any]) -> str:
    """The learned term in a sentence that begins with a space, or nothing."""
    term = answer["evidence"].get("residual_term")
    if term is None:
        return ""
    size = max(abs(each) for row in term["value"] for each in row)
    over = " and ".join(term["over"])
    return f" A term learned over {over} is up to {size:.3g} {term['unit']} in the {term['equation']} equation."


def doubts(answer: dict[str, Any]) -> list[dict[str, Any]]:
    """The findings after which no cause is named; none of them where the gait has one all the same."""
    if answer["causes"]:
        return []
    return [each for each in answer["data_findings"] if each["kind"] in plausibility.FORBID]


def doubted(answer: dict[str, Any]) -> str:
    """These in a sentence."""
    told = "; ".join(": ".join(filter(None, (each["channel"], each["text"]))) for each in doubts(answer))
    return f"no cause is named: {told}"


def verdict(answer: dict[str, Any]) -> tuple[str, str]:
    """(class, headline) for the page."""
    if answer["evidence"].get("learnable"):
        return "unknown", "Something is missing, and no shape of the catalogue explains it"
    if answer["evidence"].get("too_short_s"):
        return "unknown", "Too short for this noise"
    if not answer["detected"] and answer["evidence"].get("above_noise_floor"):
        return "unknown", "Nothing found, and far more is left than noise"
    if not answer["detected"]:
        return "sound", "Nothing found"
    if doubts(answer):
        return "unknown", "These data and this model do not belong together"
    if answer["abstained"]:
        return "unknown", "Something is wrong, and it is not known what"
    count = len(answer["causes"])
    return "found", "One cause found" if count == 1 else f"{count} causes found"


def in_sentences(found: Diagnosis) -> str:
    """The fault in one sentence of plain words, for the top of the page."""
    answer = found.answer
    if doubts(answer):
        text = doubted(answer)
        return f"{text[0].upper()}{text[1:]}."
    if not answer["detected"]:
        text = nothing(answer)
        return f"{text[0].upper()}{text[1:]}."
    if answer["abstained"] and answer["subsystem"] == "gait":
        near = " or ".join(answer["evidence"]["suspects"])
        return f"The gait is not that of a sound robot, and no cause of the catalogue explains it; the nearest: {near}."
    if answer["abstained"]:
        also = ""
        if answer["evidence"]["suspects"]:
            share = answer["evidence"]["explained"]
            also = f"; the nearest, {', '.join(answer['evidence']['suspects'])}, would explain {share:.0%} of it"
        refused = answer["evidence"].get("refused_by_holdout", ())
        if refused and not also:
            also = f"; {', '.join(refused)} fits these data and not the held-out ones"
        part = answer["subsystem"]
        return f"The {part} part behaves otherwise than its equations, and no cause of the catalogue explains it{also}."
    parts = []
    for each in answer["causes"]:
        ties = each["evidence"]["ties"]
        tied = f" (or {', '.join(ties)}: these data cannot decide)" if ties else ""
        words = meaning(found, each)
        parts.append(f"{words[0].upper()}{words[1:]}: {each['name']} at {each['at']}{tied}.")
    return " ".join(parts)


def sizes(cause: dict[str, Any]) -> dict[str, Any]:
    """A cause's values by name; a cosine and a sine as their amplitude and phase."""
    waves = cause.get("waves", {})
    pairs = ("cosine", "sine") if waves else ()
    return waves | {name: value for name, value in cause["parameters"].items() if not name.startswith(pairs)}


def meaning(found: Diagnosis, cause: dict[str, Any]) -> str:
    """A named cause in words."""
    for each in found.named:
        if (each.effect.cause, each.effect.at) == (cause["name"], cause["at"]) and each.effect.meaning:
            return each.effect.meaning
    return inspection.meaning(cause["name"], cause["at"])


def standing(behind: float) -> str:
    """How far a rival that is not a tie is behind, in words; the limits are those of the naming."""
    if behind < TIE:  # and not a tie: the naming checks whether the value is possible
        return "as near, with a value that no machine has"
    return "close" if behind < PAYS else "behind"


def next_steps(found: Diagnosis) -> list[str]:
    """The next measurements; if the diagnosis proposes none, those that follow from its outcome."""
    answer = found.answer
    steps = list(answer["next_experiment"])
    if steps and not answer["abstained"]:
        return steps
    if not answer["detected"]:
        return [
            "Nothing is asked for. What other channels or another motion could show: "
            f"ranger-sim causes --experiment {found.machine.name}."
        ]
    if answer["abstained"]:
        worst = max(
            (each for each in answer["misfit"] if each["regime"] != "all"),
            key=lambda each: each["repeatable_fraction"],
            default=None,
        )
        where = f" with more of the regime '{worst['regime']}', where most of it shows," if worst else ""
        return [
            f"The same run once more{where}: what repeats is the machine's, what does not is noise.",
            *([f"The learned term:{learned(answer)}"] if learned(answer) else []),
            "Each part alone: what still shows with the load off, or with the motor off and the load moved by hand?",
            *steps,
        ]
    if answer["gain"] is None:
        return ["Another run, given as --holdout: a cause that is real makes the model better there as well."]
    return ["Nothing more is needed to distinguish this cause from its rivals."]
