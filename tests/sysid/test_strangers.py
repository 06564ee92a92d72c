"""One true recording as other people's writers write it: read as the truth, or refused with the true reason."""

import pytest

from ranger_sim.can_bus.edge.logs import read_log
from tests.sysid import strangers

ALL = dict(strangers.strangers())


def test_there_are_as_many_files_of_other_writers_as_the_documentation_says():
    assert len(ALL) == 98


@pytest.mark.parametrize("name", ALL)
def test_a_file_of_another_writer_is_read_as_the_truth_or_refused_truly(name, tmp_path):
    verdict, reason = strangers.judged(ALL[name], tmp_path)
    if verdict == strangers.MISSING:
        pytest.skip(reason)
    assert verdict == (strangers.REFUSED if ALL[name].refused else strangers.RIGHT), reason


@pytest.mark.parametrize("ending", ["asc", "trc", "csv", "log"])
def test_a_recording_that_ends_anywhere_within_a_frame_has_no_frame_that_was_not_sent(ending, tmp_path):
    path = ALL[f"CAN: python-can, .{ending}"].write(tmp_path)
    content = path.read_bytes()
    begin = content.rfind(b"\n", 0, len(content) // 2) + 1
    end = content.index(b"\n", begin) + 1
    path.write_bytes(content[:end])
    whole = list(read_log(path))
    for cut in range(begin + 1, end - 1):
        path.write_bytes(content[:cut])
        log = read_log(path)
        frames = list(log)
        assert frames == whole[: len(frames)], content[begin:cut]
        losses = {f"left out: {reason}": 1 for reason, *_ in log.losses}
        assert log.ledger() == {"frames": len(frames)} | losses
        assert losses or len(frames) == len(whole) or not content[begin:cut].strip(), content[begin:cut]
