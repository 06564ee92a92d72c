"""The one reader of TOML files: known answers, limits that act before the library reads, and files of others."""

import importlib.util
import pathlib
import tomllib

import pytest

from ranger_sim.foundation import toml_file
from ranger_sim.foundation.user_error import UserError
from ranger_sim.foundation.wallclock import process_cpu_s

SPEC = importlib.util.find_spec("test")  # the tests of Python itself, where they are installed
OTHERS = pathlib.Path(SPEC.origin).parent / "test_tomllib" / "data" if SPEC and SPEC.origin else pathlib.Path("none")
VALID, INVALID = (sorted((OTHERS / kind).rglob("*.toml")) for kind in ("valid", "invalid"))


def load(tmp_path, content):
    path = tmp_path / "mine.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return toml_file.load(path)


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_file_reads_with_and_without_a_byte_order_mark_on_either_system(tmp_path, mark, end):
    text = f'title = "Größe"{end}[a.b]{end}c = [1, 2.5]{end}'
    assert load(tmp_path, mark + text.encode()) == {"title": "Größe", "a": {"b": {"c": [1, 2.5]}}}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a = 1\nb = \n", ":2:5: not valid TOML: Invalid value"),
        ("a = 1\n[b\n", ":2:3: not valid TOML: Expected ']' at the end of a table declaration"),
        ("a = 1\na = 2", ":2:6: not valid TOML: Cannot overwrite a value"),
        ('a = """x\n', ":2:1: not valid TOML: Unterminated string"),
        ("\ufeff\ufeffa = 1", ":1:1: not valid TOML: Invalid statement"),
        (b"a = 1\nb = '\xc3\xa4\xff'\n", ":2:7: not UTF-8 text (byte 13)"),
        ("a = 1\n".encode("utf-16"), ":1:1: not UTF-8 text (byte 0)"),
        ("a = 2021-02-30", ":1:5: not valid TOML: Invalid date or datetime"),
        (f"a = {'9' * 5000}", ": not valid TOML: Exceeds the limit (4300 digits) for integer string conversion"),
    ],
)
def test_a_mistake_is_reported_with_file_line_and_column(tmp_path, content, message):
    with pytest.raises(UserError) as error:
        load(tmp_path, content)
    assert str(error.value).startswith(f"{tmp_path / 'mine.toml'}{message}")
    assert len(str(error.value).splitlines()) == 1


DEEPEST = "a = " + "[" * 32 + "]" * 32
LONGEST = ".".join("k" * 16) + " = 1"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a = " + "[" * 33 + "]" * 33, ":1:37: nested more than 32 levels deep"),
        ("\n\na = " + "{b = " * 100_000 + "1" + "}" * 100_000, ":3:165: nested more than 32 levels deep"),
        ("a = " + "[" * 200_000, ":1:37: nested more than 32 levels deep"),
        (".".join("k" * 17) + " = 1", ":1:32: a key of more than 16 parts"),
        ("\n[" + ".".join(["k"] * 50_000) + "]", ":2:33: a key of more than 16 parts"),
        ("a = {" + '."x"' * 20 + "= 1}", ":1:66: a key of more than 16 parts"),
        ("#" * (1 << 20) + "#", ": larger than 1048576 bytes"),
    ],
)
def test_a_file_beyond_a_limit_is_refused_at_once(tmp_path, content, message):
    begun = process_cpu_s()
    with pytest.raises(toml_file.TomlError) as error:
        load(tmp_path, content)
    assert str(error.value).endswith(f"mine.toml{message}")
    assert process_cpu_s() - begun < 1.0  # milliseconds; a key of 50,000 parts took 15 s


def test_what_is_just_within_the_limits_is_read(tmp_path):
    assert list(load(tmp_path, DEEPEST)) == ["a"]
    assert list(load(tmp_path, LONGEST)) == ["k"]
    assert load(tmp_path, "a = 1\n" + "#" * ((1 << 20) - 6)) == {"a": 1}


def test_brackets_and_dots_in_strings_and_comments_count_for_nothing(tmp_path):
    many = "[{." * 100
    text = f"a = \"{many}\"\nb = '{many}'\nc = \"\"\"\n\"{many}\"\"\\\"\"\"\"\nd = '''''{many}'''''\n# {many}\n"
    found = load(tmp_path, text)
    assert found == {"a": many, "b": many, "c": f'"{many}"""', "d": f"''{many}''"}


def test_many_keys_of_one_file_are_read(tmp_path):
    text = "\n".join(f"a.b{number} = 1.5\n[t{number}.u.v]\nw = [[1.0, 2.0], [3.0]]" for number in range(3000))
    assert len(load(tmp_path, text)) == 3001


def test_what_cannot_be_opened_is_reported_as_the_system_says(tmp_path):
    for name, why in (("none.toml", "No such file or directory"), ("", "Is a directory"), ("\0", "not the name")):
        with pytest.raises(UserError, match=why):
            toml_file.load(f"{tmp_path}/{name}", "body file")
    with pytest.raises(UserError, match=f"^body file {tmp_path}/none.toml: "):
        toml_file.load(tmp_path / "none.toml", "body file")


@pytest.mark.skipif(not VALID, reason="Python's own tests are not installed")
def test_pythons_own_valid_files_read_as_python_reads_them():
    for path in VALID:
        assert repr(toml_file.load(path)) == repr(tomllib.loads(path.read_bytes().decode())), path
    assert len(VALID) > 10


@pytest.mark.skipif(not INVALID, reason="Python's own tests are not installed")
@pytest.mark.parametrize("path", INVALID, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_pythons_own_invalid_files_are_refused_in_one_line(path):
    with pytest.raises(toml_file.TomlError) as error:
        toml_file.load(path)
    assert str(error.value).startswith(f"{path}:{error.value.line}:{error.value.column}: not ")
