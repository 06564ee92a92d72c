#include "can_link.h"

#include <ranger_sim/firmware.h>

#include "error_module.h"
#include "mch_table.h"
#include "quirks.h"

#define CONTROLLER 1u
#define BTR_3_MBIT_S 0x00254001u /* at 60 MHz */
#define INTERRUPTS (FW_ICR_RI | FW_ICR_TI1 | FW_ICR_EI | FW_ICR_BEI) /* its TI1 reaches no handler */
#define FIRST_BUFFER 1u
#define SECOND_BUFFER 2u

/* Bits of CxRFS that say what kind of frame it is: others tell of the acceptance filter. */
#define KIND_OF_FRAME (FW_CAN_REMOTE | FW_CAN_EXTENDED | 0x000F0000u)

/* Rings; one place stays empty. */
#define RECEIVE_RING 64u
#define RECEIVE_MASK (RECEIVE_RING - 1u)
#define SEND_RING 8u
#define SEND_MASK (SEND_RING - 1u)

#define PLACE_CYCLES (2u * 12u) /* of the receive list's search, per place */
#define STORM_CYCLES (64u - 2u * 27u) /* more than usual, of a frame that finds the ring full */

static const struct can_receiver *receivers;
static uint32_t receiver_count;

static fw_can_frame received[RECEIVE_RING];
static volatile uint32_t received_write;
static volatile uint32_t received_read;

static fw_can_frame queued[SEND_RING];
static uint32_t queued_write;
static uint32_t queued_read;

static fw_can_frame built;
static int is_built;

#if ACCEPTANCE_FILTER
#define MOST_ACCEPTED 32u

/* The receive list in ascending order is the acceptance filter's table. */
static void accept_list(void)
{
    static fw_can_range accepted[MOST_ACCEPTED];
    uint32_t count, place;
    for (count = 0; count < receiver_count && count < MOST_ACCEPTED; count++) {
        const uint32_t identifier = receivers[count].identifier;
        for (place = count; place > 0 && accepted[place - 1].first > identifier; place--)
            accepted[place] = accepted[place - 1];
        accepted[place].controller = CONTROLLER;
        accepted[place].first = accepted[place].last = identifier;
    }
    fw_can_accept(accepted, count);
}
#endif

void can_link_start(const struct can_receiver *list, uint32_t count)
{
    receivers = list;
    receiver_count = count;
    fw_can_start(CONTROLLER, BTR_3_MBIT_S, INTERRUPTS);
#if ACCEPTANCE_FILTER
    accept_list();
#endif
}

/* --- receiving --- */

int32_t can_link_receive(void)
{
    const uint32_t write = received_write;
    const uint32_t after = (write + 1u) & RECEIVE_MASK;
    if (after == received_read) {
        if (FULL_QUEUES_REPORTED)
            error_report(ERR_CAN1_RX_BUF_OF);
        if (FULL_RECEIVE_RING_KILLS) {
            /* the robot's mistake: its release goes to a wrong address, and the full buffer asks again at once */
            fw_spend(STORM_CYCLES);
            fw_request(FW_CAN_RX, CONTROLLER);
            return 0;
        }
    } else {
        fw_can_read(CONTROLLER, &received[write]);
        received_write = after;
    }
    fw_can_release(CONTROLLER);
    return 0;
}

int32_t can_link_error(void)
{
    uint32_t cause;
    if (fw_can_GSR(CONTROLLER) & FW_GSR_BS) {
        fw_can_write_MOD(CONTROLLER, 0);
        error_report(ERR_CAN1_TX_BUSOFF);
    }
    cause = fw_can_ICR(CONTROLLER);
    if (cause & FW_ICR_EI)
        error_report(ERR_CAN1_ERR_WARN);
    if (cause & FW_ICR_DOI)
        error_report(ERR_CAN1_DATA_OVRN);
    if (cause & FW_ICR_EPI)
        error_report(ERR_CAN1_ERR_PASS);
    if (cause & FW_ICR_BEI)
        error_report(cause & FW_ICR_ERRDIR ? ERR_CAN1_BUS_RX : ERR_CAN1_BUS_TX);
    return 0;
}

/* To its setter, if the list has one. */
static void deliver(const fw_can_frame *frame)
{
    uint32_t place;
    if ((frame->FS & KIND_OF_FRAME) != FW_CAN_EIGHT_BYTES)
        return;
    for (place = 0; place < receiver_count; place++) {
        const struct can_receiver *receiver = &receivers[place];
        if (receiver->identifier == frame->ID) {
            receiver->setter(frame->DA, frame->DB);
            fw_spend(place * PLACE_CYCLES + receiver->cycles);
            return;
        }
    }
    fw_spend(receiver_count * PLACE_CYCLES);
}

int32_t can_link_receive_all(void)
{
    const uint32_t write = received_write;
    int32_t frames = 0;
    while (received_read != write) {
        deliver(&received[received_read]);
        received_read = (received_read + 1u) & RECEIVE_MASK;
        frames++;
    }
    return frames;
}

/* --- sending --- */

static void queue(const fw_can_frame *frame)
{
    const uint32_t after = (queued_write + 1u) & SEND_MASK;
    if (after == queued_read) {
        if (FULL_QUEUES_REPORTED)
            error_report(ERR_CAN_TX_QUEUE_FULL);
        return;
    }
    queued[queued_write] = *frame;
    queued_write = after;
    can_link_feed();
}

void can_link_build(uint32_t identifier, uint32_t value_word, uint32_t time_word)
{
    can_link_transmit(); /* a second one in the same row sends the first */
    built.FS = FW_CAN_EIGHT_BYTES;
    built.ID = identifier;
    built.DA = value_word;
    built.DB = time_word;
    is_built = 1;
}

void can_link_transmit(void)
{
    if (is_built) {
        is_built = 0;
        queue(&built);
    }
}

int32_t can_link_feed(void)
{
    int32_t frames = 0;
    while (queued_read != queued_write) {
        const fw_can_frame *frame = &queued[queued_read];
        if (!fw_can_transmit(CONTROLLER, FIRST_BUFFER, frame) && !fw_can_transmit(CONTROLLER, SECOND_BUFFER, frame))
            break;
        queued_read = (queued_read + 1u) & SEND_MASK;
        frames++;
    }
    return frames;
}
