"""ISO-TP over CAN FD frames of 64 bytes: the package can-isotp and a board in C that returns each message reversed."""

import contextlib

import pytest

from ranger_sim.can_bus.edge.lockstep_bus import LockstepBus
from ranger_sim.firmware_sim.native.hardware import Hardware
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.harness.machine import Machine
from ranger_sim.harness.wiring.wires import CanWire, Wiring
from tests.firmware_sim.native.support import COMPILER, SCHEDULE, folder_with, library_of
from tests.harness.test_can_fd_machine import RATES, Nothing

isotp = pytest.importorskip("isotp")
pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
# ISO 15765-2:2016, frames of CAN FD: single 00 LL, first 1L LL, consecutive 2N, flow control 30 BS 00.
SERVER = """
#include <string.h>
#include <ranger_sim/firmware.h>
#define BLOCK 16 /* consecutive frames between two of flow control */
static uint8_t message[4096];
static uint32_t length, have, given, next, sending, block;
static const uint8_t go_on[3] = {0x30, BLOCK, 0};
static void send(const uint8_t *head, uint32_t head_length, const uint8_t *data, uint32_t count)
{
    static const uint8_t lengths[] = {8, 12, 16, 20, 24, 32, 48, 64};
    fw_canfd_frame frame = {0x7E8, 0, FW_CANFD_FDF | FW_CANFD_BRS, {0, 0}, {0}};
    uint32_t place = 0;
    while (lengths[place] < head_length + count)
        place++;
    frame.length = lengths[place];
    memset(frame.data, 0xCC, sizeof frame.data);
    memcpy(frame.data, head, head_length);
    memcpy(frame.data + head_length, data, count);
    fw_canfd_transmit(1, 1, &frame);
}
static void answer(void)
{
    for (uint32_t i = 0; i < length / 2; i++) {
        uint8_t kept = message[i];
        message[i] = message[length - 1 - i];
        message[length - 1 - i] = kept;
    }
    if (length <= 62) {
        const uint8_t long_head[2] = {0, (uint8_t)length};
        const uint8_t short_head[1] = {(uint8_t)length};
        if (length <= 7)
            send(short_head, 1, message, length);
        else
            send(long_head, 2, message, length);
        return;
    }
    const uint8_t head[2] = {(uint8_t)(0x10 | length >> 8), (uint8_t)length};
    send(head, 2, message, 62);
    given = 62;
    next = 1;
}
static int32_t on_frame(void)
{
    fw_canfd_frame frame;
    if (!fw_canfd_receive(1, &frame))
        return 0;
    const uint8_t kind = frame.data[0] >> 4;
    if (kind == 0) {
        const uint32_t head = frame.data[0] ? 1 : 2;
        length = frame.data[head - 1];
        memcpy(message, frame.data + head, length);
        answer();
    } else if (kind == 1) {
        length = (frame.data[0] & 15u) << 8 | frame.data[1];
        have = frame.length - 2u;
        memcpy(message, frame.data + 2, have);
        block = 0;
        send(go_on, 3, go_on, 0);
    } else if (kind == 2) {
        uint32_t count = frame.length - 1u < length - have ? frame.length - 1u : length - have;
        memcpy(message + have, frame.data + 1, count);
        have += count;
        if (have == length) {
            answer();
        } else if (++block == BLOCK) {
            block = 0;
            send(go_on, 3, go_on, 0);
        }
    } else if (kind == 3) {
        sending = 1;
    }
    return 1;
}
static int32_t send_next(void)
{
    if (!sending || !fw_canfd_buffer_free(1, 1))
        return 0;
    const uint8_t head[1] = {(uint8_t)(0x20 | (next++ & 15))};
    const uint32_t count = length - given < 63 ? length - given : 63;
    send(head, 1, message + given, count);
    given += count;
    sending = given < length;
    return 1;
}
static const fw_interrupt receive = {FW_CAN_RX, 1, on_frame, "on_frame", 500, 0, 0, FW_USUAL_LATENCY};
static const fw_task every[] = {{send_next, "send_next", 500, 2000}};
static const fw_schedule schedule = {.slot_ns = 1000000, .every = FW_TASKS(every), .tick_vic_slot = 4};
static const fw_can_range accepted[] = {FW_CAN_ONE(1, 0x7E0)};
void firmware_start(void)
{
    fw_canfd_start(1, 500000, 2000000, FW_ICR_RI);
    fw_can_accept(accepted, 1);
    fw_attach(&receive);
}
"""


def test_messages_of_up_to_four_kilobytes_come_back_reversed(tmp_path):
    library = library_of(folder_with(tmp_path / "server", SERVER + SCHEDULE))
    boards = {"SERVER": NativeBoard("SERVER", library, hardware=Hardware(can="fd"))}
    machine = Machine(Nothing(), boards, {"can1": RATES}, Wiring(can=[CanWire("SERVER", 1, 1)]), seed=1)
    with contextlib.closing(machine), LockstepBus(machine) as bus:
        address = isotp.Address(isotp.AddressingMode.Normal_11bits, rxid=0x7E8, txid=0x7E0)
        errors = []
        stack = isotp.CanStack(
            bus,
            address=address,
            error_handler=errors.append,
            # time-outs by the wall clock, which a loaded computer must not meet
            params={
                "can_fd": True,
                "bitrate_switch": True,
                "tx_data_length": 64,
                "rx_flowcontrol_timeout": 60_000,
                "rx_consecutive_frame_timeout": 60_000,
            },
        )
        for length in (1, 7, 8, 62, 63, 64, 500, 4095):
            message = bytes((7 * place + length) % 256 for place in range(length))
            stack.send(message)
            while not stack.available() and machine.time_s < 30.0:
                stack.process(rx_timeout=0.002)
            assert stack.recv() == message[::-1], length
        assert errors == [] and machine.buses[0].counters.errors == 0
