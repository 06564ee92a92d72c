"""Profiles: every fault named at once, with file, key, value and rule; what passes is complete."""

import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ranger_sim import datatable
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import profile
from ranger_sim.ranger import wiring
from tests.examples import examples

INTERFACES = ("ranger_sim", "slcan", "socketcan", "virtual")
ON_CAN0 = '[buses.can1]\ninterface = "socketcan"\nchannel = "can0"\nbit_rate = 1000000\n'


def written(folder, text, name="mine.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def load(path):
    return profile.load(path, interfaces=lambda: INTERFACES)


def faults_of(folder, text):
    with pytest.raises(profile.FaultyProfileError) as caught:
        load(written(folder, text))
    return caught.value.faults


def one_fault(folder, text):
    (fault,) = faults_of(folder, text)
    return fault.key, fault.value, fault.rule


# ---- what passes


def test_the_default_is_the_robot_as_it_is():
    found = profile.default()
    assert found.emulated() == wiring.BOARDS and found.external() == found.absent() == ()
    assert {bus.bit_rate for bus in found.buses.values()} == {3_000_000}
    assert all(bus.python_can() is None and bus.schedule_name == "full" for bus in found.buses.values())


def test_an_empty_file_is_the_default(tmp_path):
    found = load(written(tmp_path, ""))
    assert found.boards == profile.default().boards and found.buses == profile.default().buses


@pytest.mark.parametrize("name", profile.available())
def test_every_shipped_profile_passes(name):
    found = profile.load(name)
    assert found.title and found.description and set(found.buses) == set(profile.BUSES)


def test_the_profile_for_real_adapters_stays_within_what_they_can(tmp_path):
    found = profile.load("hil-1mbit")
    assert {bus.bit_rate for bus in found.buses.values()} == {1_000_000}
    assert found.buses["can3"].python_can() == {"interface": "socketcan", "channel": "can2"}


def test_what_is_given_is_taken(tmp_path):
    text = (
        'title = "bench"\n[boards]\nMCH = "external"\nMCSI = "absent"\n' + ON_CAN0 + 'schedule = "1mbit"\n'
        "[buses.can1.options]\nreceive_own_messages = false\n"
        '[buses.can2]\ninterface = "slcan"\nchannel = "/dev/ttyACM0"\nbit_rate = 500000\n'
    )
    found = load(written(tmp_path, text))
    assert (found.title, found.external(), found.absent()) == ("bench", ("MCH",), ("MCSI",))
    assert found.buses["can1"].python_can() == {
        "interface": "socketcan",
        "channel": "can0",
        "receive_own_messages": False,
    }
    assert found.buses["can2"].python_can()["bitrate"] == 500_000  # the adapter is set by python-can
    assert found.buses["can1"].schedule.turns("MCH_ANGLE") == 2


def test_a_schedule_next_to_the_profile_goes_before_a_shipped_one(tmp_path):
    (tmp_path / "schedules").mkdir()
    written(tmp_path / "schedules", "[every]\nMCH_ANGLE = 7\n", "1mbit.toml")
    found = load(written(tmp_path, '[buses.can1]\nschedule = "1mbit"\n'))
    assert found.buses["can1"].schedule.every == {"MCH_ANGLE": 7}


def test_vcan_has_no_bit_rate_to_keep_to(tmp_path):
    text = '[buses.can1]\ninterface = "socketcan"\nchannel = "vcan0"\n'
    assert load(written(tmp_path, text)).buses["can1"].bit_rate == 3_000_000


# ---- what does not


def test_an_external_main_brain_alone_is_refused_with_the_reason(tmp_path):
    key, value, rule = one_fault(tmp_path, '[boards]\nMB = "external"\n')
    assert (key, value) == ("boards.MB", "'external'")
    assert "has no CAN" in rule and "router" in rule


def test_an_external_router_with_the_main_brain_is_allowed_and_alone_is_not(tmp_path):
    buses = "".join(
        f'[buses.can{n}]\ninterface = "socketcan"\nchannel = "can{n}"\nbit_rate = 1000000\n' for n in (1, 2, 3, 4)
    )
    found = load(written(tmp_path, '[boards]\nMB = "external"\nCSR = "external"\n' + buses))
    assert found.external() == ("CSR", "MB")
    key, _, rule = one_fault(tmp_path, '[boards]\nCSR = "external"\n' + buses)
    assert key == "boards.CSR" and "has no CAN" in rule


@pytest.mark.parametrize(
    ("text", "key", "value", "words"),
    [
        ('[boards]\nMCH = "real"\n', "boards.MCH", "'real'", "emulated, external, absent"),
        ('[boards]\nMCX = "absent"\n', "boards.MCX", "'absent'", "the boards are MCH"),
        ('[boards]\nCSR = "absent"\n', "boards.CSR", "'absent'", "reaches no board"),
        ('[boards]\nMCH = "external"\n', "boards.MCH", "'external'", "can1, which is emulated"),
        ("[boards]\nMCH = 3\n", "boards.MCH", "3", "expected"),
        ('boards = "all"\n', "boards", "'all'", "table"),
        ("[buses.can5]\n", "buses.can5", "{}", "can1, can2, can3, can4"),
        ("[buses]\ncan1 = 4\n", "buses.can1", "4", "table"),
        ("[buses.can1]\nbit_rate = 1e6\n", "buses.can1.bit_rate", "1000000.0", "whole number"),
        ("[buses.can1]\nbit_rate = 10\n", "buses.can1.bit_rate", "10", "10000 to 8000000 bit/s"),
        ("[buses.can1]\nbit_rate = true\n", "buses.can1.bit_rate", "True", "whole number"),
        ('[buses.can1]\nschedule = "slow"\n', "buses.can1.schedule", "'slow'", "1mbit, full"),
        ('[buses.can1]\nschedule = "../../x"\n', "buses.can1.schedule", "'../../x'", "no such schedule"),
        ('[buses.can1]\nchannel = "can0"\n', "buses.can1.channel", "'can0'", "needs `interface`"),
        ('[buses.can1]\ninterface = "socketcan"\nbit_rate = 500000\n', "buses.can1.channel", "None", "missing"),
        (
            ON_CAN0.replace("socketcan", "sockets"),
            "buses.can1.interface",
            "'sockets'",
            "python-can; it knows ranger_sim",
        ),
        (ON_CAN0.replace("1000000", "3000000"), "buses.can1.bit_rate", "3000000", "at most 1000000"),
        (ON_CAN0.replace("bit_rate = 1000000\n", ""), "buses.can1.bit_rate", "", "is missing, so 3000000"),
        (ON_CAN0 + "[buses.can1.options]\nbitrate = 1\n", "buses.can1.options.bitrate", "1", "own keys"),
        (ON_CAN0 + ON_CAN0.replace("can1", "can2"), "buses.can2.channel", "'can0'", "what can1 uses"),
        ("[bus.can1]\n", "bus", "{'can1': {}}", "allowed are title, description, boards, buses"),
        ("title = 3\n", "title", "3", "text"),
        ('title = "a\\nb"\n', "title", "'a\\nb'", "one line"),
    ],
)
def test_a_fault_is_named_with_key_value_and_rule(tmp_path, text, key, value, words):
    found_key, found_value, rule = one_fault(tmp_path, text)
    assert (found_key, found_value if value != "None" else "None") == (key, value)
    assert words in rule


def test_all_faults_are_named_at_once_with_the_file(tmp_path):
    text = '[boards]\nMB = "external"\nMCX = "x"\n[buses.can1]\nbit_rate = 1\nschedule = "slow"\n[buses.can9]\n'
    with pytest.raises(profile.FaultyProfileError) as caught:
        load(written(tmp_path, text))
    lines = str(caught.value).splitlines()
    assert len(lines) == len(caught.value.faults) == 5
    assert all(line.startswith(str(tmp_path / "mine.toml")) for line in lines)


@pytest.mark.parametrize(
    ("schedule", "key", "words"),
    [
        ("[every]\nMCH_ANGEL = 2\n", "every.MCH_ANGEL", "no row"),
        ("[every]\nMCH_STATUS = 2\n", "every.MCH_STATUS", "[occasional] MCH"),
        ("[every]\nTIMESTAMP = 2\n", "every.TIMESTAMP", "no row"),
        ("[every]\nMCH_ANGLE = 0\n", "every.MCH_ANGLE", "from 1 to 1000"),
        ("[every]\nMCH_ANGLE = 2.0\n", "every.MCH_ANGLE", "whole number"),
        ("[occasional]\nMB = 2\n", "occasional.MB", "no board"),
        ("[occasional]\nMCH = -1\n", "occasional.MCH", "from 1"),
        ("commands_in_turn = true\n", "commands_in_turn", "whole number"),
        ("each = 3\n", "each", "unknown key"),
        ("[every]\nMCH_ANGLE = 997\nMCH_ANG_RATE = 991\n", "every", "common multiple"),
        ("this is no toml", "", "not valid TOML"),
    ],
)
def test_a_fault_in_a_schedule_is_named_with_its_own_file(tmp_path, schedule, key, words):
    (tmp_path / "schedules").mkdir()
    written(tmp_path / "schedules", schedule, "odd.toml")
    (fault,) = faults_of(tmp_path, '[buses.can1]\nschedule = "odd"\n[buses.can4]\nschedule = "odd"\n')
    assert fault.file == str(tmp_path / "schedules" / "odd.toml")
    assert fault.key == key and words in fault.rule


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nobody", "hil-1mbit"),
        ("no-such.toml", "No such file"),
        ("/.toml", "No such file"),
        ("\0.toml", "not the name of a file"),
    ],
)
def test_a_profile_that_is_not_there_gets_one_line(name, words):
    with pytest.raises(UserError, match=re.escape(words)) as caught:
        profile.load(name)
    assert len(str(caught.value).splitlines()) == 1


# ---- whatever a file holds

VALUES = st.recursive(
    st.one_of(
        st.integers(),
        st.floats(),
        st.booleans(),
        st.text(max_size=8),
        st.sampled_from(["external", "absent", "socketcan", "can0", "1mbit", 1_000_000]),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)
KEYS = st.sampled_from(
    [
        "boards",
        "buses",
        "title",
        "can1",
        "can4",
        "MCH",
        "CSR",
        "MB",
        "interface",
        "channel",
        "bit_rate",
        "schedule",
        "options",
    ]
)


def toml_of(value):
    """A value as TOML writes it inline."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return "nan" if value != value else repr(value).replace("inf", "inf")
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(c):08X}" if not 0xD800 <= ord(c) < 0xE000 else "?" for c in value) + '"'
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_of, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_of(k)} = {toml_of(v)}" for k, v in value.items()) + "}"
    return repr(value)


def loads_or_complains(folder, data):
    path = folder / "any.toml"
    path.write_bytes(data)
    try:
        found = load(path)
    except UserError as error:
        assert str(error) and all(line.isprintable() for line in str(error).splitlines())
        return
    assert set(found.boards) == set(wiring.BOARDS) and set(found.buses) == set(profile.BUSES)
    for bus in found.buses.values():
        bus.python_can()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("profiles")


@settings(max_examples=examples(150))
@given(
    st.dictionaries(
        KEYS, st.dictionaries(KEYS, st.dictionaries(KEYS, VALUES, max_size=4) | VALUES, max_size=4) | VALUES
    )
)
def test_no_table_of_values_makes_a_traceback(folder, content):
    text = "\n".join(f"{toml_of(key)} = {toml_of(value)}" for key, value in content.items())
    loads_or_complains(folder, text.encode())


@settings(max_examples=examples(150))
@given(st.binary(max_size=60), st.integers(0, 400), st.integers(0, 30))
@example(b"\xff", 10, 0)
@example(b"[" * 60, 0, 0)
def test_no_damage_to_a_good_file_makes_a_traceback(folder, junk, at, cut):
    good = (profile.FOLDER / "hil-1mbit.toml").read_bytes()
    loads_or_complains(folder, good[:at] + junk + good[at + cut :])


def test_a_file_nested_too_deeply_is_refused(folder):
    loads_or_complains(folder, b"a = " + b"[" * 100_000)


def test_the_default_profile_has_the_tables_bit_rate():
    assert datatable.load().bit_rates["CAN1"] == profile.default().buses["can1"].bit_rate
