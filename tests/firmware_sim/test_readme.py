"""The example board of firmware_sim/README.md is run as written there."""

import contextlib
import io
import pathlib
import re

README = pathlib.Path(__file__).parents[2] / "firmware_sim" / "README.md"


def test_the_example_board_of_the_readme_runs_and_prints_its_messages():
    (source,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)
    printed = io.StringIO()
    space: dict = {}
    with contextlib.redirect_stdout(printed):
        exec(compile(source, str(README), "exec"), space)  # noqa: S102
    lines = printed.getvalue().splitlines()
    # its crystal runs 20 ppm fast, so the fifth slot starts 40 ns before 2 ms; the edge counted once
    assert lines[0] == "5 1 0"
    kinds = [line.split()[1] for line in lines[1:]]
    assert kinds.count("32") == 1  # no bus answers, so buffer 1 is not free for the second one
    assert space["board"].can1.refused == 1
    assert kinds.count("35") == 4  # the bridge is written in every slot
    frame = next(line for line in lines[1:] if line.split()[1] == "32")
    assert frame.split()[2:] == ["1", "1", str(0x14)]
    assert space["board"].can1.TDA[1] == 1
