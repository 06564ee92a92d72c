"""The catalogue for logging programs: the whole table as JSON."""

from __future__ import annotations

import json

from ranger_sim.datatable.model import Table


def number(value: object) -> object:
    """A Fraction as a JSON number, anything else unchanged."""
    return None if value is None else float(value)  # type: ignore[arg-type]


def catalogue(table: Table) -> dict[str, object]:
    """The table as plain dictionaries and lists. Periods in ms; None for no period."""
    return {
        "format": 1,
        "table_hash": table.hash,
        "buses": [
            {"name": bus, "channel": channel, "bit_rate": table.bit_rates[bus]}
            | ({"data_bit_rate": table.data_bit_rates[bus]} if bus in table.data_bit_rates else {})
            for bus, channel in table.channels.items()
        ],
        "boards": [
            {
                "name": board.name,
                "number": board.number,
                "description": board.description,
                "buses": list(board.buses),
                "firmware": board.firmware,
                "slot_us": board.slot_us or None,
            }
            for board in table.boards
        ],
        "variables": [
            {
                "id": variable.id,
                "name": variable.name,
                "type": variable.type,
                "unit": variable.unit,
                "initial": variable.initial_as_stored,
                "publisher": variable.publisher,
                "subscribers": list(variable.subscribers),
                "buses": list(variable.buses),
                "period_ms": number(variable.period_ms),
                "minimum": variable.minimum,
                "maximum": variable.maximum,
                "error_word": variable.is_error_word,
                "spare": variable.is_spare,
                "description": variable.description,
            }
            | ({"count": variable.count} if variable.count > 1 else {})
            for variable in table.variables
        ],
        "errors": [
            {
                "code": error.id,
                "name": error.name,
                "boards": list(error.boards),
                "normal_per_s": error.normal_per_s,
                "normal_at_start": error.normal_at_start,
                "description": error.description,
            }
            for error in table.errors
        ],
    }


def catalogue_text(table: Table) -> str:
    """The catalogue as JSON text, one variable per line."""
    content = catalogue(table)
    lines = []
    for key, value in content.items():
        if isinstance(value, list):
            rows = ",\n".join("    " + json.dumps(row) for row in value)
            lines.append(f'  "{key}": [\n{rows}\n  ]')
        else:
            lines.append(f'  "{key}": {json.dumps(value)}')
    return "{\n" + ",\n".join(lines) + "\n}\n"
