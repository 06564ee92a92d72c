"""The only reader of external JSON: finite numbers, bounded nesting, and a position in every error message."""

import json
import math
import re
from typing import Any

from ranger_sim.foundation.user_error import UserError

MOST_LEVELS = 32  # chosen by us: our own output has 8 at most
TOKEN = re.compile(r'"(?:[^"\\]|\\.)*+"?|[\[\]{}]', re.DOTALL)


class JsonError(UserError):
    """Input is not JSON, or exceeds a limit. `reason`: the message without the name of the source."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"{name}: {reason}")
        self.reason = reason


def loads(text: str | bytes, name: str) -> Any:
    """Parse `text` as the standard defines JSON: UTF-8, finite numbers, each name at most once in an object.

    Raises JsonError, which begins with `name`, for anything else and for more than `MOST_LEVELS` levels.
    """
    try:
        if isinstance(text, bytes):
            text = text.decode("utf-8-sig")
        _check_levels(text, name)

        def finite(word: str) -> float:
            number = float(word)
            if not math.isfinite(number):
                raise JsonError(name, f"{_short(word)} is not a finite number")
            return number

        def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
            content = dict(pairs)
            if len(content) != len(pairs):
                seen: set[str] = set()
                twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
                raise JsonError(name, f"{_short(twice)!r} comes twice in one object")
            return content

        return json.loads(text, parse_float=finite, parse_constant=finite, object_pairs_hook=once)
    except json.JSONDecodeError as error:
        raise JsonError(name, f"not valid JSON: {error.msg}, line {error.lineno} column {error.colno}") from None
    except UnicodeDecodeError as error:
        raise JsonError(name, f"not UTF-8 text (byte {error.start})") from None
    except ValueError as error:  # a whole number of thousands of digits
        raise JsonError(name, f"not valid JSON: {str(error).partition(';')[0]}") from None


def _check_levels(text: str, name: str) -> None:
    levels = 0
    for token in TOKEN.finditer(text):
        if token[0] in "[{":
            levels += 1
            if levels > MOST_LEVELS:
                raise JsonError(name, f"nested more than {MOST_LEVELS} levels deep")
        elif token[0] in "]}":
            levels -= 1


def _short(word: str) -> str:
    return word if len(word) <= 40 else word[:37] + "..."
