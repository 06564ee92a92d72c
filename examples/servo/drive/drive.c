/* The motor board: encoder, current, PWM; position loop around current loop, every 250 us.
 *
 * Numbers without a source are chosen by us: the loops for the motor and the arm of ../body.py, the costs as the emulated
 * boards of the Ranger robot have them for like work (some 60 cycles for an operation on floats, which this processor
 * does in software). */
#include <string.h>

#include <ranger_sim/firmware.h>

#include "drive_table.h"

#define ENCODER_A FW_P0(22) /* CAP0.0 */
#define ENCODER_B FW_P0(27)
#define CURRENT_INPUT 0     /* AIN0 */

#define SLOT_S (DRIVE_SLOT_US * 1e-6f)
#define SLOTS_PER_MS (1000 / DRIVE_SLOT_US)
#define PWM_PERIOD 3000u /* counts of 60 MHz: 20 kHz */

static const float RAD_PER_EDGE = 3.14159265f / 500.0f; /* 500 lines, both edges of channel A */
static const float A_PER_COUNT = 3.3f / 1024.0f / 0.25f; /* 10 bits of 3.3 V, 0.25 V/A */
static const int32_t ZERO_CURRENT_COUNTS = 512;
static const float SUPPLY_V = 24.0f;
static const float MOST_V = 22.0f;
static const float RESISTANCE_OHM = 2.32f;
static const float BACK_EMF_VS = 0.0234f;

/* Observer of angle and rate: both poles at 250 rad/s. */
static const float OBSERVER_ANGLE = 2.0f * 250.0f * SLOT_S;
static const float OBSERVER_RATE = 250.0f * 250.0f * SLOT_S;
/* Position loop: 60 rad/s, damping 0.8, for 4.6e-5 kg m^2 and 0.0234 N m/A; a weight is carried by the integral. */
static const float STIFFNESS_A = 7.1f;
static const float DAMPING_AS = 0.19f;
static const float INTEGRAL_A_PER_S = 70.0f;
static const float MOST_A = 3.0f;
static const float MOST_INTEGRAL_A = 1.5f;
/* Current loop: what is left of the error after a slot is three quarters of it. */
static const float CURRENT_V = 0.25f * 2.32f;

enum { SILENCE_MS = 20, NO_EDGE_MS = 50, OVERCURRENT_SLOTS = 4, MOVING = 1 };
static const float OVERCURRENT_A = 5.0f;

enum state { OFF = 0, HOLDS = 1, FAULT = 2 };

static struct {
    struct drive_data table;
    uint32_t slots;
    int32_t edges;        /* counted by the fast interrupt */
    int32_t edges_before; /* when the last one was looked at */
    uint32_t still_ms;    /* since an edge came, with the largest current */
    uint32_t silent_ms;   /* since a target came */
    int heard;            /* a target came since power-up */
    uint32_t over_slots;
    float angle;          /* of the observer, rad */
    float rate;           /* rad/s */
    float target;         /* rad: between frames it goes on at its rate */
    float wanted_A;
    float current_A;
    float integral_A;
    float integral_V;
    uint32_t longest_cycles;
    uint32_t errors[ERR_DRIVE_FAULT + 1];
    uint32_t waiting_error; /* 0: none */
} board;

static uint32_t now_ms(void) { return board.slots / SLOTS_PER_MS; }

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

static float within(float value, float most) { return value > most ? most : value < -most ? -most : value; }

static void note(uint32_t code)
{
    board.errors[code]++;
    board.waiting_error = code;
}

/* --- interrupts --- */

static int32_t on_edge(void)
{
    board.edges += fw_pin(ENCODER_A) == fw_pin(ENCODER_B) ? -1 : 1;
    fw_timer_clear_IR(0, FW_IR_CR(0));
    return 0;
}

static int32_t on_frame(void)
{
    fw_can_frame frame;
    fw_can_read(1, &frame);
    fw_can_release(1);
    switch (frame.ID) {
    case CONTROL_STATE:
        board.table.control_state = frame.DA;
        break;
    case CONTROL_TARGET_ANGLE:
        board.target = board.table.control_target_angle = float_of(frame.DA);
        board.silent_ms = 0;
        board.heard = 1;
        break;
    case CONTROL_TARGET_RATE:
        board.table.control_target_rate = float_of(frame.DA);
        break;
    default:
        break;
    }
    return 0;
}

/* --- tasks of every slot --- */

static int32_t convert(void)
{
    board.slots++;
    fw_adc_start(CURRENT_INPUT); /* 2.6 us: it is through before current_loop wants it */
    return 0;
}

static int32_t observe(void)
{
    float error = RAD_PER_EDGE * (float)board.edges - board.angle;
    board.angle += SLOT_S * board.rate + OBSERVER_ANGLE * error;
    board.rate += OBSERVER_RATE * error;
    board.table.drive_angle = RAD_PER_EDGE * (float)board.edges;
    board.table.drive_rate = board.rate;
    return 0;
}

static void switch_off(uint32_t code)
{
    note(code);
    board.table.drive_state = FAULT;
}

static int32_t supervise(void)
{
    if (board.slots % SLOTS_PER_MS == 0) {
        if (board.heard && board.silent_ms++ == SILENCE_MS)
            note(ERR_TARGET_LOST);
        if (board.edges != board.edges_before || board.wanted_A * board.wanted_A < MOST_A * MOST_A)
            board.still_ms = 0;
        else if (++board.still_ms == NO_EDGE_MS)
            switch_off(ERR_ENCODER_DEAD);
        board.edges_before = board.edges;
    }
    if (board.current_A * board.current_A < OVERCURRENT_A * OVERCURRENT_A)
        board.over_slots = 0;
    else if (++board.over_slots == OVERCURRENT_SLOTS)
        switch_off(ERR_OVERCURRENT);
    if (board.table.drive_state != FAULT)
        board.table.drive_state =
            board.table.control_state == MOVING && board.heard && board.silent_ms <= SILENCE_MS ? HOLDS : OFF;
    return 0;
}

static int32_t position_loop(void)
{
    if (board.table.drive_state != HOLDS) {
        board.wanted_A = board.integral_A = 0.0f;
        return 0;
    }
    board.target += SLOT_S * board.table.control_target_rate;
    float error = board.target - board.angle;
    board.integral_A = within(board.integral_A + SLOT_S * INTEGRAL_A_PER_S * error, MOST_INTEGRAL_A);
    board.wanted_A = within(
        STIFFNESS_A * error + DAMPING_AS * (board.table.control_target_rate - board.rate) + board.integral_A, MOST_A);
    return 0;
}

static int32_t current_loop(void)
{
    board.current_A = A_PER_COUNT * (float)((int32_t)fw_adc_result() - ZERO_CURRENT_COUNTS);
    board.table.drive_current = board.current_A;
    if (board.table.drive_state != HOLDS) {
        board.integral_V = 0.0f;
        fw_pwm_write(0, 0);
        return 0;
    }
    board.integral_V = within(board.integral_V + CURRENT_V * (board.wanted_A - board.current_A), MOST_V);
    float volts = within(RESISTANCE_OHM * board.wanted_A + BACK_EMF_VS * board.rate + board.integral_V, MOST_V);
    uint32_t counts = (uint32_t)((volts < 0.0f ? -volts : volts) * ((float)PWM_PERIOD / SUPPLY_V));
    fw_pwm_write(volts > 0.0f ? counts : 0, volts < 0.0f ? counts : 0);
    return 0;
}

static int32_t measure_slot(void)
{
    uint32_t cycles = fw_slot_cycles();
    if (cycles > board.longest_cycles) {
        board.longest_cycles = cycles;
        board.table.drive_execution_time = (float)cycles / 60e6f;
    }
    return 0;
}

/* --- what is sent --- */

static void send(uint32_t id, uint32_t word)
{
    fw_can_frame frame = {FW_CAN_EIGHT_BYTES, id, word, now_ms()};
    if (!fw_can_transmit(1, 1, &frame))
        note(ERR_CAN_BUSY);
}

static int32_t send_angle(void)
{
    send(DRIVE_ANGLE, word_of(board.table.drive_angle));
    return 0;
}

static int32_t send_rate(void)
{
    send(DRIVE_RATE, word_of(board.table.drive_rate));
    return 0;
}

static int32_t send_current(void)
{
    send(DRIVE_CURRENT, word_of(board.table.drive_current));
    return 0;
}

static int32_t send_error(void)
{
    uint32_t code = board.waiting_error;
    if (code) {
        uint32_t count = board.errors[code] < 1023 ? board.errors[code] : 1023;
        board.waiting_error = 0;
        send(ERROR_DRIVE, code | DRIVE_BOARD_NUMBER << 16 | count << 22);
    }
    return 0;
}

static int32_t send_state(void)
{
    send(DRIVE_STATE, board.table.drive_state);
    return 0;
}

static int32_t send_execution_time(void)
{
    send(DRIVE_EXECUTION_TIME, word_of(board.table.drive_execution_time));
    return 0;
}

/* --- the schedule: 250 us are 15,000 cycles --- */

static const fw_task every[] = {
    /* function     name             cost  limit */
    {convert,       "convert",        120,  200},
    {observe,       "observe",        900, 1200},
    {supervise,     "supervise",      420,  600},
    {position_loop, "position_loop", 1300, 1800},
    {current_loop,  "current_loop",  1100, 1500},
};
static const fw_task angle[] = {{send_angle, "DRIVE_ANGLE", 260, 400}};
static const fw_task rate[] = {{send_rate, "DRIVE_RATE", 260, 400}};
static const fw_task current[] = {{send_current, "DRIVE_CURRENT", 260, 400}};
#define NOTHING {NULL, 0}
static const fw_tasks rows[DRIVE_ROWS] = {
    FW_TASKS(angle), NOTHING, NOTHING, NOTHING, FW_TASKS(rate),    NOTHING, NOTHING, NOTHING,
    FW_TASKS(angle), NOTHING, NOTHING, NOTHING, FW_TASKS(current), NOTHING, NOTHING, NOTHING,
};
static const fw_task last[] = {{measure_slot, "measure_slot", 60, 100}};
static const fw_task occasional[] = {
    {send_error,          "ERROR_DRIVE",          260, 400},
    {send_state,          "DRIVE_STATE",          260, 400},
    {send_execution_time, "DRIVE_EXECUTION_TIME", 260, 400},
};
static const fw_schedule schedule = {
    .slot_ns = DRIVE_SLOT_US * 1000,
    .tick_cost = 60,
    .tick_vic_slot = 4,
    .every = FW_TASKS(every),
    .rows = rows,
    .row_count = DRIVE_ROWS,
    .last = FW_TASKS(last),
    .occasional = FW_TASKS(occasional),
    .occasional_row = DRIVE_ROWS - 1,
    .occasional_cost = 40,
    .occasional_limit = 500,
};

static const fw_interrupt interrupts[] = {
    {FW_PIN_EDGE, ENCODER_A, on_edge, "on_edge", 90, 0, FW_FIQ, FW_USUAL_LATENCY},
    {FW_CAN_RX, 1, on_frame, "on_frame", 180, 0, 0, FW_USUAL_LATENCY},
};

void firmware_start(void)
{
    board.table = drive_initial;
    fw_timer_start(0, 0xFFFFFFFFu, 0);
    fw_capture_connect(0, 0, ENCODER_A);
    fw_timer_write_CCR(0, FW_CCR_RISING(0) | FW_CCR_FALLING(0) | FW_CCR_INTERRUPT(0));
    fw_adc_start_clock(14); /* 4.3 MHz, at most 4.5 (LPC2194 user manual, A/D control register) */
    fw_can_start(1, 0x002A4007u, FW_ICR_RI); /* 500 kbit/s: 15 quanta of 8 clocks, sampled at 80 % */
    fw_pwm_start(PWM_PERIOD);
    for (size_t i = 0; i < sizeof interrupts / sizeof interrupts[0]; i++)
        fw_attach(&interrupts[i]);
}

const fw_schedule *firmware_schedule(void) { return &schedule; }
uint32_t firmware_table_version(void) { return RANGER_TABLE_VERSION; }
uint32_t firmware_time_ms(void) { return now_ms(); }

const fw_error_counts *firmware_errors(void)
{
    static fw_error_counts told;
    told.counts = board.errors;
    told.count = sizeof board.errors / sizeof board.errors[0];
    return &told;
}
