"""`ranger-sim faults` and `walk --fault` as people type them, modes of their own, and the tables of docs/faults.md."""

import json
import re
import subprocess
import sys

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults import text
from ranger_sim.harness.faults.catalogue import MODES, mode
from ranger_sim.harness.faults.names import NameParameter
from ranger_sim.harness.faults.ranger_catalogue import CATALOGUE
from ranger_sim.tools import cli, faults

OWN = faults.DOCUMENT.read_text(encoding="utf-8").split("```python\n")[2].partition("```")[0]


def lines_of(capsys, *arguments):
    assert cli.main(list(arguments)) == 0
    return capsys.readouterr().out.splitlines()


def refused(capsys, *arguments):
    """The one line on standard error with which the command is refused."""
    assert cli.main(list(arguments)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    return line


def test_the_list_has_every_place_with_its_modes(capsys):
    printed = "\n".join(lines_of(capsys, "faults"))
    for place in CATALOGUE.places:
        assert place in printed
    assert "jammed" in printed


def test_a_place_tells_its_modes_parameters_limits_sources_and_what_it_refuses(capsys):
    printed = "\n".join(lines_of(capsys, "faults", "MCH.absolute_encoder"))
    assert re.search(r"^offset +shows a constant too much$", printed, re.MULTILINE)
    assert re.search(r"^ +offset +100 counts \(-4096 to 4096\): what is added$", printed, re.MULTILINE)
    assert re.search(r"^ +level +none counts", printed, re.MULTILINE)
    assert re.search(r"chosen by us: 100 counts are 0.077 rad", printed)
    assert re.search(r"^ +lost_edges +it needs edges on a wire$", printed, re.MULTILINE)


def test_the_json_has_the_same_for_programs(capsys):
    listed = json.loads("\n".join(lines_of(capsys, "faults", "--json")))
    assert [place["place"] for place in listed] == list(CATALOGUE.places)
    (word,) = json.loads("\n".join(lines_of(capsys, "faults", "MCH.absolute_encoder", "--json")))
    offset = next(mode for mode in word["modes"] if mode["mode"] == "offset")
    assert offset["unit"] == "counts"
    (parameter,) = offset["parameters"]
    assert (parameter["default"], parameter["low"], parameter["high"]) == (100.0, -4096.0, 4096.0)
    stuck = next(mode for mode in word["modes"] if mode["mode"] == "stuck")
    assert stuck["parameters"][0]["default"] is None
    assert word["refused"]["lost_edges"] == "it needs edges on a wire"


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("MCH.joint_encodr:stuck", "did you mean 'MCH.joint_encoder'"),
        ("MCH.joint_encoder:stuk", "unknown mode 'stuk'"),
        ("MCH.joint_encoder:stuck,levl=1", "level"),
        ("MCH.joint_encoder:stuck,level=4", "level is '4', allowed are 0 to 3"),
        ("MCH.joint_encoder:stuck,level=high", "level is 'high'"),
        ("MCH.joint_encoder:stuck,level", "is not name=value"),
        ("MCH.joint_encoder", "reads PLACE:MODE"),
        ("MCH.joint_encoder:stuck@stp 3", "reads like"),
        ("MCH.joint_encoder:stuck@hip in HI_mid", "hip has no state 'HI_mid'"),
        ("MCH.joint_encoder:bit_flips", "it needs a serial word, this is the incremental encoder"),
        ("CSR.adc_internal:late_conversion", "burst mode"),
    ],
)
def test_what_is_typed_wrong_is_refused_in_a_line_that_says_what_was_perhaps_meant(capsys, typed, words):
    assert words in refused(capsys, "walk", "--time", "1ms", "--fault", typed)


def test_a_place_that_is_not_there_is_refused_by_the_list_too(capsys):
    assert "did you mean 'world.floor'" in refused(capsys, "faults", "world.flor")


def test_a_fault_reads_back_as_it_was_typed():
    CATALOGUE.load()
    for typed in (
        "MCH.joint_encoder:stuck@step 12..step 14",
        "MCH.joint_encoder:stuck,level=3@0.3 s",
        "UI.imu:gyro_bias,rate=-0.1",
        "world.robot:push,force=-20@hip in HI_premid",
    ):
        assert CATALOGUE.typed(typed).text() == typed
    assert CATALOGUE.typed("UI.imu:gyro_bias , rate=0.2@ 3 s .. 4 s").text() == "UI.imu:gyro_bias@3 s..4 s"
    assert text.parse("a:b@x").end is None


def test_a_fault_gives_every_digit_of_its_parameters():
    CATALOGUE.load()
    fault = CATALOGUE.fault("world.robot", "push", None, None, {"force": 1.0 / 3.0})
    assert CATALOGUE.typed(fault.text()).values["force"] == 1.0 / 3.0


def walk(capsys, *arguments):
    """(exit code, summary, what was said) of a walk."""
    code = cli.main(["walk", "--json", "-", *arguments])
    printed = capsys.readouterr()
    return code, json.loads(printed.out), printed.err


def test_a_walk_tells_what_became_of_its_faults_in_its_summary(capsys):
    code, summary, _ = walk(
        capsys, "--time", "60ms",
        "--fault", "MCH.absolute_encoder:offset@20 ms..40 ms",
        "--fault", "MCFO.left_foot:contact_stuck,closed=0@30 ms",
    )  # fmt: skip
    assert code == 0
    first, second = summary["faults"]
    assert first["fault"] == "MCH.absolute_encoder:offset@20 ms..40 ms"
    assert (first["activated_s"], first["acted_s"], first["ended_s"]) == pytest.approx((0.02, 0.02, 0.04))
    assert first["cleared_s"] == pytest.approx(0.04025)
    assert (first["largest_difference"], first["unit"]) == (100, "counts")
    assert second["ended_s"] is None
    assert second["acted"]


def test_a_fault_that_did_not_act_makes_the_run_invalid_and_the_exit_code_3(capsys, tmp_path):
    code, summary, _ = walk(capsys, "--time", "20ms", "--fault", "MCH.joint_encoder:lost_edges,share=0")
    assert code == 3
    assert not summary["faults"][0]["acted"]
    assert cli.main(["walk", "--time", "20ms", "--fault", "MCH.joint_encoder:stuck@step 1"]) == 3
    said = " ".join(capsys.readouterr().err.split())
    assert "fault MCH.joint_encoder:stuck@step 1: INVALID, it did not begin" in said


def test_the_report_has_its_faults_and_the_command_that_repeats_them(tmp_path):
    arguments = ["walk", "--time", "40ms", "--out", str(tmp_path), "--fault", "MCH.absolute_encoder:offset@20 ms"]
    assert cli.main(arguments) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<h2>Faults</h2>" in page
    assert "acted from 0.02 s on" in page
    assert "--fault &#39;MCH.absolute_encoder:offset@20 ms&#39;" in page


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "ranger_sim", *map(str, arguments)], capture_output=True, text=True, check=False
    )


def test_a_mode_of_a_users_own_is_listed_and_acts(tmp_path):
    """The example of docs/faults.md, in a process of its own: the catalogue of this one stays as it is."""
    module = tmp_path / "burnt.py"
    module.write_text(OWN, encoding="utf-8")
    done = command("faults", "MCH.battery_voltage", "--fault-module", module)
    assert "burnt_divider" in done.stdout
    done = command(
        "walk", "--time", "20ms", "--json", "-", "--fault-module", module,
        "--fault", "MCH.battery_voltage:burnt_divider,diode=4.5@5 ms..10 ms",
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    (fault,) = json.loads(done.stdout)["faults"]
    assert fault["acted_count"] == 20
    assert fault["unit"] == "V at the pin"


@pytest.mark.parametrize(
    ("program", "words"),
    [
        (None, "there is no such file"),
        ("1 / 0", "ZeroDivisionError"),
        ("import no_such_module_of_theirs", "No module named"),
        (OWN + "\n\n@mode\nclass Again(BurntDivider):\n    pass\n", "it is in the catalogue already"),
    ],
)
def test_a_module_that_does_not_run_is_refused_in_one_line(tmp_path, program, words):
    module = tmp_path / "own.py"
    if program is not None:
        module.write_text(program, encoding="utf-8")
    done = command("faults", "--fault-module", module)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert words in line


def test_the_tables_of_the_document_are_those_of_the_catalogue():
    document = faults.DOCUMENT.read_text(encoding="utf-8")
    assert faults.with_tables(document) == document, "write them anew: python -m ranger_sim.tools.faults"


def test_every_parameter_has_a_source_limits_around_its_default_and_every_mode_a_meaning():
    CATALOGUE.load()
    for (place_kind, name), kind in MODES.items():
        assert kind.meaning, (place_kind, name)
        for parameter in kind.parameters:
            where = (place_kind, name, parameter.name)
            assert parameter.source, where
            assert parameter.meaning, where
            if isinstance(parameter, NameParameter):
                assert isinstance(parameter.default, str), where
                continue
            assert not parameter.low > parameter.default, where
            assert not parameter.high < parameter.default, where
            assert parameter.low < parameter.high, where


def test_a_mode_or_a_place_that_is_there_already_is_refused():
    CATALOGUE.load()
    kind = MODES["robot", "push"]
    with pytest.raises(UserError, match="push at robot: it is in the catalogue already"):
        mode(kind)
    with pytest.raises(UserError, match=r"world\.robot: it is in the catalogue already"):
        CATALOGUE.add_places([CATALOGUE.places["world.robot"]])


TOLD = {
    "of_faults": 1,
    "first_difference": {"where": "can1", "name": "MCH_ANGLE", "after_ms": 2.621},
    "detected": {"code": "MCFI_ANKL_LO", "board": "MCFI", "rate": False},
    "detection_ms": 738.5,
    "reaction": {"machine": "inner_foot", "state": "afterpush", "instead_of": "prepush"},
    "reaction_ms": 19.0,
    "fall_ms": 1275.0,
}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {},
            "; against the run without it: MCH_ANGLE differs after 2.621 ms (can1), told by MCFI_ANKL_LO from MCFI "
            "after 738.5 ms, inner_foot in afterpush instead of prepush after 19 ms, fell after 1275 ms",
        ),
        (
            {"first_difference": None},
            "; against the run without it: NO EFFECT, nothing that the firmware sends differs",
        ),
        (
            {"detected": None, "reaction": None, "fall_ms": None},
            "; against the run without it: MCH_ANGLE differs after 2.621 ms (can1), no error tells of it",
        ),
        (
            {"detected": {**TOLD["detected"], "rate": True}, "reaction": None, "fall_ms": None},
            "; against the run without it: MCH_ANGLE differs after 2.621 ms (can1), told by MCFI_ANKL_LO from MCFI, "
            "more often than without after 738.5 ms",
        ),
    ],
)
def test_a_proof_is_told_in_the_faults_line(changes, words):
    assert faults.proof_text(TOLD | changes) == words
    assert faults.proof_text(None) == ""


def test_a_walk_with_proof_says_when_who_told_and_changes_nothing(capsys, tmp_path):
    fault = "MCH.absolute_encoder:offset,offset=300@300 ms"
    summaries = []
    for proof in ([], ["--proof"]):
        file = tmp_path / "summary.json"
        arguments = ["--time", "0.5s", "--fault", fault, *proof, "--json", str(file)]
        assert cli.main(["walk", *arguments]) == 0
        summaries.append(json.loads(file.read_text(encoding="utf-8")))
    without, held = summaries
    assert without["trace_digest"] == held["trace_digest"]
    (plain,), (proven,) = without["faults"], held["faults"]
    assert plain["proof"] is None
    found = proven["proof"]
    assert (found["first_difference"]["where"], found["first_difference"]["name"]) == ("errors", "MCH AE_SPIKE")
    assert (found["detected"]["code"], found["detected"]["board"]) == ("AE_SPIKE", "MCH")
    # the board reads the word in its next slot, within 0.5 ms; errors are looked at every 0.25 ms
    assert 0.0 < found["detection_ms"] <= 0.75
    assert found["fall_ms"] is None
    assert "told by AE_SPIKE from MCH" in capsys.readouterr().err


def test_several_faults_are_held_against_one_golden_run_together_from_the_first_one_on(capsys, tmp_path):
    file = tmp_path / "summary.json"
    late, early = "MCH.absolute_encoder:offset,offset=300@300 ms", "UI.imu:gyro_bias@200 ms..250 ms"
    assert cli.main(["walk", "--time", "0.4s", "--fault", late, "--fault", early, "--proof", "--json", str(file)]) == 0
    first, second = (fault["proof"] for fault in json.loads(file.read_text(encoding="utf-8"))["faults"])
    assert first == second and first["of_faults"] == 2
    assert first["first_difference"]["name"] == "UI_ANG_RATE_X" and 0.0 < first["first_difference"]["after_ms"] < 10.0
    assert 100.0 < first["detection_ms"] <= 100.75  # of the encoder's word, from the other one's beginning on
    assert "against the run without the 2 faults, from the first one's beginning on: " in capsys.readouterr().err


def test_a_proof_without_a_fault_is_refused(capsys):
    assert "there is no --fault" in refused(capsys, "walk", "--proof")
