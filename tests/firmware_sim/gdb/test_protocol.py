"""The remote serial protocol by known answers, spoken by a client that shares no code with the stub."""

import contextlib
import re
import socket
import xml.etree.ElementTree

import pytest

from ranger_sim.firmware_sim.arm7.core import BusFault
from ranger_sim.firmware_sim.gdb.server import GdbServer
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.gdb.client import Client, session
from tests.firmware_sim.gdb.machine import Machine

RAM, DEVICE = 0x40000000, 0xE0000000
PC, CPSR = 15, 16
END = 30_000

# The program: r0 and r5 are addresses, r4 counts, the sample of the device is stored; IRQ counts in r8 of its handler.
#
#   0x00 b 0x40        0x40 msr cpsr_c, #0x1F     0x54 add r4, r4, #1
#   0x18 b 0x80        0x44 mov r0, #0x40000000   0x58 str r4, [r0]
#                      0x48 mov r5, #0xE0000000   0x5C ldr r2, [r5]
#                      0x4C mov r4, #0            0x60 strh r2, [r0, #6]
#                      0x50 nop                   0x64 b 0x54
#   0x80 add r8, r8, #1 ; str r8, [r0, #16] ; mov r9, #0 ; str r9, [r5, #4] ; subs pc, lr, #4
LOOP, AFTER_STORE, HANDLER = 0x54, 0x5C, 0x80
PROGRAM = {
    0x00: (0xEA00000E,),
    0x18: (0xEA000018,),
    0x40: (0xE321F01F, 0xE3A00101, 0xE3A0520E, 0xE3A04000, 0xE1A00000),
    LOOP: (0xE2844001, 0xE5804000, 0xE5952000, 0xE1C020B6, 0xEAFFFFFA),
    HANDLER: (0xE2888001, 0xE5808010, 0xE3A09000, 0xE5859004, 0xE25EF004),
}


def tiny():
    machine = Machine()
    for address, operations in PROGRAM.items():
        machine.core.place(address, b"".join(op.to_bytes(4, "little") for op in operations))
    return machine


@pytest.fixture
def alone():
    """The machine's state at the end without a debugger."""
    machine = tiny()
    machine.run(END)
    assert machine.core.peek(RAM + 16) > 10  # interrupts came
    return machine.digest()


def test_a_debugger_that_only_looks_changes_nothing(alone):
    def talk(client):
        assert client.ask("?") == "T05thread:1;"
        for request in ("qSupported:swbreak+", "g", "m0,100", "m40000000,40", "me0000000,8", "p10"):
            assert client.ask(request)[:1] not in ("", "E")
        assert client.ask(f"Z1,{LOOP:x},4") == "OK"
        for _ in range(5):
            assert client.ask("vCont;c") == "T05thread:1;"
            assert client.register(PC) == LOOP
            for _ in range(7):
                assert client.ask("vCont;s:1") == "T05thread:1;"
        assert client.ask(f"z1,{LOOP:x},4") == "OK"
        assert client.ask("Z2,40000010,4") == "OK"
        assert client.ask("c") == "T05thread:1;watch:40000010;"
        assert client.ask("D") == "OK"

    machine = tiny()
    _, server = session(machine, END, talk)
    assert machine.digest() == alone
    assert server.halts == 5 * 8 + 1


def test_registers_are_read_and_written_by_number_and_all_at_once():
    def talk(client):
        description = xml.etree.ElementTree.fromstring(transferred(client, "features:read:target.xml"))
        assert description.findtext("architecture") == "arm"
        features = description.findall("feature")
        assert features[0].get("name") == "org.gnu.gdb.arm.core"
        names = [each.get("name") for each in features[0]]
        assert names == [*(f"r{i}" for i in range(13)), "sp", "lr", "pc", "cpsr"]
        sizes = [int(each.get("bitsize")) // 8 for feature in features for each in feature]
        every = bytes.fromhex(client.ask("g"))
        assert len(every) == sum(sizes)
        assert int.from_bytes(every[64:68], "little") == 0xD3
        assert client.ask("P3=78563412") == "OK"
        assert client.register(3) == 0x12345678
        changed = bytearray(bytes.fromhex(client.ask("g")))
        changed[0:4] = b"\x01\x02\x03\x04"
        changed[13 * 4 : 14 * 4] = b"\x00\x10\x00\x40"  # the stack pointer of the mode that comes with it
        changed[64] = 0xD2
        assert client.ask("G" + changed.hex()) == "OK"
        assert (client.register(0), client.register(13), client.register(CPSR)) == (0x04030201, 0x40001000, 0xD2)
        index = [each.get("name") for feature in features for each in feature].index("sp_irq")
        assert client.register(index) == 0x40001000
        assert client.ask("P10=d3000000") == "OK"
        assert (client.register(13), client.register(index)) == (0, 0x40001000)
        assert client.ask("P10=05000000") == "E0e"  # no such mode
        assert client.ask("p99") == "E0e"
        assert client.ask("P3=12") == "E01"

    session(tiny(), 1000, talk)


def transferred(client, what):
    """The whole of a qXfer object, in small pieces."""
    text, offset = "", 0
    while True:
        answer = client.ask(f"qXfer:{what}:{offset:x},40")
        text += re.sub("}(.)", lambda found: chr(ord(found[1]) ^ 0x20), answer[1:])
        offset += 0x40
        if answer[0] == "l":
            return text


def test_the_memory_map_lists_flash_ram_and_where_devices_may_be():
    def talk(client):
        found = xml.etree.ElementTree.fromstring(transferred(client, "memory-map:read:"))
        return [(each.get("type"), int(each.get("start"), 0), int(each.get("length"), 0)) for each in found]

    regions, _ = session(tiny(), 1000, talk)
    assert regions[0] == ("flash", 0, 0x40000)
    assert ("ram", RAM, 0x4000) in regions
    assert sum(length for _, _, length in regions) == 1 << 32


def test_memory_is_read_and_written_at_any_address_and_length():
    def talk(client):
        assert client.ask("M40000101,5:0102030405") == "OK"
        assert client.ask("m40000100,8") == "0001020304050000"
        client.put(b"X40000200,4:" + b"}\x03}\x04}\x5d\x80")  # # $ } escaped, and a byte above 127
        assert client.get() == "OK"
        assert client.ask("m40000200,4") == "23247d80"
        assert client.ask("X40000200,0:") == "OK"
        assert client.ask("m60000000,4") == "E0e"
        assert client.ask("m40003ffe,4") == "E0e"
        assert client.ask("M40000101,5:01") == "E01"
        assert client.ask("m40000100") == "E01"
        assert client.ask("mzz,4") == "E01"
        assert len(client.ask("m0,ffffff")) == 2 * (0x2000 - 8)  # no more than a packet holds

    session(tiny(), 1000, talk)


def test_a_device_is_inspected_without_a_read_and_read_when_asked_for():
    machine = tiny()

    def talk(client):
        assert client.word(DEVICE) == 1
        assert client.word(DEVICE) == 1
        assert machine.core.device.reads == 0
        assert client.ask("me0000000,8") == "0100000000000000"
        assert client.monitor("read 0xe0000000") == "0xe0000000: 0x00000001\n"
        assert machine.core.device.reads == 1
        assert client.ask("me0000100,4") == "E0e"
        assert client.ask("Me0000004,4:01000000") == "OK"
        assert machine.core.lines == 1
        assert "there is no device" in client.monitor("read 0x40000000")
        assert client.ask("Me0000000,4:01000000") == "E0e"
        machine.core.lines = 0

    session(machine, 1000, talk)


@pytest.mark.parametrize("kind", [0, 1])
def test_a_breakpoint_halts_before_its_instruction_again_and_again_and_leaves_memory_as_it_is(kind):
    def talk(client):
        before = client.ask("m50,20")
        assert client.ask(f"Z{kind},{LOOP:x},4") == "OK"
        counts = []
        for _ in range(3):
            assert client.ask("c") == "T05thread:1;"
            assert client.register(PC) == LOOP
            counts.append(client.register(4))
        assert counts == [0, 1, 2]
        assert client.ask("m50,20") == before
        assert client.ask(f"z{kind},{LOOP:x},4") == "OK"
        assert client.ask(f"Z0,{HANDLER:x},4") == "OK"
        client.ask("c")
        assert client.register(PC) == HANDLER

    session(tiny(), END, talk)


@pytest.mark.parametrize(
    ("kind", "where", "name", "pc", "length"),
    [
        (2, RAM, "watch", AFTER_STORE, 4),
        (2, RAM + 7, "watch", LOOP + 16, 1),
        (3, DEVICE, "rwatch", AFTER_STORE + 4, 4),
        (4, DEVICE + 2, "awatch", AFTER_STORE + 4, 1),
        (4, RAM + 4, "awatch", LOOP + 16, 4),
    ],
)
def test_a_watchpoint_halts_after_the_access_that_meets_it(kind, where, name, pc, length):
    def talk(client):
        assert client.ask(f"Z{kind},{where:x},{length:x}") == "OK"
        reply = client.ask("c")
        assert reply.startswith(f"T05thread:1;{name}:")
        assert where <= int(reply.split(":")[-1][:8], 16) < where + length
        assert client.register(PC) == pc

    session(tiny(), END, talk)


def test_watchpoints_do_not_meet_what_they_are_not_for():
    def talk(client):
        assert client.ask("Z3,40000000,4") == "OK"  # it is only written
        assert client.ask("Z2,40000004,2") == "OK"  # its neighbour is
        assert client.ask(f"Z2,{DEVICE:x},4") == "OK"  # it is only read
        client.put("c")
        client.send(b"\x03")
        assert client.get() == "T02thread:1;"

    machine = tiny()
    _, server = session(machine, None, talk)
    assert server.halts == 1


def test_a_step_is_one_instruction_and_goes_over_the_interrupts_that_come():
    def talk(client):
        assert client.ask(f"Z1,{LOOP:x},4") == "OK"
        assert client.ask("c") == "T05thread:1;"
        assert client.ask(f"z1,{LOOP:x},4") == "OK"
        places = []
        for _ in range(500):  # some ten interrupts fall in here
            client.ask("s")
            places.append(client.register(PC))
        assert places == [LOOP + 4 * ((i + 1) % 5) for i in range(500)]
        assert client.word(RAM + 16) > 0

    session(tiny(), END, talk)


def test_ctrl_c_halts_a_board_that_runs_and_other_requests_wait_for_that():
    def talk(client):
        for _ in range(100):  # a look may hear all of this before the board has run at all
            client.put("c")
            assert client.ask("g") == "E10"  # it runs
            client.send(b"\x03")
            assert client.get() == "T02thread:1;"
            if client.register(4) > 0:
                break
        assert LOOP <= client.register(PC) <= HANDLER + 16 or client.register(PC) == 0x18
        return client.register(4)

    counted, _ = session(tiny(), None, talk)
    assert counted > 0


def test_continuing_elsewhere_and_the_processor_reset():
    def talk(client):
        assert client.ask(f"Z0,{LOOP:x},4") == "OK"
        assert client.ask("c") == "T05thread:1;"
        assert client.ask("s44") == "T05thread:1;"
        assert client.register(PC) == 0x48
        for words in ("reset", "reset halt", "reset init"):
            client.ask(f"P{PC:x}=48000000")
            assert client.monitor(words).startswith("TINY: reset, halted at 0x00000000\n")
        assert client.monitor("halt") == "TINY: halted at 0x00000000\n"
        assert (client.register(PC), client.register(CPSR)) == (0, 0xD3)
        assert re.fullmatch(r"TINY: \d+ cycles, \d+ instructions\n", client.monitor("time"))
        assert "monitor read ADDRESS" in client.monitor("help")
        client.put("qRcmd," + b"explode now".hex())
        text = client.get()
        assert text[:1] == "O" and "monitor explode now: unknown command\n" in bytes.fromhex(text[1:]).decode()
        assert client.get() == "E01"  # gdb ends a script there

    session(tiny(), END, talk)


def test_flash_is_erased_and_programmed_as_load_does_it_and_compared_by_check_sum():
    def talk(client):
        assert client.ask("vFlashErase:3000,2000") == "OK"
        assert client.ask("m3000,4") == "ffffffff"
        client.put(b"vFlashWrite:3000:123456789")
        assert client.get() == "OK"
        assert client.ask("vFlashDone") == "OK"
        # the check value of CRC-32/MPEG-2, which qCRC is, over these nine bytes
        assert client.ask("qCRC:3000,9") == "C0376e6e7"
        assert client.ask("vFlashErase:40000000,1000") == "E0e"
        assert client.ask("vFlashWrite:3fff0:" + "x" * 32) == "E0e"
        assert client.ask("qCRC:3000,ffffffffff") == "E01"

    machine = tiny()
    session(machine, 1000, talk)
    assert machine.core.peek(0x3000) == int.from_bytes(b"1234", "little")


def test_what_the_program_may_not_do_halts_it_there_with_a_line_and_ends_the_run_after_that():
    machine = tiny()
    machine.core.place(LOOP, (0xE5912000).to_bytes(4, "little"))  # ldr r2, [r1]
    machine.core.r[1] = 0x60000000

    def talk(client):
        client.put("c")
        text = client.get()
        assert text[0] == "O"
        assert "read from an address where nothing is: 0x60000000" in bytes.fromhex(text[1:]).decode()
        assert client.get() == "T0bthread:1;"
        assert client.register(PC) == LOOP
        client.ask("D")

    with pytest.raises(BusFault, match="0x60000000"):
        session(machine, END, talk)


def test_without_points_a_fault_under_a_debugger_is_reported_too():
    machine = tiny()
    machine.core.place(LOOP, (0xE5912000).to_bytes(4, "little"))
    machine.core.r[1] = 0x60000000

    def talk(client):
        client.put("c")
        return client.get()[:1], client.get()

    with pytest.raises(BusFault):
        session(machine, END, talk)


# ---- bad manners


@pytest.mark.parametrize("garbage", [b"GET / HTTP/1.1\r\n\r\n", b"\x00\x01\x02", b"$g#zz", b"#67"])
def test_a_client_of_another_protocol_is_sent_away_and_counted_and_the_run_goes_on(garbage, alone):
    machine = tiny()

    def talk(client):
        client.send(garbage)
        while client.receive():
            pass

    _, server = session(machine, END, talk)
    assert server.sent_away["malformed"] == 1
    assert machine.digest() == alone


def test_a_packet_without_an_end_is_not_kept_for_ever(alone):
    machine = tiny()

    def talk(client):
        try:
            for _ in range(64):
                client.send(b"$" + b"m" * 16384)
        except OSError:
            return
        while client.receive():
            pass

    _, server = session(machine, END, talk)
    assert server.sent_away["too_long"] == 1
    assert machine.digest() == alone


def test_a_wrong_check_sum_is_asked_for_again_and_a_minus_repeats_the_answer():
    def talk(client):
        client.put("?", check=b"00")
        assert client.receive() == b"-"
        assert client.ask("?") == "T05thread:1;"
        client.send(b"-")
        assert client.get() == "T05thread:1;"
        assert client.ask("QStartNoAckMode") == "OK"
        client.put("?")
        data = client.receive()
        assert data.startswith(b"$T05")  # no + before it

    session(tiny(), 1000, talk)


@pytest.mark.parametrize(
    "request_", ["vMustReplyEmpty", "Z9,0,4", "qSymbol::", "b", "R00", "vCtrlC", "jThreads", "z", "~"]
)
def test_what_is_not_known_is_answered_by_nothing(request_):
    answer, _ = session(tiny(), 1000, lambda client: client.ask(request_))
    assert answer == ""


@pytest.mark.parametrize(
    "request_",
    ["m", "m,", "m1", "m1,2,3", "Mx", "G12", "Z0", "Z0,x,4", "vCont;q", "qCRC:1", "qRcmd,zz",
     "qXfer:features:read:target.xml:x,1",     "P=1", "p", "vFlashErase:1", "X0,5:abc", "c1z", "m11111111111111111,1"],
)  # fmt: skip
def test_what_is_not_formed_as_it_should_is_an_error_and_nothing_more(request_):
    answer, _ = session(tiny(), 1000, lambda client: (client.ask(request_), client.ask("?")))
    assert answer == ("E01", "T05thread:1;")


@pytest.mark.parametrize("request_", ["c100000006", "s1ffffffff"])
def test_an_address_of_more_than_32_bits_is_refused_as_a_place_to_continue(request_):
    """A program counter beyond them once ended the run when the registers were asked for."""

    def talk(client):
        return client.ask("g"), client.ask(request_), client.ask("g")

    (before, answer, after), _ = session(tiny(), 1000, talk)
    assert answer == "E0e" and after == before


def test_a_debugger_that_is_cut_off_takes_its_points_along_and_the_run_goes_on(alone):
    machine = tiny()

    def talk(client):
        client.ask(f"Z1,{LOOP:x},4")
        client.ask("Z2,40000000,4")
        client.ask("c")

    session(machine, END, talk)
    assert machine.digest() == alone


def test_kill_lets_the_board_go_as_leaving_does(alone):
    machine = tiny()

    def talk(client):
        client.put("k")
        return client.receive()

    said, _ = session(machine, END, talk)
    assert said in (b"", b"+")
    assert machine.digest() == alone


def test_a_second_debugger_is_refused_and_the_first_one_keeps_the_board():
    def talk(first, second):
        assert "found no place free" in second.get()
        assert second.receive() == b""
        assert first.ask("?") == "T05thread:1;"
        return first.ask("D")

    reported, server = session(tiny(), END, talk, clients=2)
    assert reported == "OK"
    assert server.sent_away["full"] == 1


def test_one_debugger_after_the_other():
    def talk(first):
        assert first.ask(f"Z1,{LOOP:x},4") == "OK"
        assert first.ask("c") == "T05thread:1;"
        assert first.ask("D") == "OK"
        second = Client(first.port)
        assert second.ask("?") == "T05thread:1;"
        assert second.ask("s") == "T05thread:1;"
        second.close()

    _, server = session(tiny(), None, talk)
    assert server.seen == 2


def test_while_one_board_is_held_the_others_of_the_process_can_be_inspected():
    first, second = tiny(), tiny()
    other = GdbServer(second, 0)

    def talk(client):
        beside = Client(other.port)
        assert beside.ask("?") == "T05thread:1;"
        assert beside.ask("P1=2a000000") == "OK"
        client.put("c")  # both stand until both are let go
        assert beside.register(1) == 42
        assert beside.ask("D") == "OK"
        beside.close()

    try:
        session(first, END, talk, beside=[other])
    finally:
        other.close()
    assert second.core.r[1] == 42


def test_the_end_of_the_process_ends_the_hold_too():
    asked = []

    def ends():
        asked.append(1)
        return len(asked) > 3

    machine = tiny()
    answer, _ = session(machine, 1000, lambda client: client.ask("?"), ends=ends)
    assert answer in ("T05thread:1;", None)
    assert machine.core.cycles >= 1000


def test_a_port_beyond_this_machine_must_be_asked_for_and_a_taken_one_is_reported():
    with pytest.raises(UserError, match="gdb for TINY on 0.0.0.0:0: .*--allow-network"):
        GdbServer(tiny(), 0, host="0.0.0.0")  # noqa: S104
    first = GdbServer(tiny(), 0)
    first.begin()
    try:
        with pytest.raises(UserError, match=f"gdb for TINY on 127.0.0.1:{first.port}: Address already in use"):
            GdbServer(tiny(), first.port)
        with pytest.raises(UserError, match="a port is 0 ... 65535"):
            GdbServer(tiny(), 70000)
    finally:
        first.close()


def test_a_debugger_has_four_requests_per_millisecond_to_a_running_board_and_any_number_to_a_halted_one():
    machine = tiny()
    with contextlib.closing(GdbServer(machine, 0)) as server:
        server.begin()
        with socket.create_connection(("127.0.0.1", server.port)) as client:
            while not server.held:
                server._attend()
            client.sendall(b"$m0,4#fd" * 40)
            server._attend()
            assert server.worked == 40
            client.sendall(b"$c#63")
            server._attend()
            assert not server.held
            for _ in range(16):  # what the last burst left is used up
                client.sendall(b"$m0,4#fd" * 40)
                server.poll()
            before = server.worked
            for look in range(1, 6):
                server.poll()
                assert server.worked - before == 4 * look
