"""The one reader of JSON from outside."""

import pytest

from ranger_sim.foundation import json_text
from ranger_sim.foundation.user_error import UserError


def test_what_the_standard_has_is_read():
    assert json_text.loads('{"a": [1, -2.5e3, null, true, "x[{\\"]"]}', "it") == {
        "a": [1, -2500.0, None, True, 'x[{"]']
    }
    assert json_text.loads(b"\xef\xbb\xbf[]", "it") == []
    assert json_text.loads("[" * 32 + "]" * 32, "it")
    assert json_text.loads('"' + "[" * 1000 + '"', "it") == "[" * 1000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"at": 1e400}', "1e400 is not a finite number"),
        ('{"at": -1e999}', "-1e999 is not a finite number"),
        ("[NaN]", "NaN is not a finite number"),
        ("[-Infinity]", "-Infinity is not a finite number"),
        ("[" * 33 + "]" * 33, "nested more than 32 levels deep"),
        ('{"a":' * 100_000, "nested more than 32 levels deep"),
        ('{"do": "a", "x": {}, "do": "b"}', "'do' comes twice in one object"),
        ("{", "not valid JSON: Expecting property name enclosed in double quotes, line 1 column 2"),
        ("[1,\n  2,]", "not valid JSON: Expecting value, line 2 column 5"),
        ("", "not valid JSON: Expecting value, line 1 column 1"),
        ("9" * 5000, "not valid JSON: Exceeds the limit (4300 digits) for integer string conversion"),
        (b'"\xff"', "not UTF-8 text (byte 1)"),
    ],
)
def test_anything_else_is_refused_with_its_place(text, message):
    with pytest.raises(UserError) as error:
        json_text.loads(text, "a request")
    assert str(error.value).startswith(f"a request: {message}")
    assert len(str(error.value)) < 200
