"""What documents and comments point at exists: paragraphs of docs/robot.md, files, headings."""

import functools
import json
import pathlib
import re
import runpy

import pytest

from ranger_sim.loading import packages

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROBOT = ROOT / "docs" / "robot.md"
FOLDERS = (*packages(), "dev", "studies", "ranger_sim", "profiles", "benchmarks", "tests", "docs")
READ = {".py", ".pxd", ".md", ".toml", ".csv", ".h", ".dbc", ".js", ".css", ".html", ".sh"}

PARAGRAPH = r"[BNCPWT]\d+(?:\.\d+)?"
# "robot.md N4.2", "robot.md N1.4-N1.6, N3.7 and C7", "robot.md N3.2 (schedule), N4.1"; a line may end within the list.
CITATION = re.compile(
    rf"robot\.md\s+({PARAGRAPH}(?:(?:\s+\([^()]*\))?(?:,\s+(?:and\s+)?|-|\s+and\s+|\s+to\s+){PARAGRAPH})*)"
)
# "[N 4.3]" and "[A 8.3.1; P 3: robot]" in the parameter files of the plant: A is a section of the appendix.
BRACKETS = re.compile(r"\[([A-Z] \d[^\]]*)\]")
BRACKETED = re.compile(r"\b([A-Z]) (\d+(?:\.\d+)*)")
BRACKET_FILES = [ROOT / "plant/mechanics/parameters.py", ROOT / "plant/electrics/motor_parameters.py"]
# How such a document was named before this one stood beside the code.
FORMER = re.compile(
    r"\bfacts:?,? (?:network|control|record|on |about |section |\d)|of[ _]the[ _]facts|[a-z]-and-[a-z]+,? \d", re.I
)


@functools.cache
def texts():
    """(path, text) of every file of the repository that a person writes, and of what is generated from it."""
    paths = [path for path in ROOT.iterdir() if path.is_file() and path.suffix in READ]
    for room in FOLDERS:
        paths += [path for path in (ROOT / room).rglob("*") if path.suffix in READ and "__pycache__" not in path.parts]
    paths.remove(pathlib.Path(__file__).resolve())
    return [(path, path.read_text(encoding="utf-8")) for path in sorted(paths)]


def paragraphs(text):
    """{number: text} of headings and of numbered table rows."""
    found = {}
    numbers = re.compile(rf"^(?:#+ ({PARAGRAPH}) |\| ({PARAGRAPH}) \|)", re.MULTILINE)
    matches = list(numbers.finditer(text))
    for match, following in zip(matches, [*matches[1:], None], strict=True):
        number = match.group(1) or match.group(2)
        assert number not in found, f"docs/robot.md has {number} twice"
        found[number] = text[match.end() : following.start() if following else len(text)]
    return found


def cited(path, text):
    """(line, paragraph) of every citation of docs/robot.md in `text`."""
    for match in CITATION.finditer(joined(text)):
        for number in re.findall(rf"\b{PARAGRAPH}\b", match.group(1)):
            yield text.count("\n", 0, match.start()) + 1, number
    if path in BRACKET_FILES:
        for match in BRACKETS.finditer(text):
            for letter, number in BRACKETED.findall(match.group(1)):
                if letter != "A":
                    yield text.count("\n", 0, match.start()) + 1, letter + number


def joined(text):
    """Comment lines as one text of the same length, so that a citation may go on in the next line."""
    return re.sub(r"\n[ \t]*(?:# ?|// ?)?", lambda match: "\n" + " " * (len(match.group()) - 1), text)


def test_a_citation_is_read_whole():
    text = "# robot.md N1.4-N1.6, N3.7 and\n    # C7; appendix 4.3\n(robot.md N3.2 (in lines), N5). robot.md P2: 3e-8"
    expected = [(1, "N1.4"), (1, "N1.6"), (1, "N3.7"), (1, "C7"), (3, "N3.2"), (3, "N5"), (3, "P2")]
    assert list(cited(ROBOT, text)) == expected


def test_a_citation_in_brackets_is_read_without_the_appendix():
    text = "\n# friction [A 8.3.1; P 3: 0.002 is reflected; C 5.2] and [0, 1] and [P 1.9]"
    assert list(cited(BRACKET_FILES[0], text)) == [(2, "P3"), (2, "C5.2"), (2, "P1.9")]


def test_every_paragraph_that_is_cited_exists():
    known = paragraphs(ROBOT.read_text(encoding="utf-8"))
    found = [(path, line, number) for path, text in texts() for line, number in cited(path, text)]
    assert len({path for path, _, _ in found}) > 80 and len(found) > 250  # the house cites its sources
    assert {path for path, _, _ in found} >= set(BRACKET_FILES)
    lost = [f"{path.relative_to(ROOT)}:{line} {number}" for path, line, number in found if number not in known]
    assert lost == []


def test_every_paragraph_says_something():
    known = paragraphs(ROBOT.read_text(encoding="utf-8"))
    assert len(known) > 80
    chapters = {number.partition(".")[0] for number in known if "." in number}
    assert [number for number, text in known.items() if len(text.strip()) < 20 and number not in chapters] == []


def test_references_to_the_document_name_a_paragraph():
    vague = []
    for path, text in texts():
        for match in re.finditer(r"robot\.md(?!\w)", joined(text)):
            whole = text[: match.start()].endswith(("docs/", "](../"))  # the file itself is meant
            if path != ROBOT and not whole and not CITATION.match(joined(text), match.start()):
                vague.append(f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, match.start()) + 1}")
    assert vague == []


def test_nothing_cites_what_a_reader_cannot_open():
    found = [f"{path.relative_to(ROOT)}: {match.group()}" for path, text in texts() for match in FORMER.finditer(text)]
    assert found == []


def documents():
    return [path for path, _ in texts() if path.suffix == ".md"]


def name_of(path):
    return str(path.relative_to(ROOT))


def anchors(path):
    """Names that headings of a document have as link targets, made as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", documents(), ids=name_of)
def test_relative_links_lead_to_files_and_headings(document):
    lost = []
    for target in re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8")):
        if re.match(r"\w+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (document.parent / name).resolve() if name else document
        if not file.exists() or (anchor and anchor not in anchors(file)):
            lost.append(target)
    assert lost == []


# The changelog names files of its day, docs/robot.md those of the robot's own repository.
@pytest.mark.parametrize(
    "document", [path for path in documents() if path != ROBOT and path.name != "CHANGELOG.md"], ids=name_of
)
def test_files_that_a_document_names_exist(document):
    """A path from the repository's root or from the document's folder; a module's bare name anywhere."""
    modules = {path.name for path, _ in texts() if path.suffix in {".py", ".pxd"}}
    lost = []
    for code in re.findall(r"`([^`\n]+)`", document.read_text(encoding="utf-8")):
        for name in re.findall(r"(?<![\w./*<>~-])[\w-][\w./-]*\.(?:py|pxd|md|toml|csv|sh|js|html)\b(?!\()", code):
            there = (document.parent / name).exists() or (ROOT / name).exists()
            module = name.endswith((".py", ".pxd"))
            if not there and (name not in modules if module else "/" in name):
                lost.append(name)
    assert lost == []


def test_the_figure_of_the_record_walk_is_drawn_out_of_the_walks_that_are_kept():
    program = runpy.run_path(str(ROOT / "studies" / "pictures" / "record_walk.py"))
    assert program["FIGURE"].read_text(encoding="utf-8") == program["drawn"]()
    level = program["walks"](program["NOW"])
    assert [row["seed"] for row in level] == list(range(1, 21))
    assert all(row["steps"] == program["STEPS"] and row["body"] == "ranger" for row in level)


def test_the_figure_of_the_foot_that_is_too_high_is_drawn_from_the_answers_that_are_kept():
    program = runpy.run_path(str(ROOT / "studies" / "pictures" / "foot_too_high.py"))
    assert program["FIGURE"].read_text(encoding="utf-8") == program["drawn"]()


def test_the_figure_of_the_timeline_is_drawn_out_of_the_step_that_is_kept():
    program = runpy.run_path(str(ROOT / "studies" / "pictures" / "timeline.py"))
    assert program["FIGURE"].read_text(encoding="utf-8") == program["drawn"]()
    kept = json.loads(program["STEP_FILE"].read_text(encoding="utf-8"))
    order = [kept["stations"][station][0] for station, _, _ in program["WAY"]]
    assert order == sorted(order) and len(order) == 17  # nothing comes before what it comes of


def test_the_figure_and_the_table_of_the_walk_of_2015_are_those_of_the_answer_that_is_kept():
    program = runpy.run_path(str(ROOT / "studies" / "pictures" / "walk_2015.py"))
    assert program["FIGURE"].read_text(encoding="utf-8") == program["draw"]()
    answer = json.loads(program["ANSWER"].read_text(encoding="utf-8"))
    page = (ROOT / "docs" / "walk-2015.md").read_text(encoding="utf-8")
    for row, extended in zip(answer["misfit"], answer["extended_features"], strict=True):
        low, high = row["ci95"]
        reported = f"| {row['measured']:.3f} ({low:.3f} to {high:.3f}) | {row['emulated']:.3f} | {extended:.3f} |"
        assert reported in page
    (cause,) = answer["causes"]
    value = cause["parameters"]["term"]
    assert f"{value['value']:.3f} rad ({value['ci95'][0]:.3f} to {value['ci95'][1]:.3f})" in page


def test_the_tables_of_the_marathon_are_those_of_the_walk_that_is_kept():
    program = runpy.run_path(str(ROOT / "docs" / "marathon_tables.py"))
    page = program["PAGE"].read_text(encoding="utf-8")
    for table in program["tables"]():
        assert table in page
    walk = json.loads(program["KEPT"].read_text(encoding="utf-8"))["walk"]
    assert not walk["fell"] and not walk["battery"]["empty"] and walk["distance_m"] >= 65_243.0
    assert walk["electronics_off"] == ["left-outer-ankle"]


def test_the_figure_of_the_actuators_lag_is_drawn_from_the_answers_that_are_kept():
    program = runpy.run_path(str(ROOT / "studies" / "pictures" / "mujoco_lag.py"))
    assert program["FIGURE"].read_text(encoding="utf-8") == program["drawn"]()
    rows = json.loads(program["KEPT"].read_text(encoding="utf-8"))["rows"]
    page = program["PAGE"].read_text(encoding="utf-8")
    for row in rows:
        if "found_ms" in row:
            low, high = row["ci95_ms"]
            assert row["named"] == "input_lag at current"
            assert f"| {row['hidden_ms']} ms | input_lag | {row['found_ms']:.2f} ms ({low:.2f} to {high:.2f}) |" in page
    assert [row["hidden_ms"] for row in rows if not row["named"]] == [0]
