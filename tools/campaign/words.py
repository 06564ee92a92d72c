"""A result in words."""

from typing import Any

from ranger_sim.harness.campaigns.cases import Case


def proof_text(case: Case, result: dict[str, Any]) -> str:
    """The result of a run, line by line."""
    fault = result.get("fault") or {}
    lines = [
        f"{case.fault or case.settings.text()}: {result['outcome']}" + (f" ({result['why']})" if result["why"] else "")
    ]
    if fault.get("acted"):
        lines.append(
            f"  acted at {fault['acted_s']:.6f} s, largest difference {fault['largest_difference']:g} {fault['unit']}"
        )
    for name, what in (("first_firmware", "first difference in the firmware"), ("first", "first difference at all")):
        if found := result.get(name):
            lines.append(f"  {what}: {found['name']} ({found['where']}) after {found['ms']:g} ms")
    for found in result.get("detected") or []:
        rate = ", oftener than in healthy runs" if found["rate"] else ""
        lines.append(f"  detected: {found['code']} from {found['board']} after {found['ms']:g} ms{rate}")
    for name, what in (("reaction", "reaction"), ("unusual", "a change that no healthy run has")):
        if found := result.get(name):
            lines.append(
                f"  {what}: {found['machine']} in {found['state']}, not {found['instead_of']}, after {found['ms']:g} ms"
            )
    if result.get("fall_ms") is not None:
        lines.append(f"  fell after {result['fall_ms']:g} ms")
    if result.get("digest"):
        lines.append(f"  trace {result['digest']}")
    return "\n".join(lines)
