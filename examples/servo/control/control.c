/* The control board: where the arm is to be, every ms, and whether it is there. Numbers are chosen by us. */
#include <string.h>

#include <ranger_sim/firmware.h>

#include "control_table.h"

#define SLOT_S (CONTROL_SLOT_US * 1e-6f)

enum state { WAITS = 0, MOVES = 1, STOPPED = 2 };
enum { SILENCE_MS = 20, TOO_FAR_MS = 40, DRIVE_HAS_A_FAULT = 2 };
static const float TOO_FAR_RAD = 0.3f;

/* The programme: to these angles in turn, in so long, and so long a rest there. */
static const struct move {
    float angle; /* rad, 0 hangs */
    float way_s;
    float rest_s;
} programme[] = {
    {1.5f, 0.5f, 0.2f}, {0.4f, 0.4f, 0.1f}, {-0.9f, 0.5f, 0.1f}, {0.9f, 0.3f, 0.2f}, {-1.5f, 0.8f, 0.1f}, {0.0f, 0.6f, 0.2f},
};
enum { MOVES_OF_PROGRAMME = sizeof programme / sizeof programme[0] };

static struct {
    struct control_data table;
    uint32_t ms;
    uint32_t silent_ms; /* since an angle came */
    int heard;
    uint32_t too_far_ms;
    uint32_t move;
    float since_s; /* the move began */
    float from;    /* rad */
    uint32_t longest_cycles;
    uint32_t errors[ERR_DRIVE_FAULT + 1];
    uint32_t waiting_error; /* 0: none */
} board;

static uint32_t word_of(float value)
{
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    return word;
}

static float float_of(uint32_t word)
{
    float value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static void note(uint32_t code)
{
    board.errors[code]++;
    board.waiting_error = code;
}

static int32_t on_frame(void)
{
    fw_can_frame frame;
    fw_can_read(1, &frame);
    fw_can_release(1);
    switch (frame.ID) {
    case DRIVE_ANGLE:
        board.table.drive_angle = float_of(frame.DA);
        board.silent_ms = 0;
        board.heard = 1;
        break;
    case DRIVE_STATE:
        board.table.drive_state = frame.DA;
        break;
    default:
        break;
    }
    return 0;
}

/* --- tasks of every slot --- */

static int32_t supervise(void)
{
    board.ms++;
    if (board.table.control_state == WAITS && board.heard) {
        board.table.control_state = MOVES;
        board.from = board.table.drive_angle;
    }
    if (board.table.control_state != MOVES)
        return 0;
    float off = board.table.control_target_angle - board.table.drive_angle;
    board.too_far_ms = off * off > TOO_FAR_RAD * TOO_FAR_RAD ? board.too_far_ms + 1 : 0;
    uint32_t why = 0;
    if (++board.silent_ms > SILENCE_MS)
        why = ERR_DRIVE_SILENT;
    else if (board.too_far_ms > TOO_FAR_MS)
        why = ERR_FOLLOWING;
    else if (board.table.drive_state == DRIVE_HAS_A_FAULT)
        why = ERR_DRIVE_FAULT;
    if (why) {
        note(why);
        board.table.control_state = STOPPED;
    }
    return 0;
}

/* The polynomial of fifth order that begins and ends at rest, without a jump of acceleration. */
static int32_t trajectory(void)
{
    const struct move *move = &programme[board.move];
    if (board.table.control_state != MOVES) {
        board.table.control_target_rate = 0.0f;
        return 0;
    }
    float s = board.since_s / move->way_s;
    float way = move->angle - board.from;
    if (s >= 1.0f) {
        board.table.control_target_angle = move->angle;
        board.table.control_target_rate = 0.0f;
    } else {
        board.table.control_target_angle = board.from + way * s * s * s * (10.0f + s * (6.0f * s - 15.0f));
        board.table.control_target_rate = way / move->way_s * 30.0f * s * s * (1.0f - s) * (1.0f - s);
    }
    board.since_s += SLOT_S;
    if (board.since_s > move->way_s + move->rest_s) {
        board.from = move->angle;
        board.since_s = 0.0f;
        board.move = (board.move + 1) % MOVES_OF_PROGRAMME;
    }
    return 0;
}

static int32_t measure_slot(void)
{
    uint32_t cycles = fw_slot_cycles();
    if (cycles > board.longest_cycles) {
        board.longest_cycles = cycles;
        board.table.control_execution_time = (float)cycles / 60e6f;
    }
    return 0;
}

/* --- what is sent --- */

static void send(uint32_t id, uint32_t word)
{
    fw_can_frame frame = {FW_CAN_EIGHT_BYTES, id, word, board.ms};
    if (!fw_can_transmit(1, 1, &frame))
        note(ERR_CAN_BUSY);
}

static int32_t send_angle(void)
{
    send(CONTROL_TARGET_ANGLE, word_of(board.table.control_target_angle));
    return 0;
}

static int32_t send_rate(void)
{
    send(CONTROL_TARGET_RATE, word_of(board.table.control_target_rate));
    return 0;
}

static int32_t send_state(void)
{
    send(CONTROL_STATE, board.table.control_state);
    return 0;
}

static int32_t send_error(void)
{
    uint32_t code = board.waiting_error;
    if (code) {
        uint32_t count = board.errors[code] < 1023 ? board.errors[code] : 1023;
        board.waiting_error = 0;
        send(ERROR_CONTROL, code | CONTROL_BOARD_NUMBER << 16 | count << 22);
    }
    return 0;
}

static int32_t send_execution_time(void)
{
    send(CONTROL_EXECUTION_TIME, word_of(board.table.control_execution_time));
    return 0;
}

static const fw_task every[] = {
    /* function  name          cost  limit */
    {supervise,  "supervise",   500,  700},
    {trajectory, "trajectory", 1500, 2000},
};
static const fw_task angle[] = {{send_angle, "CONTROL_TARGET_ANGLE", 260, 400}};
static const fw_task rate[] = {{send_rate, "CONTROL_TARGET_RATE", 260, 400}};
static const fw_task state[] = {{send_state, "CONTROL_STATE", 260, 400}};
static const fw_tasks rows[CONTROL_ROWS] = {FW_TASKS(angle), FW_TASKS(rate), FW_TASKS(state), {NULL, 0}};
static const fw_task last[] = {{measure_slot, "measure_slot", 60, 100}};
static const fw_task occasional[] = {
    {send_error,          "ERROR_CONTROL",          260, 400},
    {send_execution_time, "CONTROL_EXECUTION_TIME", 260, 400},
};
static const fw_schedule schedule = {
    .slot_ns = CONTROL_SLOT_US * 1000,
    .tick_cost = 60,
    .tick_vic_slot = 4,
    .every = FW_TASKS(every),
    .rows = rows,
    .row_count = CONTROL_ROWS,
    .last = FW_TASKS(last),
    .occasional = FW_TASKS(occasional),
    .occasional_row = CONTROL_ROWS - 1,
    .occasional_cost = 40,
    .occasional_limit = 500,
};
static const fw_interrupt receive = {FW_CAN_RX, 1, on_frame, "on_frame", 180, 0, 0, FW_USUAL_LATENCY};

void firmware_start(void)
{
    board.table = control_initial;
    fw_can_start(1, 0x002A4007u, FW_ICR_RI); /* 500 kbit/s: 15 quanta of 8 clocks, sampled at 80 % */
    fw_attach(&receive);
}

const fw_schedule *firmware_schedule(void) { return &schedule; }
uint32_t firmware_table_version(void) { return RANGER_TABLE_VERSION; }
uint32_t firmware_time_ms(void) { return board.ms; }

const fw_error_counts *firmware_errors(void)
{
    static fw_error_counts told;
    told.counts = board.errors;
    told.count = sizeof board.errors / sizeof board.errors[0];
    return &told;
}
