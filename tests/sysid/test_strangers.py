"""One true recording as other people's writers write it: read as the truth, or refused with the true reason."""

import pytest

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
