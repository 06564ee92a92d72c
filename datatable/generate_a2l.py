"""The description for calibration programs (ASAP2 1.71): every variable with its address and transports."""

from __future__ import annotations

import dataclasses

from ranger_sim.datatable.a2ml import A2ML, COMMANDS
from ranger_sim.datatable.addresses import BASE, WORD_BYTES, XCP_MASTER_ID, XCP_SLAVE_ID, address_of
from ranger_sim.datatable.generate_dbc import bound
from ranger_sim.datatable.model import COMPUTER, LIMITS, Table, Variable

TYPES = {"f32": "FLOAT32_IEEE", "i32": "SLONG", "u32": "ULONG"}
CHANNEL_PREFIX = "LV_"  # as in parameters.py: the computer's variables that are not parameters
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
    """The name of the conversion of this unit: a variable's numbers are physical without conversion."""
    letters = "".join(each if each.isalnum() and each.isascii() else f"_{ord(each):x}_" for each in variable.unit)
    return f"UNIT_{letters}" if variable.unit else "NO_COMPU_METHOD"


def is_characteristic(variable: Variable) -> bool:
    """True for variables that the slave lets a master write."""
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


@dataclasses.dataclass(frozen=True)
class Transport:
    """Differences between the two transports: tag, packet size, packets per block, clock, additional lines."""

    tag: str
    max_cto: int
    max_dto: int
    most_packets: int
    stamp: str
    without: tuple[str, ...]
    lines: tuple[str, ...]


# harness/xcp/udp.py and can.py serve them; tests compare both
UDP = Transport(
    "XCP_ON_UDP_IP",
    248,
    1400,
    2,
    "SIZE_DWORD UNIT_1US",
    ("TRANSPORT_LAYER_CMD",),
    (f'0x0100 {UDP_PORT} ADDRESS "127.0.0.1"',),
)
# Bit timing as on the robot: 3 Mbit/s, ten quanta, sample point 70 %, SJW two of them (robot.md N1.2).
CAN = Transport(
    "XCP_ON_CAN",
    8,
    8,
    43,
    "SIZE_WORD UNIT_10US",
    ("SHORT_DOWNLOAD", "WRITE_DAQ_MULTIPLE"),
    (
        "0x0100",
        f"CAN_ID_BROADCAST 0x{XCP_MASTER_ID:X}",
        f"CAN_ID_MASTER 0x{XCP_MASTER_ID:X}",
        f"CAN_ID_SLAVE 0x{XCP_SLAVE_ID:X}",
        "BAUDRATE 3000000",
        "SAMPLE_POINT 70",
        "SAMPLE_RATE SINGLE",
        "BTL_CYCLES 10",
        "SJW 2",
    ),
)


def common_lines(transport: Transport) -> list[str]:
    """The protocol layer and measurement lists over one transport."""
    commands = [each for each in COMMANDS if each not in transport.without]
    lines = [
        "/begin PROTOCOL_LAYER",
        f"  0x0101 2000 2000 0 0 0 0 0 {transport.max_cto} {transport.max_dto} BYTE_ORDER_MSB_LAST "
        "ADDRESS_GRANULARITY_BYTE",
        *(f"  OPTIONAL_CMD {each}" for each in commands),
        f"  COMMUNICATION_MODE_SUPPORTED BLOCK MASTER {transport.most_packets} 0",
        "/end PROTOCOL_LAYER",
        "/begin DAQ",
        f"  DYNAMIC 0x20 0x{len(EVENTS):X} 0x0 OPTIMISATION_TYPE_DEFAULT ADDRESS_EXTENSION_FREE",
        "  IDENTIFICATION_FIELD_TYPE_ABSOLUTE GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE 0x4 NO_OVERLOAD_INDICATION",
        "  PRESCALER_SUPPORTED",
        f"  /begin TIMESTAMP_SUPPORTED 0x1 {transport.stamp} /end TIMESTAMP_SUPPORTED",
    ]
    for number, (name, cycle) in enumerate(EVENTS):
        lines += [
            f'  /begin EVENT "{name}" "{name[:8]}" 0x{number:X} DAQ 0x20 {cycle} 5 0 CONSISTENCY EVENT /end EVENT'
        ]
    return [*lines, "/end DAQ"]


def transport_lines() -> list[str]:
    """IF_DATA XCP: the protocol on CAN, the transports to the slave, and the differences of UDP from CAN."""
    lines = ["/begin IF_DATA XCP", *(f"  {each}" for each in common_lines(CAN))]
    for transport, more in ((CAN, []), (UDP, common_lines(UDP))):
        inner = [*transport.lines, *more]
        lines += [f"  /begin {transport.tag}", *(f"    {each}" for each in inner), f"  /end {transport.tag}"]
    return [f"    {each}" for each in [*lines, "/end IF_DATA"]]


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
        *(f"    {each}" for each in A2ML.splitlines()),
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
