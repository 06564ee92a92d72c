"""`ranger-sim identify`: what it prints, writes and refuses."""

import json

import pytest

from ranger_sim.sysid.identification import motor, registry
from ranger_sim.sysid.identification.registry import OF_TABLES
from ranger_sim.tools.cli import main
from ranger_sim.tools.identify import command


def told(capsys, *arguments):
    """The JSON on standard output, and the exit code."""
    code = main(["identify", *arguments, "--json", "-"])
    return json.loads(capsys.readouterr().out), code


def parameters(found, title):
    return next(each["parameters"] for each in found["fits"] if title in each["title"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What `identify all --out` leaves."""
    made = tmp_path_factory.mktemp("identified")
    assert main(["identify", "all", "--out", str(made)]) == 0
    return made


def test_all_leaves_recordings_figures_and_the_same_numbers_from_its_own_recordings(folder, capsys):
    capsys.readouterr()
    written = json.loads((folder / "identify.json").read_text())
    names = {f"{name}.csv" for name in OF_TABLES} | {"identify.html", "identify.json"}
    assert {path.name for path in folder.iterdir()} == names
    for bench, title in (("stall", "8.3.1"), ("hip-spring", "hip-spring")):
        again, code = told(capsys, bench, "--data", str(folder / f"{bench}.csv"))
        assert code == 0
        # a recording in a file has nine digits
        for name, row in parameters(written, title).items():
            assert again["fits"][0]["parameters"][name]["value"] == pytest.approx(row["value"], rel=1e-5, abs=1e-8)
        assert again["truth"] == {} and again["seed"] is None
    page = (folder / "identify.html").read_text()
    for figure in ("Figure 28", "Figure 29", "Figure 31", "Swinging legs", "Balance of the legs"):
        assert figure in page
    assert 'src="http' not in page and 'href="http' not in page.split("</script>")[-1]
    assert [row["name"] for row in written["balance"]] == ["J_hip", "cm", "wm"]
    for row in parameters(written, "Table 3").values():
        assert row["ci95"][0] < row["value"] < row["ci95"][1]


def test_the_command_line_names_the_benches_that_there_are():
    assert {name: bench.title for name, bench in registry.BENCHES.items()} == command.BENCHES
    assert command.GEAR == motor.GEAR


def test_identifiability_is_reported_before_the_values(capsys):
    assert main(["identify", "stall"]) == 0
    out = capsys.readouterr().out
    assert out.index("singular values") < out.index("95 % interval")
    assert "stall.current_sensor_gain and R are not separable by these data" in out
    assert "truth" in out


def test_a_hanging_angle_alone_is_refused_and_what_is_known_helps(folder, capsys):
    data = str(folder / "hang.csv")
    found, code = told(capsys, "hang", "--data", data)
    assert code == 1
    assert found["fits"][0]["parameters"] == {}
    assert "do not determine outer_cm and outer_wm" in found["fits"][0]["refused"]
    known = ("--known", "outer_cm=0.72+-0.004", "--known", "inner_cm=0.72+-0.004")
    found, code = told(capsys, "hang", "--data", data, *known)
    assert code == 0
    assert abs(found["fits"][0]["parameters"]["outer_wm"]["value"]) < 0.004


def test_columns_in_other_units_and_names_are_read(folder, tmp_path, capsys):
    lines = (folder / "stall.csv").read_text().splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
    assert lines[0] == "t_s,voltage_V,current_A"
    other = tmp_path / "other.csv"
    other.write_text("t_s,U_mV,current_mA\n" + "".join(f"{t},{1e3 * V},{1e3 * A}\n" for t, V, A in rows))
    found, code = told(capsys, "stall", "--data", str(other), "--map", "U_mV=voltage_V")
    assert code == 0
    assert found["fits"][0]["parameters"]["R"]["value"] == pytest.approx(1.3, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stal"], "unknown bench 'stal' (available: stall, cantilever, pulley"),
        (["stall", "--data", "nowhere.csv"], "nowhere.csv: there is no such file"),
        (["stall", "--known", "R=1"], "--known 'R=1': NAME=VALUE+-SD is needed"),
        (["stall", "--known", "R=1+-0"], "--known 'R=1+-0': NAME=VALUE+-SD is needed"),
        (["stall", "--known", "R=-1+-0.1"], "parameter R: start -1.0 ohm is not between its limits"),
        (["stall", "--map", "a=b"], "--map names columns of a file: --data is needed"),
        (["all", "--data", "."], "for all a folder is needed; stall.csv is not in it"),
        (["all", "--known", "R=1+-1"], "--known belongs to a single bench"),
    ],
)
def test_a_mistake_is_one_line(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["identify", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("option", "message"), [("--gear", "--gear: '0' must be above 0"), ("--coverage", "--coverage: '0' is below 1")]
)
def test_a_number_beyond_its_limit_is_refused_before_anything_is_read(option, message, capsys):
    with pytest.raises(SystemExit) as left:
        main(["identify", "all", option, "0"])
    error = capsys.readouterr().err
    assert left.value.code == 2 and message in error and error.count("\n") == 1


@pytest.mark.parametrize(
    "content",
    [
        "",
        "t_s,voltage_V,current_A\n",
        "t_s,voltage_V\n0,1\n1,2\n",
        "voltage_V\n1\n2\n",
        "t_s,voltage_V,current_A\n" + "".join(f"{k},nan,nan\n" for k in range(20)),
        "t_s,voltage_V,current_A\n" + "".join(f"{k},3.0,1.0\n" for k in range(20)),
        "t_s,voltage_V,current_rad\n" + "".join(f"{k},{k - 9},{k - 9}\n" for k in range(20)),
        "\x00\xff\x00binary",
    ],
)
def test_corrupt_empty_or_foreign_data_are_a_finding_and_never_a_value(content, tmp_path, capsys):
    path = tmp_path / "data.csv"
    path.write_text(content, encoding="latin-1")
    code = main(["identify", "stall", "--data", str(path)])
    captured = capsys.readouterr()
    assert code == 2 and captured.err.count("\n") == 1 or code == 1 and "refused" in captured.out


def test_an_effect_that_the_model_lacks_marks_the_values_as_not_physical(folder, tmp_path, capsys):
    lines = (folder / "stall.csv").read_text().splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
    bent = tmp_path / "bent.csv"
    bent.write_text(lines[0] + "\n" + "".join(f"{t},{V + 0.05 * A**3},{A}\n" for t, V, A in rows))
    assert main(["identify", "stall", "--data", str(bent)]) == 0
    assert "something that is not in the model moves it" in " ".join(capsys.readouterr().out.split())
    found, _ = told(capsys, "stall", "--data", str(folder / "stall.csv"))
    assert found["fits"][0]["unexplained"] is False


def test_a_recording_of_which_much_is_lost_gives_no_values(folder, tmp_path, capsys):
    lines = (folder / "stall.csv").read_text().splitlines()
    torn = tmp_path / "torn.csv"
    torn.write_text("\n".join([*lines[:2], "x", *lines[3:]]))
    assert main(["identify", "stall", "--data", str(torn)]) == 2
    said = capsys.readouterr().err
    assert "torn.csv: " in said and f"1 of {len(lines) - 1} samples are lost" in said and said.count("\n") == 1
    found, code = told(capsys, "stall", "--data", str(torn), "--accept-loss", "50%")
    assert code == 0 and found["fits"][0]["parameters"]
