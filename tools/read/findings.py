"""What was found in a recording and what is proposed, in lines for the console and the page."""

from ranger_sim.sysid import sanity
from ranger_sim.sysid.reading import Measurement

MOST_NAMED = 3  # channels in a line


def lines_of(measurement: Measurement) -> list[tuple[str, str]]:
    """("finding", "note" or "proposal", text), what matters first; what several channels have is one line."""
    channels: dict[tuple[str, str], list[str]] = {}
    for each in sorted(measurement.findings, key=lambda finding: finding.severity == sanity.NOTE):
        place = f"{each.start_s:.6g} to {each.end_s:.6g} s: " if each.end_s > each.start_s else ""
        if each.kind in ("no_unit", "unknown_unit"):
            place = ""  # of the channel as a whole
        mark = "note" if each.severity == sanity.NOTE else "finding"
        channels.setdefault((mark, place + each.text), []).append(each.channel)
    for repair in measurement.proposals:
        residual = "" if repair.residual is None else f", residual {repair.residual:.3g} {repair.unit}".rstrip()
        share = f", {measurement.share_of(repair):.2%} of its samples" if repair.count else ""
        option = f" ({repair.option})" if repair.option else ""
        channels.setdefault(("proposal", repair.text + residual + share + option), []).append(repair.channel)
    found = []
    for (mark, text), names in channels.items():
        whose = called(names)
        found.append((mark, f"{whose}: {text}" if whose else text))
    return found


def called(names: list[str]) -> str:
    """Channels by name, the first of them where there are many; empty for the recording as a whole."""
    first = ", ".join(name for name in names[:MOST_NAMED] if name)
    return first + (f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else "")
