"""A user's machine whose methods return something else than the fit needs is refused, with the method's name."""

import re
import sys

import numpy as np
import pytest

from ranger_sim.foundation.user_error import ModelError, raised
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import Output, SimulatedMachine, runge_kutta
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.tools import cli

STEP_S = 0.01


class Disc(SimulatedMachine):
    """A disc with viscous friction at a motor."""

    name = "disc"
    quantities = (Quantity("voltage_V", "V", "at the motor"), Quantity("speed_rad_per_s", "rad/s", "of the disc"))
    parameters = (Known("gain", "rad/s^2/V", 5.0, 0.0, 1e3, ""), Known("damping", "1/s", 1.0, 0.0, 1e3, ""))
    states = ("speed",)
    outputs = (Output("speed_rad_per_s", "M", "mechanical", "rad/s"),)

    def inputs(self, table):
        return {"voltage": table["voltage_V"]}

    def first_guess(self, table):
        return {"speed": table["speed_rad_per_s"]}

    def rates(self, x, u, p):
        return {"speed": p["gain"] * u["voltage"] - p["damping"] * x["speed"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"speed_rad_per_s": x["speed"]}


def table():
    """Four seconds of a disc that follows its equation."""
    time = np.arange(400) * STEP_S
    voltage, speed = np.sin(3.0 * time), np.zeros(400)
    for row in range(399):
        speed[row + 1] = speed[row] + STEP_S * (5.0 * voltage[row] - speed[row])
    return Table(time, {"voltage_V": voltage, "speed_rad_per_s": speed}, (slice(0, 400),), "bench")


@pytest.mark.parametrize(
    ("method", "returned", "text"),
    [
        ("inputs", lambda *_: [1.0], "inputs returns list; it returns a dictionary"),
        ("inputs", lambda *_: {"voltage": np.zeros(3)}, r"inputs returns voltage of shape \(3,\); .* the 400 rows"),
        ("first_guess", lambda *_: {"rate": np.zeros(400)}, "first_guess returns no speed; it has rate"),
        ("first_guess", lambda *_: {"speed": 0.0}, r"first_guess returns speed of shape \(\)"),
        ("step", lambda *_: None, "step returns NoneType; it returns a dictionary of speed"),
        ("step", lambda _self, x, *_: {"speed": x["speed"][:, :3]}, r"step returns speed of shape \(1, 3\)"),
        ("step", lambda _self, x, *_: {"speed": x["speed"][0]}, None),  # which numpy broadcasts where it may
        ("observe", lambda *_: {}, "observe returns no speed_rad_per_s; it has none"),
        ("observe", lambda *_: {"speed_rad_per_s": "fast"}, r"observe returns speed_rad_per_s of shape \(\)"),
    ],
)
def test_a_method_that_returns_something_else_is_named_with_what_it_has_to_return(method, returned, text):
    machine = type("Other", (Disc,), {method: returned})()
    if text is None:
        machine.prepare(table())
        return
    with pytest.raises(ModelError, match=f"^disc: {text}"):
        machine.prepare(table())


def test_a_machine_that_keeps_the_contract_is_prepared():
    assert Disc().prepare(table()).fitted["gain"] == pytest.approx(5.0, rel=0.05)  # Euler's steps against the fit's


def test_an_exception_is_one_line_with_its_innermost_place_in_the_file_that_is_asked_for():
    with pytest.raises(ZeroDivisionError) as caught:
        Disc().rates({"speed": 1 / 0}, {}, {})
    text = raised(caught.value, __file__)
    line = caught.value.__traceback__.tb_lineno
    assert (
        text
        == raised(caught.value, "none.py")
        == f"ZeroDivisionError: division by zero ({__name__.split('.')[-1]}.py:{line})"
    )
    with pytest.raises(SyntaxError) as wrong:
        compile("x = (", "mine.py", "exec")
    assert raised(wrong.value) == "SyntaxError: '(' was never closed (mine.py, line 1)"


@pytest.mark.parametrize(
    ("program", "text"),
    [
        ("x = (", r"it raised SyntaxError: '\(' was never closed \(faulty.py, line 1\)"),
        ("class It:\n    def __init__(self):\n        1 / 0\n", r"it raised ZeroDivisionError: .* \(faulty.py:3\)"),
        (
            "from tests.sysid.test_contract_of_a_machine import Disc\n"
            "class It(Disc):\n    def rates(self, x, u, p):\n        return {'speed': u['current']}\n",
            r"it raised KeyError: 'current' \(faulty.py:4\); --verbose prints the traceback",
        ),
    ],
)
def test_what_a_users_program_raises_is_one_line_on_the_screen(program, text, tmp_path, monkeypatch, capsys):
    (tmp_path / "faulty.py").write_text(program, encoding="utf-8")
    bench = table()
    rows = [
        f"{row * STEP_S:.2f},{v:.9f},{w:.9f}" for row, (v, w) in enumerate(zip(*bench.columns.values(), strict=True))
    ]
    (tmp_path / "bench.csv").write_text("\n".join(["t_s,voltage_V,speed_rad_per_s", *rows, ""]), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "faulty", raising=False)
    assert cli.main(["diagnose", str(tmp_path / "bench.csv"), "--experiment", "faulty:It"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert re.fullmatch(f"ranger-sim: --experiment faulty:It: {text}", line), line
