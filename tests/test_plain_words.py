"""Documents, docstrings, messages and names of tests are in the plain English of this field.

`PRIVATE` has the words that this code base once used for its packages, interfaces and events, each with the usual ones:
an engineer new to it had to learn them first. Code, in backquotes or in a block, is not prose.
"""

import ast
import functools
import pathlib
import re
from collections.abc import Iterator

import pytest

from ranger_sim.loading import packages

ROOT = pathlib.Path(__file__).resolve().parent.parent
PACKAGES = sorted({*packages(), "dev", "docs", "examples", "tests"} - {"profiles"})

# Words that begin no noun: "of its own" before one of them is the end of a phrase, "the CRC of its own frame" is not.
NO_NOUN = "in|on|and|or|with|for|to|at|from|by|that|which|instead|is|are|so|as|than|here|there"

# Private words, and the words to use.
PRIVATE = {
    r"(?:re)?told|tell(?:s|ing)?": "reports, prints, returns, describes; distinguishes",
    r"nobody|somebody|everybody|whoever": "a client, no client, a user, each board",
    r"hears?|heard|hearing": "receives",
    r"said": "sent, reported",
    r"(?<!there )(?:is|are|was|were) no(?! (?:longer|more|matter|other|\w+er)\b)(?= \w)": "is not a",
    r"(?<!when )(?<!if )(?<!where )(?<!why )there (?:is|are|was|were) none": "unknown name 'X' (available: A, B)",
    r"none of (?:this|that) name": "unknown name 'X' (available: A, B)",
    r"meant was perhaps": "did you mean 'X'?",
    r"until then": "before that; deadline",
    r"besides?": "next to, compared with, in addition to",
    rf"of (?:its|their|his) own(?= (?:{NO_NOUN})\b|\W*$|[^\w\s])": "separate, own",
    r"rooms?": "package",
    r"(?:the|our|this) house": "architecture, repository",
    r"doors?": "interface, endpoint, port",
    r"knock\w*": "connection attempt",
    r"wish(?:es|ed)?": "request",
    r"(?:a|each|every|per|between) looks?(?!-)": "poll",
    r"instants?": "time",
    r"(?:bytes?|frames?|samples?|messages?|packets?|edges?|that|what) came": "arrived",
    r"stands? (?:in|at|there|here|for|still|above|below|behind|between)": "is, is listed; represents; stops",
    r"greet\w*": "handshake",
    r"undertaker\w*": "process reaper",
    r"fresh from the shelf": "new and unwired",
}

# Text in which such a word is the right one, with the reason.
ALLOWED = {
    r"room temperature|no room": "of a building, and of space",
    r"stand in the air": "sensors of a robot's feet",
    r"at a look|per look": "the term of group-sequential statistics",
    r"critical instants?": "the term of response-time analysis",
    r"tracks? of instants|counters and instants|instants (?:are|by)": "Perfetto's events without a length",
    r"doors fuzz": "the label of a fuzzer's random numbers: recorded seeds make the same cases",
}

FOUND = re.compile("|".join(rf"\b(?:{word})(?!\w)" for word in PRIVATE), re.IGNORECASE)
RIGHT = re.compile("|".join(rf"(?:{text})" for text in ALLOWED), re.IGNORECASE)

Text = tuple[str, int, str]  # kind, line, text


def private_words(text: str) -> list[str]:
    """The private words of a text without code."""
    return [match.group() for match in FOUND.finditer(RIGHT.sub("", without_code(text)))]


def without_code(text: str) -> str:
    """A text without what is in backquotes, and without the targets of links."""
    return re.sub(r"`[^`\n]+`|\]\([^)\n]*\)", "", text)


def of_document(source: str) -> Iterator[Text]:
    """Lines of a Markdown page outside blocks of code."""
    fence = ""
    for number, line in enumerate(source.splitlines(), 1):
        mark = re.match(r" *(`{3,})", line)
        if mark and (not fence or mark.group(1).startswith(fence)):
            fence = "" if fence else mark.group(1)
        elif not fence and not line.startswith("    "):
            yield "document", number, line


def of_module(source: str, is_test: bool) -> Iterator[Text]:
    """Docstrings and names of tests of a module; its messages too, which are the strings of several words."""
    tree = ast.parse(source)
    seen = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                seen.add(first.value)
                if isinstance(first.value.value, str):
                    for number, line in enumerate(first.value.value.splitlines(), first.value.lineno):
                        yield "docstring", number, line
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test_"):
            yield "name of a test", node.lineno, node.name.replace("_", " ")
        if isinstance(node, ast.JoinedStr):
            parts = [part for part in node.values if isinstance(part, ast.Constant)]
            seen.update(parts)
            if not is_test:
                yield "message", node.lineno, " {} ".join(str(part.value) for part in parts)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in seen and not is_test:
            if re.search(r"\w\s+\w", node.value):
                yield "message", node.lineno, node.value


SCRIPT_TEXT = re.compile(r"""//[^\n]*|/\*.*?\*/|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'|`(?:[^`\\]|\\.)*`""", re.DOTALL)


def of_script(source: str) -> Iterator[Text]:
    """Comments and messages of a page's program: its strings of several words."""
    for match in SCRIPT_TEXT.finditer(source):
        text = re.sub(r"\$\{[^}]*\}|<[^>]*>", " {} ", match.group())
        if re.search(r"\w\s+(?:\{\}\s+)*\w", text):
            yield "message", source.count("\n", 0, match.start()) + 1, text.replace("`", "")


def of_page(source: str) -> Iterator[Text]:
    """Text of a page of HTML, without its style, program and tags."""
    blank = re.sub(
        r"<(script|style)\b.*?</\1>|\{[%{#].*?[%}#]\}|<[^>]*>",
        lambda match: "\n" * match.group().count("\n") or " ",
        source,
        flags=re.DOTALL,
    )
    for number, line in enumerate(blank.splitlines(), 1):
        yield "page", number, line


@functools.cache
def texts(package: str) -> list[tuple[pathlib.Path, Text]]:
    """Every text of a package; of the repository's own pages for the package "."."""
    found: list[tuple[pathlib.Path, Text]] = []
    folder = ROOT / package
    paths = folder.glob("*.md") if package == "." else folder.rglob("*")
    for path in sorted(paths):
        parts = path.relative_to(ROOT).parts
        if "generated" in parts or "build" in parts or path == pathlib.Path(__file__).resolve():
            continue
        if path.suffix == ".md":
            found += ((path, each) for each in of_document(path.read_text(encoding="utf-8")))
        elif path.suffix == ".py":
            found += ((path, each) for each in of_module(path.read_text(encoding="utf-8"), package == "tests"))
        elif path.suffix == ".js" and not path.name.startswith("uplot"):
            found += ((path, each) for each in of_script(path.read_text(encoding="utf-8")))
        elif path.name.endswith((".html", ".html.j2")):
            found += ((path, each) for each in of_page(path.read_text(encoding="utf-8")))
        elif path.suffix == ".j2":  # what `ranger-sim new` writes, names in it as well
            lines = path.read_text(encoding="utf-8").splitlines()
            found += ((path, ("template", number, line)) for number, line in enumerate(lines, 1))
    return found


@pytest.mark.parametrize("package", [".", *PACKAGES])
def test_prose_has_no_private_words(package):
    found = [
        f"{path.relative_to(ROOT)}:{line}: {kind}: {word!r} in {text.strip()[:100]!r}"
        for path, (kind, line, text) in texts(package)
        for word in private_words(text)
    ]
    assert not found, "\n".join(found)


PAGE = """A page of the house.
```python
print("the doors")
```
Its `doors` and [a link](doors.md).
````
```
knocks
````
    an indented block that tells

A server tells nobody.
"""
MODULE = '''"""A module.

It hears frames."""

def test_a_peer_is_told(x):
    """Nobody waits."""
    raise ValueError(f"{x} is no Bus", "doors")
'''


def found_in(texts_found):
    return [(kind, line, word) for kind, line, text in texts_found for word in private_words(text)]


def test_private_words_of_a_page_are_found_outside_its_code():
    words = [("document", 1, "the house"), ("document", 12, "tells"), ("document", 12, "nobody")]
    assert found_in(of_document(PAGE)) == words


def test_private_words_of_a_module_are_found_in_docstrings_messages_and_names_of_tests():
    words = [
        ("docstring", 3, "hears"),
        ("docstring", 6, "Nobody"),
        ("message", 7, "is no"),
        ("name of a test", 5, "told"),
    ]
    assert sorted(found_in(of_module(MODULE, is_test=False))) == words
    assert ("message", 7, "is no") not in found_in(of_module(MODULE, is_test=True))


def test_private_words_of_a_page_for_the_browser_are_found_in_its_text_and_messages():
    page = "<style>\n.door {}\n</style><p>Nobody is\n<b>told</b>.</p>{% if told %}"
    assert found_in(of_page(page)) == [("page", 3, "Nobody"), ("page", 4, "told")]
    script = 'const heard = "door";\n// nobody waits\nreturn `the ${heard} ${n} doors`;'
    assert found_in(of_script(script)) == [("message", 2, "nobody"), ("message", 3, "doors")]


@pytest.mark.parametrize(
    "text",
    [
        "there is no file",
        "it is no longer open",
        "the CRC of its own frame",
        "False when there is none",
        "the robot stands on its outer legs",
        "at room temperature",
        "his house and the houses",
        "a look-up in a table",
    ],
)
def test_the_same_words_in_their_usual_sense_are_allowed(text):
    assert private_words(text) == []


def test_every_exception_is_needed():
    prose = "\n".join(text for package in [".", *PACKAGES] for _, (_, _, text) in texts(package))
    for allowed in ALLOWED:
        uses = re.findall(rf"(?:{allowed})", prose, re.IGNORECASE)
        assert any(FOUND.search(use) for use in uses), allowed
