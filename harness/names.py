"""Names of the numbers on a machine's buses: identifiers, types, errors and boards, by its master table."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ranger_sim.datatable.packing import parts_of_error_word, value_of_word
from ranger_sim.foundation.user_error import UserError, unknown

if TYPE_CHECKING:
    from ranger_sim.datatable.model import Table


@dataclasses.dataclass(frozen=True, eq=False)
class Names:
    """Variables and boards by number, errors by code; `normal_*`: how often a healthy machine's boards record an error.

    hash: of the master files.
    """

    variables: Mapping[int, str] = dataclasses.field(default_factory=dict)
    types: Mapping[int, str] = dataclasses.field(default_factory=dict)
    counts: Mapping[int, int] = dataclasses.field(default_factory=dict)  # of values in one frame, where above 1
    boards: Mapping[int, str] = dataclasses.field(default_factory=dict)
    errors: Mapping[int, str] = dataclasses.field(default_factory=dict)
    descriptions: Mapping[int, str] = dataclasses.field(default_factory=dict)
    normal_per_s: Mapping[int, Mapping[str, float]] = dataclasses.field(default_factory=dict)
    normal_at_start: Mapping[int, Mapping[str, float]] = dataclasses.field(default_factory=dict)
    hash: str = ""
    ids: Mapping[str, int] = dataclasses.field(init=False)
    codes: Mapping[str, int] = dataclasses.field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", {name: number for number, name in self.variables.items()})
        object.__setattr__(self, "codes", {name: code for code, name in self.errors.items()})

    @classmethod
    def of(cls, table: Table) -> Names:
        """Those of a loaded table."""
        return cls(
            variables={each.id: each.name for each in table.variables},
            types={each.id: each.type for each in table.variables},
            counts={each.id: each.count for each in table.variables if each.count > 1},
            boards={each.number: each.name for each in table.boards},
            errors={each.id: each.name for each in table.errors},
            descriptions={each.id: each.description for each in table.errors},
            normal_per_s={each.id: each.normal_per_s for each in table.errors},
            normal_at_start={each.id: each.normal_at_start for each in table.errors},
            hash=table.hash,
        )

    def identifier(self, name: str | int) -> int:
        """The identifier of a variable; a number is returned unchanged. UserError for a name not in the table."""
        if isinstance(name, int):
            return name
        number = self.ids.get(name)
        if number is None:
            raise UserError(unknown("frame", name, self.ids))
        return number

    def name(self, identifier: int) -> str:
        """The variable's name, or the identifier where the table has none."""
        return self.variables.get(identifier, f"{identifier:03X}")

    def value(self, identifier: int, word: int) -> float:
        """The value word as the table's type reads it; unchanged for an identifier without one."""
        kind = self.types.get(identifier)
        return word if kind is None else value_of_word(kind, word)

    def error_text(self, word: int) -> str:
        """The text of an error word."""
        code, board, count = parts_of_error_word(word)
        return f"{self.errors.get(code, code)} x {count} from {self.boards.get(board, board)}"

    def error_variables(self) -> set[int]:
        """Identifiers of the frames that carry error words."""
        return {number for number, name in self.variables.items() if name.startswith("ERROR_")}

    def is_normal(self, word: int) -> bool:
        """Whether the error of an error word is one that a healthy machine's board records."""
        code, board, _ = parts_of_error_word(word)
        return self.boards.get(board) in self.normal_per_s.get(code, {})
