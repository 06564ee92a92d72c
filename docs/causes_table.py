"""Writes docs/reference/causes.md: the catalogue of causes, and what each machine takes for known.

python docs/causes_table.py
"""

import importlib
import math
import pathlib

from ranger_sim.plant import terms
from ranger_sim.sysid import causes, instruments, machines
from ranger_sim.sysid.fit import Parameter
from ranger_sim.sysid.machines import ankle
from ranger_sim.sysid.machines.walk import base
from ranger_sim.tools.command_line.files import replace_file

PAGE = pathlib.Path(__file__).parent / "reference/causes.md"
HEAD = """# Causes and unknowns

What `ranger-sim diagnose` can name, what its machines know beforehand, what `ranger-sim identify` finds, and what a
model file can add. `ranger-sim causes CAUSE` tells more of one; [diagnose](../diagnose.md) says how a cause is found,
[identify](../identify.md) how a number is, and [model terms](../how-to/model-term.md) how a form is put into a walk.

`python docs/causes_table.py` writes this page, and a test holds it: no number of these tables changes unseen.
"""


def page() -> str:
    """The whole page."""
    lines = [HEAD, "## Causes", ""]
    lines += [f"- **{letter}**: {meaning}" for letter, meaning in causes.BALANCES.items()]
    lines += [
        "",
        "| | cause | what | balances | what it leaves behind | may be taken for |",
        "|---|---|---|---|---|---|",
    ]
    for key, cause in causes.CAUSES.items():
        more = "; a wrong value of a number that the model has" if cause.shift else ""
        rivals = ", ".join(str(number) for number in cause.confusable)
        meaning = cause.meaning + more
        cells = (str(cause.number), key, meaning, ", ".join(cause.balances), cause.signature, rivals)
        lines.append(f"| {' | '.join(cells)} |")
    for name in machines.MACHINES:
        machine = machines.made(name)()
        lines += ["", f"## What {name} knows", "", "| | unit | value | limits | what |", "|---|---|---|---|---|"]
        for known in machine.parameters:
            limits = f"{known.low:g} to {known.high:g}"
            lines.append(f"| {known.name} | {known.unit} | {known.value:.6g} | {limits} | {known.meaning} |")
    lines += ["", "## What sound ankles differ in", ""]
    lines.append("As a standard deviation from what the machine knows. The second column is for a recording of the")
    lines.append("joint alone, of which the model misses far more than noise; empty: anything.")
    lines += ["", "| | deviation | by the joint alone |", "|---|---|---|"]
    for name, deviation in ankle.SPREAD.items():
        loose = f"{ankle.LOOSE[name]:.6g}" if name in ankle.LOOSE else ""
        lines.append(f"| {name} | {deviation:.6g} | {loose} |")
    lines += ["", "## What sound walking robots differ in", "", "| | value | deviation |", "|---|---|---|"]
    for name, (value, deviation) in base.PRIORS.items():
        lines.append(f"| {name} | {value:.6g} | {deviation:.6g} |")
    for name in ("motor", "springs", "ankle"):
        module = importlib.import_module(f"ranger_sim.sysid.identification.{name}")
        lines += ["", f"## Unknowns of identification/{name}.py", "", "| | unit | start | limits | known to | source |"]
        lines.append("|---|---|---|---|---|---|")
        for unknown in (each for each in vars(module).values() if isinstance(each, Parameter)):
            limits = f"{unknown.low:g} to {unknown.high:g}"
            known_to = f"{unknown.uncertainty:g}" if unknown.uncertainty else ""
            cells = (unknown.name, unknown.unit, f"{unknown.value:.6g}", limits, known_to, unknown.source)
            lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "## Instruments of the virtual benches", ""]
    lines.append("Noise, offset and gain as standard deviations; offset and gain are drawn once for a recording.")
    lines += ["", "| | unit | noise | a count | offset | gain | range | source |", "|---|---|---|---|---|---|---|---|"]
    for one in (each for each in vars(instruments).values() if isinstance(each, instruments.Instrument)):
        ends = f"{one.low:g} to {one.high:g}" if one.high < math.inf else ""
        sizes = " | ".join(f"{size:.6g}" for size in (one.noise, one.resolution, one.offset, one.gain))
        lines.append(f"| {one.name} | {one.unit} | {sizes} | {ends} | {one.source} |")
    lines.append(f"| tape measure | m | {instruments.TAPE_M:g} | | | | | 1 mm as its limit |")
    lines.append(f"| calliper | m | {instruments.CALLIPER_M:g} | | | | | 0.1 mm as its limit |")
    lines += [
        "",
        "## Forms of a model file",
        "",
        "| form | where | parameters: limits, default | what |",
        "|---|---|---|---|",
    ]
    for form in terms.FORMS.values():
        parameters = "; ".join(parameter_text(parameter) for parameter in form.parameters)
        lines.append(f"| {form.name} | {', '.join(form.places)} | {parameters} | {form.meaning} |")
    return "\n".join(lines) + "\n"


def parameter_text(parameter: terms.Parameter) -> str:
    """Name, unit, limits and default of a form's parameter."""
    default = "" if parameter.default is None else f", left out {parameter.default:g}"
    return f"{parameter.name} ({parameter.unit}) {parameter.low:g} to {parameter.high:g}{default}"


if __name__ == "__main__":
    replace_file(PAGE, page().encode())
