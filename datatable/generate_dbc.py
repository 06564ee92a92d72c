"""A DBC file per CAN bus: one message per identifier, a value signal and a time signal.

Messages of a CAN FD bus are of CAN FD, with BRS; a variable of several values has the signals value_0, value_1 ... in
front of the time.
"""

from __future__ import annotations

from collections.abc import Sequence

from ranger_sim.datatable.model import LIMITS, Table, Variable

HEADER = 'VERSION ""\n\nNS_ :\n\nBS_:\n'
TIME_SIGNAL = ' SG_ time_ms : {start}|32@1+ (1,0) [0|4294967295] "ms" {receivers}'
FRAME_FORMATS = ("StandardCAN", "ExtendedCAN", *["reserved"] * 12, "StandardCAN_FD", "ExtendedCAN_FD")
STANDARD_FD = FRAME_FORMATS.index("StandardCAN_FD")


def bound(value: float | int) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def range_of(variable: Variable) -> str:
    low, high = LIMITS[variable.type]
    if variable.type == "f32" and variable.minimum is None and variable.maximum is None:
        return "[0|0]"  # in a DBC file: no range given
    minimum = low if variable.minimum is None else variable.minimum
    maximum = high if variable.maximum is None else variable.maximum
    return f"[{bound(minimum)}|{bound(maximum)}]"


def value_signals(variable: Variable, receivers: str) -> list[str]:
    """Bytes 0-3: the value, or the three parts of an error word (robot.md N1.7)."""
    if variable.is_error_word:
        return [
            f' SG_ code : 0|16@1+ (1,0) [0|65535] "" {receivers}',
            f' SG_ board : 16|6@1+ (1,0) [0|63] "" {receivers}',
            f' SG_ count : 22|10@1+ (1,0) [0|1023] "" {receivers}',
        ]
    sign = "+" if variable.type == "u32" else "-"
    return [
        f' SG_ {name} : {32 * place}|32@1{sign} (1,0) {range_of(variable)} "{variable.unit}" {receivers}'
        for place, name in enumerate(names_of_values(variable))
    ]


def names_of_values(variable: Variable) -> list[str]:
    """The names of its signals."""
    return ["value"] if variable.count == 1 else [f"value_{place}" for place in range(variable.count)]


def fd_attributes(table: Table, bus: str, variables: Sequence[Variable]) -> list[str]:
    """Attributes of a CAN FD bus and its messages, with the names that CAN tools know."""
    formats = ",".join(f'"{each}"' for each in FRAME_FORMATS)
    lines = [
        f'BA_DEF_ BO_ "VFrameFormat" ENUM {formats};',
        'BA_DEF_ BO_ "CANFD_BRS" ENUM "0","1";',
        'BA_DEF_ "BusType" STRING ;',
        'BA_DEF_ "Baudrate" INT 0 1000000000;',
        'BA_DEF_ "BaudrateCANFD" INT 0 1000000000;',
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";',
        'BA_DEF_DEF_ "CANFD_BRS" "1";',
        'BA_DEF_DEF_ "BusType" "";',
        'BA_DEF_DEF_ "Baudrate" 0;',
        'BA_DEF_DEF_ "BaudrateCANFD" 0;',
        'BA_ "BusType" "CAN FD";',
        f'BA_ "Baudrate" {table.bit_rates[bus]};',
        f'BA_ "BaudrateCANFD" {table.data_bit_rates[bus]};',
    ]
    for variable in variables:
        lines += [f'BA_ "VFrameFormat" BO_ {variable.id} {STANDARD_FD};', f'BA_ "CANFD_BRS" BO_ {variable.id} 1;']
    return lines


def dbc_text(table: Table, bus: str) -> str:
    """The DBC file of one bus. Senders and receivers are the table's, though frames pass through the router."""
    variables = table.on_bus(bus)
    nodes = [board.name for board in table.boards if bus in board.buses or board.role == "main brain"]
    lines = [HEADER, "BU_: " + " ".join(nodes), ""]
    for variable in variables:
        receivers = ",".join(name for name in variable.subscribers if name in nodes) or "Vector__XXX"
        sender = variable.publisher if variable.publisher in nodes else "Vector__XXX"
        lines.append(f"BO_ {variable.id} {variable.name}: {variable.frame_bytes} {sender}")
        lines += value_signals(variable, receivers)
        lines += [TIME_SIGNAL.format(start=32 * variable.count, receivers=receivers), ""]
    data_rate = f" and {table.data_bit_rates[bus]}" if bus in table.data_bit_rates else ""
    lines.append(f'CM_ "{bus} of the robot at {table.bit_rates[bus]}{data_rate} bit/s; made from the master table";')
    for board in table.boards:
        if board.name in nodes:
            lines.append(f'CM_ BU_ {board.name} "{board.description}";')
    lines += [f'CM_ BO_ {variable.id} "{variable.description}";' for variable in variables]
    lines.append('BA_DEF_ BO_ "PeriodMs" FLOAT 0 1000000000;')
    lines.append('BA_DEF_DEF_ "PeriodMs" 0;')
    for variable in variables:
        if variable.period_ms is not None:
            lines.append(f'BA_ "PeriodMs" BO_ {variable.id} {float(variable.period_ms):.9g};')
    if data_rate:
        lines += fd_attributes(table, bus, variables)
    codes = " ".join(f'{error.id} "{error.name}"' for error in table.errors)
    boards = " ".join(f'{board.number} "{board.name}"' for board in table.boards)
    for variable in variables:
        if variable.is_error_word:
            lines += [f"VAL_ {variable.id} code {codes} ;", f"VAL_ {variable.id} board {boards} ;"]
    for variable in variables:
        if variable.type == "f32":
            lines += [f"SIG_VALTYPE_ {variable.id} {name} : 1;" for name in names_of_values(variable)]
    return "\n".join(lines) + "\n"
