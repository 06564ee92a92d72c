"""The robot-wide master table: variables, errors and boards; loaded, checked, and turned into code.

Master files: `datatable/master/`. Generated and checked in: `datatable/generated/`. The emulated firmware
imports only generated modules (``from datatable.generated import mch as table``), which read no file.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ranger_sim.datatable.model import Table
    from ranger_sim.datatable.schedule import PublishedSchedule
    from ranger_sim.datatable.store import DataStore


def load(folder: str | None = None) -> "Table":
    """The checked master table. `folder`: where the master files are (ours by default).

    Raises TableError that names every fault at once.
    """
    from ranger_sim.datatable.loader import load_table

    return load_table(folder)


def table_hash(folder: str | None = None) -> str:
    """SHA-256 over the master files, 64 hexadecimal digits; the same with either line ending."""
    from ranger_sim.datatable.loader import hash_of_master_files

    return hash_of_master_files(folder)


def place_of_generated(ours: list[str]) -> list[str]:
    """Where the generated modules are: the folder of the user's own table (RANGER_SIM_TABLE), or else `ours`.

    UserError when nothing was generated for the user's own table.
    """
    from ranger_sim.foundation.user_error import TableError
    from ranger_sim.loading import OWN_TABLE

    if OWN_TABLE is None:
        return ours
    if not (OWN_TABLE / "generated" / "__init__.py").is_file():
        raise TableError(
            f"RANGER_SIM_TABLE: nothing was generated in {OWN_TABLE}: unset RANGER_SIM_TABLE, then "
            f"ranger-sim table generate --master {OWN_TABLE}"
        )
    return [str(OWN_TABLE / "generated")]


def check_own_table() -> None:
    """Raise UserError when code was generated from a different state of the user's own table (RANGER_SIM_TABLE)."""
    from ranger_sim.foundation.user_error import TableError
    from ranger_sim.loading import OWN_TABLE

    if OWN_TABLE is None:
        return
    from ranger_sim.datatable.generated import all_variables

    if all_variables.TABLE_HASH != table_hash(str(OWN_TABLE)):
        raise TableError(
            f"{OWN_TABLE}: changed since its code was made: ranger-sim table generate --master {OWN_TABLE}"
        )


def published_schedule(board: str) -> "PublishedSchedule":
    """Variables that the schedule of `board` sends, row by row, from boards.toml."""
    from ranger_sim.datatable.schedule import published_schedule as lookup

    return lookup(board)


def main_brain_store() -> "DataStore":
    """The main brain's data store at power-up: every variable at its initial value, unread by every subscriber.

    ROBOT PARITY: the robot's store ends at id 313; ours continues with the ids of the 2011 controller.
    """
    from ranger_sim.datatable.generated import all_variables
    from ranger_sim.datatable.packing import word_of_value
    from ranger_sim.datatable.store import DataStore

    store = DataStore(all_variables.TABLE_SIZE)
    for number, kind in all_variables.TYPES.items():
        store.set_word(number, word_of_value(kind, all_variables.INITIAL[number]), 0)
    return store
