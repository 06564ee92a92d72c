"""The names of Ranger's variables, boards and errors, from the code generated from its master table."""

from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.harness.names import Names

RANGER = Names(
    variables=all_variables.NAMES,
    types=all_variables.TYPES,
    boards=all_variables.BOARD_NAMES,
    errors=error_table.NAMES,
    descriptions=error_table.DESCRIPTIONS,
    normal_per_s=error_table.NORMAL_PER_S,
    normal_at_start=error_table.NORMAL_AT_START,
    hash=all_variables.TABLE_HASH,
)
