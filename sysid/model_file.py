"""The extended model as a file: parameters of the equations as fitted, and the effects that were named."""

from ranger_sim.sysid.diagnose import Diagnosis


def model_text(found: Diagnosis) -> str:
    """TOML: `experiment`, [parameters], one [[effect]] each with cause, place, coefficients and shape."""
    lines = [
        "# What was found in measured data: parameters of the equations, and effects beyond them.",
        f'experiment = "{found.machine.name}"',
        f"recordings = [{', '.join(_quoted(recording.table.name) for recording in found.recordings)}]",
        "",
        "[parameters]",
    ]
    lines += [f"{name} = {value!r}" for name, value in found.extended.values.items() if "@" not in name]
    for each in found.named:
        lines += ["", "[[effect]]", f'cause = "{each.effect.cause}"', f'at = "{each.effect.at}"']
        lines += [
            f"{name} = {found.extended.values[full]!r}"
            for name, full in zip(each.effect.coefficients, each.coefficients, strict=True)
        ]
        lines += [f"{name} = {float(value)!r}" for name, value in each.shape.items()]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
