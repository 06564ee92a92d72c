"""The comparison of a walk with its twins in lines, for the console and the page."""

from __future__ import annotations

from typing import Any

from ranger_sim.tools.diagnose import words

USUAL = 3.0  # deviations: a walk of a hundred features has few beyond it by chance
MOST = 6  # causes of a list that are in one line
RATES = {
    "full": "at the table's rate",
    "link": "at the data link's 50 Hz",
    "few": "by hip angle, leg angle and state alone",
}


def lines(answer: dict[str, Any]) -> list[str]:
    """A line each: what was compared, what was found, what ties, what could not be seen."""
    found = answer["evidence"].get("twins")
    if found is None:
        return []
    if found["note"]:
        return [f"twins: no comparison: {found['note']}"]
    alone = "twins: no equation can be made of these recordings: the twins alone judge them"
    floor_mm, (gain, distance) = 1e3 * found["floor_roughness_m"], found["limits"]
    out = [
        *([] if answer["misfit"] else [alone]),
        f"twins: {found['steps']} steps {RATES[found['rate']]} against sound walks of {found['controller']} on a floor "
        f"of {floor_mm:.1f} mm: distance {found['distance']:.2f} (sound below {distance:.2f}), likeliest cause gains "
        f"{found['gain']:.0f} (sound below {gain:.0f})",
    ]
    if found["other_parameters"]:
        names = shortened(found["other_parameters"])
        out.append(f"twins: parameters with other values than {found['controller']} has: {names}")
    if found["other_body"]:
        out.append("twins: the body has other numbers than these twins had: `ranger-sim twins` makes new ones")
    if not found["detected"]:
        out += [f"twins: a sound robot reaches this by itself: {cause(each)}" for each in found["habits"]]
        return out + visible(found)
    unusual = ", ".join(f"{name} {away:+.1f}" for name, away in found["unusual"][:3])
    out.append(f"twins: most unusual, in deviations of sound walks: {unusual}")
    if found["named"] is None:
        why = (
            "held-out steps do not have it"
            if found["refused_by_holdout"]
            else "what is left with it is not a sound walk"
        )
        nearest = cause(found["likeliest"][0])
        out.append(f"twins: the gait is not that of a sound robot; the nearest cause is {nearest}, and {why}")
    else:
        since = f", from step {found['since_step']} of the recording on" if found["since_step"] else ""
        out.append(f"twins: {cause(found['named'])}{since}")
    if found["emulations"]:
        out.append(f"twins: confirmed by {found['emulations']} emulations of causes at the sizes found")
    elif found["unconfirmed"]:
        out.append(f"twins: not confirmed by walks at the sizes found: {found['unconfirmed']}")
    if found["ties"]:
        out.append(f"twins: explains these steps as well: {shortened(found['ties'])}")
    if found["never_distinguished"]:
        out.append(f"twins: these channels can never distinguish it from {shortened(found['never_distinguished'])}")
    if found["held_out"] is not None:
        before, after = found["held_out"]
        out.append(f"twins: distance of the held-out steps {before:.2f}, with the cause {after:.2f}")
    return out


def summed_up(answer: dict[str, Any]) -> dict[str, Any]:
    """What other pages show of a walk's diagnosis: verdict, causes by name and size, lines, features in deviations."""
    kind, headline = words.verdict(answer)
    return {
        "kind": kind,
        "headline": headline,
        "causes": [cause(each) for each in answer["causes"]],
        "lines": [line.removeprefix("twins: ") for line in lines(answer)],
        "unusual": answer["evidence"]["twins"]["unusual"],
        "usual": USUAL,
    }


def cause(each: dict[str, Any]) -> str:
    """A cause with its size and interval."""
    sizes = ", ".join(
        f"{name} {value['value']:.4g} ({value['ci95'][0]:.4g} to {value['ci95'][1]:.4g})"
        for name, value in each["parameters"].items()
    )
    return f"{each['name']} at {each['at']}: {sizes}"


def visible(found: dict[str, Any]) -> list[str]:
    """The least sizes that would have been detected, a line for each kind of cause."""
    kinds: dict[str, list[str]] = {}
    for name, size in sorted(found["smallest_visible"].items()):
        kind, place, parameter = parts(name)
        kinds.setdefault(f"{kind} ({parameter})", []).append(f"{place} {size:.2g}")
    out = ["twins: would have been detected from these sizes on:"] if kinds else []
    out += [f"twins:   {kind}: {', '.join(sizes)}" for kind, sizes in kinds.items()]
    if found["cannot_be_seen"]:
        out.append(f"twins: not shown by these channels: {'; '.join(found['cannot_be_seen'])}")
    return out


def parts(name: str) -> tuple[str, str, str]:
    """Cause, place and parameter of "cause at place: parameter"."""
    cause, _, rest = name.partition(" at ")
    place, _, parameter = rest.partition(": ")
    return cause, place, parameter


def shortened(names: list[str]) -> str:
    """The first names of a list."""
    more = len(names) - MOST
    return ", ".join(names[:MOST]) + (f" and {more} more" if more > 0 else "")
