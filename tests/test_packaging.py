"""What is built, what is shipped, and what happens where there is no compiler."""

import importlib
import importlib.metadata
import json
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
import tomllib
import venv

import pytest

from dev import declarations, publication
from ranger_sim import __version__, loading
from ranger_sim.tools import cli
from set_up import SetUpError, for_a_walk, name_of, part_of_lock

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
BUILT = (".so", ".pyd")
CC = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"  # with its options, or a cache before it
COMPILER = CC.split()[0]
needs_compiler = pytest.mark.skipif(shutil.which(COMPILER) is None, reason="no C compiler here")
WHERE_FROM = (
    "import importlib, json, sys\n"
    "print(json.dumps({name: importlib.import_module(name).__file__ for name in sys.argv[1:]}))"
)


def run(arguments, cwd, **environment):
    """A child process of this Python in a folder, with a clean environment but for what is given."""
    kept = {name: value for name, value in os.environ.items() if name in ("PATH", "HOME", "LANG", "TMPDIR")}
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=cwd,
        env={**kept, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=500,
    )


def files_of(names, folder, **environment):
    """{module: file it was loaded from}, imported in a process that runs in `folder`."""
    done = run(["-c", WHERE_FROM, *names], folder, **environment)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


# --- this tree --------------------------------------------------------------------------------------------


def test_every_declared_module_is_compiled_where_a_compiler_is():
    declared = declarations.Sources(ROOT).compiled_modules()
    assert sorted(loading.declared_modules()) == declared
    if loading.interpreted_is_forced():
        assert not loading.COMPILED_MODULES
    elif shutil.which(COMPILER):
        assert sorted(loading.COMPILED_MODULES) == declared, f"run `make setup`; {loading.RUNS_INTERPRETED_BECAUSE}"
    else:
        assert "C compiler" in loading.RUNS_INTERPRETED_BECAUSE


def test_modules_with_the_same_last_name_are_not_confused():
    for inside in (
        "boards.steering",
        "plant.mechanics.steering",
        "boards.modules.absolute_encoder",
        "plant.sensors.absolute_encoder",
    ):
        name = f"ranger_sim.{inside}"
        module = importlib.import_module(name)
        assert module.__name__ == module.__spec__.name == name
        assert name in {each.__module__ for each in vars(module).values() if isinstance(each, type)}


def test_interpreted_is_forced_for_every_package_by_plain_imports(tmp_path):
    """In the checkout, and from elsewhere through the installation."""
    names = list(loading.declared_modules())
    files = files_of(names, ROOT, RANGER_SIM_INTERPRETED="1")
    assert [file for file in files.values() if not file.endswith(".py")] == []
    files = files_of(names, tmp_path, RANGER_SIM_INTERPRETED="1", PYTHONPATH=str(ROOT))
    assert [file for file in files.values() if not file.endswith(".py")] == []


def test_interpreted_is_forced_under_pytest(tmp_path):
    test = tmp_path / "test_inside.py"
    names = list(loading.declared_modules())
    test.write_text(
        "import importlib, pytest\n"
        f"@pytest.mark.parametrize('name', {names!r})\n"
        "def test_source(name):\n"
        "    assert importlib.import_module(name).__file__.endswith('.py')\n",
        encoding="utf-8",
    )
    done = run(
        ["-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", tmp_path, test],
        ROOT,
        RANGER_SIM_INTERPRETED="1",
    )
    assert done.returncode == 0, done.stdout
    assert f"{len(names)} passed" in done.stdout


# --- what is shipped --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    """The folder of packages that a wheel holds, with the compiled modules of this tree."""
    folder = tmp_path_factory.mktemp("shipped")
    done = run(["setup.py", "-q", "build_py", "--build-lib", folder], ROOT)
    assert done.returncode == 0, done.stderr
    if loading.COMPILED.is_dir():
        shutil.copytree(loading.COMPILED / "ranger_sim", folder / "ranger_sim", dirs_exist_ok=True)
        shutil.copy(loading.COMPILED / loading.RECORD, folder / "ranger_sim")
    return folder


def test_every_file_of_the_packages_is_shipped_and_nothing_else(shipped):
    def kept(root, *folders):
        return {
            path.relative_to(root).as_posix()
            for folder in folders
            for path in (root / folder).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts and path.suffix not in BUILT
        }

    folders = [path.name for path in loading.PACKAGE.iterdir() if path.is_symlink()]
    types = {f"{name.partition('.')[2].replace('.', '/')}.pyi" for name in loading.declared_modules()}
    assert kept(shipped / "ranger_sim", *folders) == kept(ROOT, *folders) | types
    assert [path.name for path in shipped.iterdir()] == ["ranger_sim"]


def test_the_shipped_robot_walks_from_another_folder_both_ways(shipped, tmp_path):
    digests = set()
    for interpreted in ("", "1"):
        setting = {"PYTHONPATH": str(shipped), "RANGER_SIM_INTERPRETED": interpreted}
        files = files_of(list(loading.declared_modules()), tmp_path, **setting)
        assert all(file.startswith(str(shipped)) for file in files.values())
        if interpreted:
            assert all(file.endswith(".py") for file in files.values())
        out = tmp_path / f"out{interpreted}"
        done = run(["-m", "ranger_sim", "walk", "--time", "200ms", "--out", out, "--json", "-"], tmp_path, **setting)
        assert done.returncode == 0, done.stderr
        digests.add(json.loads(done.stdout)["trace_digest"])
        assert (out / "report.html").stat().st_size > 100_000
        done = run(["-m", "ranger_sim", "table", "generate", "--check"], tmp_path, **setting)
        assert done.returncode == 0, done.stderr
        done = run(["-m", "ranger_sim", "can-bounds", "--profile", "hil-1mbit", "--json", "-"], tmp_path, **setting)
        assert done.returncode == 0 and json.loads(done.stdout)["met"], done.stderr
    assert len(digests) == 1


# --- the build itself, on one package ---------------------------------------------------------------------


def checkout_in(folder):
    """What a checkout has, with the package `foundation` alone, not built."""
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    (folder / "dev").mkdir()
    for name in ("__init__.py", "declarations.py", "publication.py", "stubs.py"):
        shutil.copy(ROOT / "dev" / name, folder / "dev")
    (folder / "ranger_sim").mkdir()
    for name in ("__init__.py", "__main__.py", "loading.py", "py.typed"):
        shutil.copy(ROOT / "ranger_sim" / name, folder / "ranger_sim")
    shutil.copytree(ROOT / "foundation", folder / "foundation", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "ranger_sim" / "foundation").symlink_to("../foundation")
    return folder


@pytest.fixture
def checkout(tmp_path):
    return checkout_in(tmp_path)


@pytest.fixture(scope="module")
def built_once(tmp_path_factory):
    """A checkout after its build, which takes 10 s."""
    folder = checkout_in(tmp_path_factory.mktemp("built"))
    build_in(folder)
    return folder


@pytest.fixture
def built(built_once, tmp_path):
    """A copy of it, with the times of its files."""
    return pathlib.Path(shutil.copytree(built_once, tmp_path / "checkout", symlinks=True))


def build_in(folder, **environment):
    done = run(["setup.py", "-q", "build_ext", "--inplace"], folder, **environment)
    assert done.returncode == 0, done.stderr
    return done


def how_it_runs(folder):
    """(files of the compiled modules, the reason for running interpreted)."""
    names = [f"ranger_sim.foundation.{name}" for name in ("events", "numbers", "random_stream")]
    done = run(["-c", "from ranger_sim import loading; print(loading.RUNS_INTERPRETED_BECAUSE)"], folder)
    assert done.returncode == 0, done.stderr
    return list(files_of(names, folder).values()), done.stdout.strip()


@needs_compiler
def test_sources_that_changed_since_the_build_run_and_are_named_until_they_are_as_before(built):
    numbers, events = (built / "foundation" / name for name in ("numbers.py", "events.py"))
    before = numbers.read_text(encoding="utf-8"), events.read_text(encoding="utf-8")
    numbers.write_text(before[0] + "\nADDED = 1\n", encoding="utf-8")
    files, reason = how_it_runs(built)
    assert all(file.endswith(".py") for file in files)
    assert reason == "foundation/numbers.py changed since the build: `make setup` builds again"
    events.write_text(before[1] + "\n", encoding="utf-8")
    _, reason = how_it_runs(built)
    assert reason.startswith("foundation/events.py and 1 more changed since the build")
    numbers.write_text(before[0], encoding="utf-8")
    events.write_text(before[1], encoding="utf-8")
    files, reason = how_it_runs(built)
    assert reason == "" and all(file.endswith(BUILT) for file in files)
    (built / "foundation" / "later.py").write_text("import cython\n", encoding="utf-8")
    _, reason = how_it_runs(built)
    assert reason.startswith("foundation/later.py changed since the build")
    (built / "foundation" / "later.py").write_text("PLAIN = 1\n", encoding="utf-8")
    assert how_it_runs(built)[1] == ""


def times_of_libraries(folder):
    """{name of a library: when it was written, ns}."""
    return {
        path.name.partition(".")[0]: path.stat().st_mtime_ns
        for path in (folder / "build" / "compiled").rglob("*")
        if path.suffix in BUILT
    }


@needs_compiler
def test_a_build_compiles_and_rebuilds_a_changed_module_and_those_whose_view_of_it_changed(built):
    files, reason = how_it_runs(built)
    assert all(file.endswith(BUILT) and "/build/compiled/" in file for file in files) and reason == ""
    assert not list((built / "foundation").glob("*.c")) and not list((built / "foundation").glob("*.so"))

    first = times_of_libraries(built)
    events = built / "foundation" / "events.py"
    text = events.read_text(encoding="utf-8")
    events.write_text(text + "\n# a remark\n", encoding="utf-8")
    build_in(built)
    now = times_of_libraries(built)
    assert {name for name in now if now[name] != first[name]} == {"events"}

    # numbers cimports nothing of events, row_stream cimports its constants
    events.write_text(text.replace("TX_LOST: Final = 2", "TX_LOST: Final = 3"), encoding="utf-8")
    build_in(built)
    later = times_of_libraries(built)
    changed = {name for name in later if later[name] != now[name]}
    assert "events" in changed and "numbers" not in changed
    assert how_it_runs(built)[1] == ""


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="the linker of this test is a shell script")
def test_a_library_that_was_half_written_when_the_build_was_killed_is_made_by_the_next_build(built):
    numbers = built / "foundation" / "numbers.py"
    numbers.write_text(numbers.read_text(encoding="utf-8") + "\n# a remark\n", encoding="utf-8")
    linker = built / "cc"
    linker.write_text(
        "#!/bin/sh\n"
        'for each in "$@"; do\n'
        '  case "$last $each" in\n'
        '    "-o "*numbers.*so*) head -c 1000 /dev/zero > "$each"; kill -9 $PPID; exit 1;;\n'
        "  esac\n"
        '  last="$each"\n'
        "done\n"
        f'exec {CC} "$@"\n',
        encoding="ascii",
    )
    linker.chmod(0o755)
    killed = run(["setup.py", "-q", "build_ext", "--inplace"], built, CC=str(linker))
    assert killed.returncode == -signal.SIGKILL
    build_in(built)
    files, reason = how_it_runs(built)
    assert all(file.endswith(BUILT) for file in files) and reason == ""


@needs_compiler
def test_a_declaration_that_is_not_understood_is_reported_and_nothing_compiled_runs(built):
    numbers = built / "foundation" / "numbers.py"
    more = '\nfrom typing import Final\n\nWIDE: Final = "x"\n'
    numbers.write_text(numbers.read_text(encoding="utf-8") + more, encoding="utf-8")
    line = len(numbers.read_text(encoding="utf-8").splitlines())
    report = build_in(built).stderr
    assert "NOT COMPILED" in report and f"numbers.py:{line}: WIDE: a C constant is a whole number, not 'x'" in report
    files, reason = how_it_runs(built)
    assert all(file.endswith(".py") for file in files) and "a C constant is a whole number" in reason


@needs_compiler
def test_a_source_that_cython_refuses_is_reported_and_nothing_compiled_runs(checkout):
    numbers = checkout / "foundation" / "numbers.py"
    wrong = "\n\n@cython.cfunc\ndef wrong(value: cython.p_double) -> object:\n    return value  # no Python object\n"
    numbers.write_text(numbers.read_text(encoding="utf-8") + wrong, encoding="utf-8")
    report = build_in(checkout).stderr
    assert "NOT COMPILED" in report and "numbers" in report and "setup.log" in report
    files, reason = how_it_runs(checkout)
    assert all(file.endswith(".py") for file in files) and "could not translate" in reason


@needs_compiler
def test_a_compiler_that_knows_fewer_options_builds_as_well(checkout):
    compiler = checkout / "cc"
    compiler.write_text(f'#!/bin/sh\ncase "$*" in *-fno-plt*) exit 1;; esac\nexec {CC} "$@"\n', encoding="ascii")
    compiler.chmod(0o755)
    build_in(checkout, CC=str(compiler))
    files, reason = how_it_runs(checkout)
    assert all(file.endswith(BUILT) for file in files) and reason == ""


def test_without_a_compiler_the_sources_run_and_the_reason_is_reported(checkout):
    report = build_in(checkout, CC="/bin/false").stderr
    assert "NOT COMPILED" in report and "/bin/false" in report
    files, reason = how_it_runs(checkout)
    assert all(file.endswith(".py") for file in files)
    assert "C compiler '/bin/false'" in reason


def test_a_build_can_leave_out_compiling(checkout):
    report = build_in(checkout, RANGER_SIM_INTERPRETED="1").stderr
    assert "NOT COMPILED: RANGER_SIM_INTERPRETED was set" in report
    assert all(file.endswith(".py") for file in how_it_runs(checkout)[0])


def test_a_record_of_the_build_that_is_damaged_is_reported_and_the_sources_run(checkout):
    build_in(checkout, CC="/bin/false")
    [record] = (checkout / "build" / "compiled").glob("*/build_record.json")
    for text in ("{", "[]", '{"compiled": true, "sources": {"foundation/events.py": "old"}}', '{"compiled": true}'):
        record.write_text(text, encoding="utf-8")
        files, reason = how_it_runs(checkout)
        assert all(file.endswith(".py") for file in files), text
        assert "is not readable" in reason, text


def test_links_that_have_become_files_stop_the_import_and_the_build_with_one_line(checkout):
    """As a checkout without symbolic links leaves them, and some programs that unpack archives."""
    link = checkout / "ranger_sim" / "foundation"
    link.unlink()
    link.write_text("../foundation", encoding="ascii")
    done = run(["-c", "import ranger_sim"], checkout)
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: {link} is a file and not a link to the folder")
    done = run(["setup.py", "-q", "build_py", "--build-lib", "out"], checkout)
    assert done.returncode == 1 and not (checkout / "out").exists()
    assert done.stderr.startswith(f"ranger-sim cannot be built: {link} is a file and not a link")
    assert len(done.stderr.splitlines()) == 1


# --- the papers -------------------------------------------------------------------------------------------


def wanted_packages():
    """(dependencies, what the extras add), as pyproject.toml has them, without extras in extras."""
    extras = PROJECT["project"]["optional-dependencies"].values()
    return PROJECT["project"]["dependencies"], [each for extra in extras for each in extra if "[" not in each]


def locked():
    """{name: lines} of requirements.lock."""
    entries, name = {}, None
    for line in (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith((" ", "#")):
            name = name_of(line)
        if name:
            entries.setdefault(name, []).append(line)
    return entries


def test_the_lock_has_every_direct_dependency_with_hashes_and_names_no_index():
    entries = locked()
    dependencies, more = wanted_packages()
    direct = dependencies + more + PROJECT["build-system"]["requires"]
    assert [text for text in direct if name_of(text) not in entries] == []
    assert [name for name, lines in entries.items() if not any("--hash=sha256:" in line for line in lines)] == []
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    assert "://" not in text and "--index" not in text and "--find-links" not in text
    for wanted in direct:  # what the lock says it is there for
        if wanted not in PROJECT["build-system"]["requires"]:
            assert any("ranger-sim (pyproject.toml)" in line for line in entries[name_of(wanted)]), wanted


LOCK = """\
beta==2.0 ; python_full_version < '3.12' \\
    --hash=sha256:02
    # via
    #   alpha
    #   other
alpha==1.0 \\
    --hash=sha256:01
    # via ranger-sim (pyproject.toml)
gamma==3.0 \\
    --hash=sha256:03
    # via beta
other-one==4.0 \\
    --hash=sha256:04
    # via ranger-sim (pyproject.toml)
other==5.0 \\
    --hash=sha256:05
    # via other-one
"""


def names_in(lock):
    return [name_of(line) for line in lock.splitlines() if re.match("[a-z]", line)]


def test_a_part_of_the_lock_has_what_is_wanted_and_what_that_needs_with_all_hashes():
    part = part_of_lock(LOCK, {"alpha"})
    assert names_in(part) == ["beta", "alpha", "gamma"]
    assert part.count("--hash") == 3 and "python_full_version < '3.12'" in part
    assert names_in(part_of_lock(LOCK, {"other"})) == ["beta", "gamma", "other"]
    assert part_of_lock(LOCK, None) == LOCK
    with pytest.raises(SetUpError, match="does not have delta"):
        part_of_lock(LOCK, {"alpha", "delta"})


def test_make_walk_installs_what_every_command_needs_and_pytest_and_no_more():
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    dependencies, more = wanted_packages()
    names = names_in(part_of_lock(lock, for_a_walk(PROJECT)))
    assert {"python-can", "cantools", "numpy", "scipy", "pyserial", "pytest", "pandas", "plotly"} <= set(names)
    assert {name_of(each) for each in dependencies} <= set(names)
    assert not {"hypothesis", "mypy", "ruff", "distributed", "sphinx"} & set(names)
    assert {name_of(each) for each in dependencies + more} <= set(names_in(part_of_lock(lock, None)))


def test_make_walk_ends_with_three_commands_that_are_right_as_they_are_printed():
    recipe = re.search(r"^walk:.*?(?=^\S)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)[
        0
    ]
    commands = re.findall(r'@echo "    \$\(VENV\)/bin/ranger-sim (.*?) +# ', recipe)
    assert len(commands) == 3
    for command in commands:
        cli.parser().parse_args(shlex.split(command))


def test_modules_that_are_optimised_most_exist():
    source = (ROOT / "setup.py").read_text(encoding="utf-8")
    listed = re.findall(r'"([\w.]+)"', re.search(r"OFTEN_RUN = \((.*?)\)\n", source, re.DOTALL)[1])
    assert len(listed) > 20 and set(listed) <= set(loading.declared_modules())


def test_every_dependency_has_its_reason_next_to_it():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    listed = re.findall(r'^  "[A-Za-z][\w.-]*>=[^"]*",(.*)$', text, re.MULTILINE)
    dependencies, more = wanted_packages()
    grouped = [
        each for group in PROJECT["dependency-groups"].values() for each in group
    ]  # not in the lock, reasoned too
    assert len(listed) == len(dependencies + more + grouped) + len(PROJECT["build-system"]["requires"])
    assert all(re.fullmatch(r"\s+# \w.{10,}", rest) for rest in listed)


def test_what_is_cited_is_this_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [__version__]
    assert re.findall(r"^license: (.+)$", citation, re.MULTILINE) == [PROJECT["project"]["license"]]


def test_type_checking_leaves_no_module_out():
    settings = [PROJECT["tool"]["mypy"], *PROJECT["tool"]["mypy"]["overrides"]]
    assert PROJECT["tool"]["mypy"]["strict"] and not any(each.get("ignore_errors") for each in settings)
    assert not [each for each in settings if "ranger_sim" in str(each.get("module"))]


# --- types ------------------------------------------------------------------------------------------------


USERS_SCRIPT = """\
from typing import assert_type

from ranger_sim import Profile, Quirks, Ranger, Scenario, StopRule, load_profile
from ranger_sim.boards.hip import HipBoard
from ranger_sim.firmware_sim.scheduler import SlotScheduler, Task


def mine() -> int | None:
    return None


quirks = Quirks.named(hip_rezero=False)
assert_type(quirks, Quirks)
assert_type(quirks.hip_rezero, bool)
profile = load_profile("hil-1mbit")
assert_type(profile, Profile)
robot = Ranger(Scenario(seed=3), quirks=quirks)
board = robot.board("MCH")
assert_type(board, HipBoard)
robot.replace("MCH", "mc_compliant_control", mine, cost=4200, limit=6000)
robot.run(StopRule(time_s=0.05))
assert_type(robot.steps, int)
assert_type(robot.variable("MCH_ANGLE"), float)
assert_type(board.scheduler, SlotScheduler)
assert_type(board.scheduler.max_slot_cycles, int)
assert_type(board.scheduler.ns_per_cycle, float)
task = Task(mine, cost=100, limit=200)
assert_type(task.calls, int)
assert_type(task.name, str)
assert_type(board.joint.position, int)
for other in ("MB", "CSR"):
    assert robot.boards[other].scheduler.slot_count > 0
robot.close()
"""


def user_errors(shipped, folder, script):
    """What `mypy --strict` says to a script in an environment into which the shipped packages are installed."""
    environment = folder / "environment"
    if not environment.exists():
        venv.create(environment, with_pip=False, symlinks=os.name == "posix")
        [packages] = environment.glob("lib/python*/site-packages")
        (packages / "ranger_sim").symlink_to(shipped / "ranger_sim")
    (folder / "script.py").write_text(script, encoding="utf-8")
    (folder / "mypy.ini").write_text("[mypy]\n", encoding="ascii")
    done = run(
        ["-m", "mypy", "--strict", "--python-executable", environment / "bin" / "python", "script.py"],
        folder,
    )
    assert done.returncode in (0, 1), done.stderr
    return re.findall(r"^script\.py:(\d+): error: .*\[([\w-]+)\]$", done.stdout, re.MULTILINE)


def test_a_users_script_is_checked_strictly_against_the_shipped_types_and_runs(shipped, tmp_path):
    pytest.importorskip("mypy")
    assert user_errors(shipped, tmp_path, USERS_SCRIPT) == []
    done = run([tmp_path / "script.py"], tmp_path, PYTHONPATH=str(shipped))
    assert done.returncode == 0, done.stderr
    wrong = """\
from ranger_sim import Ranger, Scenario, StopRule
robot = Ranger(Scenario(seed="3"))
robot.board("NOPE")
robot.run(StopRule(steps="3"))
robot.board("MCH").scheduler.no_such_field
robot.board("MCH").scheduler.max_slot_cycles = "many"
robot.board("MCH").scheduler.find()
robot.replace("NOPE", "mc_compliant_control", lambda: None, cost=1)
"""
    assert user_errors(shipped, tmp_path, wrong) == [
        ("2", "arg-type"),
        ("3", "call-overload"),
        ("4", "arg-type"),
        ("5", "attr-defined"),
        ("6", "assignment"),
        ("7", "call-arg"),
        ("8", "arg-type"),
    ]


# --- what the package index shows


def test_the_readmes_links_lead_to_files_of_the_tag_and_images_to_their_bytes():
    address, text = "https://host.example/owner/name", (ROOT / "README.md").read_text(encoding="utf-8")
    shown = publication.readme(text, address + "/", "1.2.3")
    assert not re.search(r"\]\((?!https?://|#)", shown)
    kinds = re.findall(rf"\]\({address}/(blob|raw)/v1\.2\.3/([^)#]+)", shown)
    assert len(kinds) > 20 and [path for _, path in kinds if not (ROOT / path).exists()] == []
    assert {kind for kind, path in kinds if path.endswith((".svg", ".png"))} == {"raw"}
    assert {kind for kind, path in kinds if path.endswith(".md")} == {"blob"}
    assert publication.readme(text, "", "1.2.3") == text


def test_a_link_around_an_image_and_a_link_elsewhere():
    text = "[![a](docs/a.svg)](docs/a.md) [b](https://b.example/c) [d](#e)"
    there = "https://h/o/n"
    assert publication.readme(text, there, "1") == (
        f"[![a]({there}/raw/v1/docs/a.svg)]({there}/blob/v1/docs/a.md) [b](https://b.example/c) [d](#e)"
    )


def test_a_build_has_addresses_only_where_it_gets_one():
    asked = ["setup.py", "-q", "--name", "--url", "--long-description"]
    assert publication.addresses("", "1") == {}
    without = run(asked, ROOT).stdout
    with_one = run(asked, ROOT, RANGER_SIM_ADDRESS="https://h/o/n").stdout
    assert "](docs/" in without and "](docs/" not in with_one and f"/blob/v{__version__}/docs/" in with_one
