"""The description for calibration programs (ASAP2 1.71): every variable with its address, and the way to it."""

from __future__ import annotations

from ranger_sim.datatable.addresses import BASE, WORD_BYTES, address_of
from ranger_sim.datatable.generate_dbc import bound
from ranger_sim.datatable.model import COMPUTER, LIMITS, Table, Variable

TYPES = {"f32": "FLOAT32_IEEE", "i32": "SLONG", "u32": "ULONG"}
CHANNEL_PREFIX = "LV_"  # as in parameters.py: the computer's variables that are no parameters
UDP_PORT = 5555  # the port that XCP programs propose
EVENT_OF_US = {500: 0, 1000: 1, 2000: 2}  # event of a board's slots, by their length
EVENTS = (("slot_0_5ms", 5), ("slot_1ms", 10), ("slot_2ms", 20))  # cycles of 100 us; harness/xcp/slave.py serves them
FASTEST_US = 500


def text_of(text: str) -> str:
    """A string of ASAP2."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def limits_of(variable: Variable) -> str:
    """Lower and upper limit, as the parameter check has them."""
    low, high = LIMITS[variable.type]
    low = low if variable.minimum is None else variable.minimum
    high = high if variable.maximum is None else variable.maximum
    return f"{bound(low)} {bound(high)}"


def method_of(variable: Variable) -> str:
    """The name of the conversion of this unit: a variable's numbers are physical as they stand."""
    letters = "".join(each if each.isalnum() and each.isascii() else f"_{ord(each):x}_" for each in variable.unit)
    return f"UNIT_{letters}" if variable.unit else "NO_COMPU_METHOD"


def is_characteristic(variable: Variable) -> bool:
    """True for what the slave lets a master write."""
    return variable.publisher == COMPUTER and not variable.name.startswith(CHANNEL_PREFIX)


def object_lines(table: Table, variable: Variable) -> list[str]:
    """A MEASUREMENT, or for a parameter a CHARACTERISTIC."""
    what, address = text_of(variable.description), f"0x{address_of(variable.id):X}"
    if is_characteristic(variable):
        return [
            f"    /begin CHARACTERISTIC {variable.name} {what}",
            f"      VALUE {address} WORD_{variable.type} 0 {method_of(variable)} {limits_of(variable)}",
            "    /end CHARACTERISTIC",
        ]
    slot_us = next((board.slot_us for board in table.boards if board.name == variable.publisher), 0)
    event = EVENT_OF_US.get(slot_us, EVENT_OF_US[FASTEST_US])
    return [
        f"    /begin MEASUREMENT {variable.name} {what}",
        f"      {TYPES[variable.type]} {method_of(variable)} 0 0 {limits_of(variable)}",
        f"      ECU_ADDRESS {address}",
        "      /begin IF_DATA XCP",
        "        /begin DAQ_EVENT VARIABLE",
        f"          /begin DEFAULT_EVENT_LIST EVENT 0x{event:X} /end DEFAULT_EVENT_LIST",
        "        /end DAQ_EVENT",
        "      /end IF_DATA",
        "    /end MEASUREMENT",
    ]


def transport_lines() -> list[str]:
    """IF_DATA XCP: the protocol layer, measurement lists, and XCP on UDP."""
    commands = (
        "GET_COMM_MODE_INFO GET_ID SET_MTA UPLOAD SHORT_UPLOAD BUILD_CHECKSUM DOWNLOAD SHORT_DOWNLOAD SET_DAQ_PTR "
        "WRITE_DAQ SET_DAQ_LIST_MODE GET_DAQ_LIST_MODE START_STOP_DAQ_LIST START_STOP_SYNCH GET_DAQ_CLOCK "
        "GET_DAQ_PROCESSOR_INFO GET_DAQ_RESOLUTION_INFO GET_DAQ_EVENT_INFO FREE_DAQ ALLOC_DAQ ALLOC_ODT ALLOC_ODT_ENTRY"
    )
    lines = [
        "    /begin IF_DATA XCP",
        "      /begin PROTOCOL_LAYER",
        "        0x0101 2000 2000 0 0 0 0 0 248 1400 BYTE_ORDER_MSB_LAST ADDRESS_GRANULARITY_BYTE",
        *(f"        OPTIONAL_CMD {each}" for each in commands.split()),
        "      /end PROTOCOL_LAYER",
        "      /begin DAQ",
        f"        DYNAMIC 0x20 0x{len(EVENTS):X} 0x0 OPTIMISATION_TYPE_DEFAULT ADDRESS_EXTENSION_FREE",
        "        IDENTIFICATION_FIELD_TYPE_ABSOLUTE GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE 0x4 NO_OVERLOAD_INDICATION",
        "        PRESCALER_SUPPORTED",
        "        /begin TIMESTAMP_SUPPORTED 0x1 SIZE_DWORD UNIT_1US /end TIMESTAMP_SUPPORTED",
    ]
    for number, (name, cycle) in enumerate(EVENTS):
        lines += [
            f'        /begin EVENT "{name}" "{name[:8]}" 0x{number:X} DAQ 0x20 {cycle} 5 0 CONSISTENCY DAQ /end EVENT'
        ]
    return [
        *lines,
        "      /end DAQ",
        f'      /begin XCP_ON_UDP_IP 0x0101 {UDP_PORT} ADDRESS "127.0.0.1" /end XCP_ON_UDP_IP',
        "    /end IF_DATA",
    ]


def a2l_text(table: Table) -> str:
    """The whole file."""
    shown = [variable for variable in table.variables if not variable.is_spare]
    size = WORD_BYTES * (max(variable.id for variable in table.variables) + 1)
    methods = dict(sorted((method_of(each), each.unit) for each in shown if each.unit))
    lines = [
        "ASAP2_VERSION 1 71",
        '/begin PROJECT ranger_sim "Cornell Ranger, emulated"',
        f'  /begin HEADER "made from the master table {table.hash[:16]}" /end HEADER',
        '  /begin MODULE main_brain "data table of the main brain"',
        '    /begin MOD_COMMON ""',
        "      BYTE_ORDER MSB_LAST",
        "      ALIGNMENT_LONG 4",
        "      ALIGNMENT_FLOAT32_IEEE 4",
        "    /end MOD_COMMON",
        '    /begin MOD_PAR ""',
        f'      /begin MEMORY_SEGMENT TABLE "one word a variable" DATA RAM INTERN 0x{BASE:X} 0x{size:X} -1 -1 -1 -1 -1',
        "      /end MEMORY_SEGMENT",
        "    /end MOD_PAR",
        *transport_lines(),
    ]
    for method, unit in methods.items():
        lines.append(f'    /begin COMPU_METHOD {method} "" IDENTICAL "%8.6" {text_of(unit)} /end COMPU_METHOD')
    for kind, name in TYPES.items():
        lines.append(f"    /begin RECORD_LAYOUT WORD_{kind} FNC_VALUES 1 {name} ROW_DIR DIRECT /end RECORD_LAYOUT")
    for variable in shown:
        lines += object_lines(table, variable)
    for board in table.boards:
        names = [each.name for each in shown if each.publisher == board.name]
        measured = [each for each in names if not is_characteristic(table.variable(each))]
        changed = [each for each in names if is_characteristic(table.variable(each))]
        if not names:
            continue
        lines.append(f"    /begin GROUP {board.name} {text_of(board.description)} ROOT")
        if measured:
            lines.append(f"      /begin REF_MEASUREMENT {' '.join(measured)} /end REF_MEASUREMENT")
        if changed:
            lines.append(f"      /begin REF_CHARACTERISTIC {' '.join(changed)} /end REF_CHARACTERISTIC")
        lines.append("    /end GROUP")
    return "\n".join([*lines, "  /end MODULE", "/end PROJECT"]) + "\n"
