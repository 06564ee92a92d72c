"""The documentation as a site: `make docs` builds it into build/site, and a warning is an error.

The source is the whole repository, of which only the documents below are taken, so that they link to each other and to
data as they do on a code host. Commands come from the parser of the command line, classes from their docstrings.
"""

import os
import pathlib
import sys

os.environ["RANGER_SIM_INTERPRETED"] = "1"  # compiled methods have no signatures to show
ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from ranger_sim import __version__  # noqa: E402

project = "ranger-sim"
copyright = "its authors, MIT licence"  # noqa: A001
version = release = __version__
root_doc = "docs/index"
include_patterns = [
    "docs/**.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "boards/QUIRKS.md",
    "can_bus/edge/ATTACH.md",
    "datatable/README.md",
    "firmware_sim/README.md",
    "harness/campaigns/README.md",
    "harness/processes/README.md",
    "plant/EQUATIONS.md",
    "sysid/README.md",
    "tests/blind/README.md",
    "dev/vm/README.md",
]
exclude_patterns = ["**/.*", ".venv", "build"]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinxarg.ext", "sphinx_copybutton"]

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # headings may begin at any level
nitpicky = True
# classes of single boards and of other libraries are named in signatures and have no page here
nitpick_ignore_regex = [
    ("py:class", r"(ranger_sim\.boards|ranger_sim\.sysid\.dataset|can|numpy|collections|pathlib|rich)\..*"),
    ("py:class", "ForkedBoards"),
]
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
copybutton_prompt_text = "$ "

html_theme = "furo"
html_title = f"ranger-sim {__version__}"
html_show_sourcelink = False
html_copy_source = False


def setup(app):
    """Docstrings are plain text: what is indented in them is an example or a table, and keeps its lines."""
    app.connect("autodoc-process-docstring", _keep_indented)


def _keep_indented(app, what, name, obj, options, lines):
    out, inside = [], False
    for line in lines:
        if not line.strip():
            out.append(line)
            continue
        if line.startswith("    ") and not inside and (not out or not out[-1].strip()):
            out += [".. code-block:: text", ""]
            inside = True
        elif not line.startswith("    "):
            inside = False
        out.append(line)
    lines[:] = out
