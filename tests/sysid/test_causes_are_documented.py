"""docs/reference/causes.md has every cause and every number that machines know or look for: none changes unseen."""

import importlib.util
import pathlib

DOCS = pathlib.Path(__file__).resolve().parents[2] / "docs"


def test_the_page_is_what_its_program_writes():
    spec = importlib.util.spec_from_file_location("causes_table", DOCS / "causes_table.py")
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    assert (DOCS / "reference/causes.md").read_text(encoding="utf-8") == program.page()
