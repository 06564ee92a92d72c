"""The description for calibration programs: it nests, and says of every variable what the table says."""

import importlib.util
import json
import pathlib
import re
import subprocess
import sys

import pytest

from ranger_sim import datatable
from ranger_sim.datatable import addresses, generate_a2l, parameters
from ranger_sim.datatable.a2ml import COMMANDS
from ranger_sim.datatable.addresses import address_of
from ranger_sim.datatable.generate import GENERATED_FOLDER
from ranger_sim.harness.xcp import can, slave, udp
from ranger_sim.ranger.assembly import BUS_BIT_RATE
from tests.datatable.a2ml_reader import Grammar

TEXT = (GENERATED_FOLDER / "ranger.a2l").read_text(encoding="utf-8")
TOKENS = re.findall(r'"(?:[^"\\]|\\.)*"|[^\s"]+', TEXT)


def blocks(kind):
    """The tokens of every block of a kind, by its name."""
    found = {}
    for place, token in enumerate(TOKENS):
        if token == "/begin" and TOKENS[place + 1] == kind:
            end = next(at for at in range(place, len(TOKENS)) if TOKENS[at : at + 2] == ["/end", kind])
            assert TOKENS[place + 2] not in found
            found[TOKENS[place + 2]] = TOKENS[place + 3 : end]
    return found


def test_every_block_ends_under_its_own_name():
    opened = []
    for place, token in enumerate(TOKENS):
        if token == "/begin":
            opened.append(TOKENS[place + 1])
        elif token == "/end":
            assert opened.pop() == TOKENS[place + 1]
    assert opened == []


def test_parameters_are_characteristics_and_the_rest_is_measured():
    names = {row.name for row in parameters.parameters() if not row.is_spare}
    assert set(blocks("CHARACTERISTIC")) == names
    rest = {row.name for row in datatable.load().variables if not row.is_spare} - names
    assert set(blocks("MEASUREMENT")) == rest


def test_each_has_the_address_type_and_unit_of_its_row():
    measured, changed, methods = blocks("MEASUREMENT"), blocks("CHARACTERISTIC"), blocks("COMPU_METHOD")
    layouts = blocks("RECORD_LAYOUT")
    for row in parameters.rows().values():
        if row.name in measured:
            tokens = measured[row.name]
            kind, method, address = tokens[1], tokens[2], tokens[tokens.index("ECU_ADDRESS") + 1]
        elif row.name in changed:
            _, what, address, layout, _, method, *_ = changed[row.name]
            assert what == "VALUE"
            kind = layouts[layout][2]
        else:
            continue
        assert int(address, 16) == address_of(row.id)
        assert kind == {"f32": "FLOAT32_IEEE", "i32": "SLONG", "u32": "ULONG"}[row.type]
        assert (methods[method][3] == f'"{row.unit}"') if row.unit else method == "NO_COMPU_METHOD"


def if_data():
    """The tokens of every IF_DATA."""
    for place, token in enumerate(TOKENS):
        if token == "/begin" and TOKENS[place + 1] == "IF_DATA":
            end = next(at for at in range(place, len(TOKENS)) if TOKENS[at : at + 2] == ["/end", "IF_DATA"])
            yield TOKENS[place + 2 : end]


def test_every_if_data_is_what_the_grammar_in_the_file_allows():
    grammar = Grammar(TEXT.split("/begin A2ML")[1].split("/end A2ML")[0])
    found = list(if_data())
    assert len(found) == 1 + len(blocks("MEASUREMENT"))
    for tokens in found:
        grammar.check("IF_DATA", tokens)
    for wrong in (
        [each if each != "DYNAMIC" else "DYNAMICAL" for each in found[0]],
        [each if each != "BAUDRATE" else "BITRATE" for each in found[0]],
        [each if each != "0x20" else "0x10000" for each in found[0]],
        [*found[0], "XCP"],
    ):
        with pytest.raises(AssertionError):
            grammar.check("IF_DATA", wrong)


def test_the_file_describes_the_slave_that_there_is():
    events = [(event.name, event.cycle) for event in slave.EVENTS]
    assert list(generate_a2l.EVENTS) == events and {event.unit_code for event in slave.EVENTS} == {5}
    protocol, _, on_udp = TEXT.split("/begin PROTOCOL_LAYER")[1:][0], *TEXT.split("/begin XCP_ON_UDP_IP")
    on_can = TEXT.split("/begin XCP_ON_CAN")[1].split("/end XCP_ON_CAN")[0]
    obligatory = {0xFF, 0xFE, 0xFD, 0xFC}  # CONNECT, DISCONNECT, GET_STATUS, SYNCH
    of_transport = {can.TRANSPORT_LAYER_CMD}
    for text, cto, dto, clock, codes in (
        (protocol, can.MAX_DLC, can.MAX_DLC, slave.SHORT, of_transport - set(slave.SHORTEST_CTO)),
        (on_udp, udp.MAX_CTO, udp.MAX_DTO, slave.FINE, set()),
    ):
        assert re.search(r"\n\s+0x0101 (?:\d+ ){7}(\d+) (\d+) ", text).groups() == (str(cto), str(dto))
        named = {COMMANDS[each] for each in re.findall(r"OPTIONAL_CMD (\w+)", text.split("/end PROTOCOL_LAYER")[0])}
        short = {code for code, least in slave.SHORTEST_CTO.items() if cto < least}
        assert named == (set(slave.COMMANDS) | codes) - obligatory - short
        assert f"MASTER {slave.most_packets(cto)} 0" in text.split("/end PROTOCOL_LAYER")[0]
        size, unit = re.search(r"TIMESTAMP_SUPPORTED 0x1 SIZE_(\w+) UNIT_(\w+)", text).groups()
        assert (clock.size, clock.unit_ns) == ({"WORD": 2, "DWORD": 4}[size], {"10US": 10_000, "1US": 1_000}[unit])
    numbers = dict(zip(on_can.split()[1::2], on_can.split()[2::2], strict=False))
    assert int(numbers["CAN_ID_MASTER"], 16) == addresses.XCP_MASTER_ID
    assert int(numbers["CAN_ID_SLAVE"], 16) == addresses.XCP_SLAVE_ID
    assert int(numbers["BAUDRATE"]) == BUS_BIT_RATE


def test_another_programs_parser_reads_the_file_and_finds_every_object():
    if importlib.util.find_spec("pya2l") is None:
        pytest.skip("pya2l is not installed")
    reader = pathlib.Path(__file__).with_name("pya2l_reader.py")
    done = subprocess.run(
        [sys.executable, reader, GENERATED_FOLDER / "ranger.a2l"], capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout.partition("FOUND ")[2])
    # it takes each block of IF_DATA for its second one; nothing else is complained of
    assert all(" may be used at most once here" in each for each in found["warnings"])
    ids = {name: address_of(row.id) for name, row in parameters.rows().items()}
    assert found["measurements"] == {name: ids[name] for name in blocks("MEASUREMENT")}
    assert found["characteristics"] == {name: ids[name] for name in blocks("CHARACTERISTIC")}
    assert found["structs"] == 4 and found["refused"]  # Protocol_Layer, Daq, Can, Udp
