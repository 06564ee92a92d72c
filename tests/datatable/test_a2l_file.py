"""The description for calibration programs: it nests, and says of every variable what the table says."""

import re

from ranger_sim import datatable
from ranger_sim.datatable import generate_a2l, parameters
from ranger_sim.datatable.addresses import address_of
from ranger_sim.datatable.generate import GENERATED_FOLDER
from ranger_sim.harness.xcp import slave, udp

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


def test_the_file_describes_the_slave_that_there_is():
    events = [(event.name, event.cycle) for event in slave.EVENTS]
    assert list(generate_a2l.EVENTS) == events and {event.unit_code for event in slave.EVENTS} == {5}
    assert f"{udp.MAX_CTO} {udp.MAX_DTO} BYTE_ORDER_MSB_LAST" in TEXT
    assert (
        TEXT.count("OPTIONAL_CMD") == len(slave.COMMANDS) - 4
    )  # CONNECT, DISCONNECT, GET_STATUS, SYNCH are not optional
