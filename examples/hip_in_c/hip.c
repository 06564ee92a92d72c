/* Hip motor board (MCH): 0.5 ms slots, 4 rows. Positive hip angle: inner legs swung forward.
 *
 * The Python board is boards/hip.py on boards/motor_board.py; this is the same board, bit for bit and cycle for cycle:
 * costs and limits are its numbers (two cycles per instruction counted on the robot). */
#include <ranger_sim/firmware.h>

#include "absolute_encoder.h"
#include "can_link.h"
#include "compliant_control.h"
#include "converters.h"
#include "current_control.h"
#include "encoder_capture.h"
#include "error_module.h"
#include "execution_timer.h"
#include "fixed.h"
#include "joint_safety.h"
#include "mch_table.h"
#include "mcu_led.h"
#include "motor_limits.h"
#include "motor_output.h"
#include "network_time.h"
#include "quadrature_decoder.h"
#include "quirks.h"

#define ENCODER_SELECT_PIN FW_P0(13) /* low: connector J3 */
#define REZERO_SHARE 0.05            /* of the difference, per call */
#define START_VALUES_NS 400000u      /* after power-up: about 23,000 instructions pass before the first slot */
#define SLOTS_BEGIN_NS 500000u

/* --- encoders --- */

#define PI 3.141592653589793
#define TIMER_HZ 60000000.0
#define JOINT_RAD_PER_COUNT (PI / 2048.0)          /* pulses, at the joint; both edges count */
#define MOTOR_RAD_PER_COUNT (PI / (192.0 * 66.0)) /* pulses, gear */

static const struct decoder_gains joint_gains = {
    .position_gain = (int32_t)(JOINT_RAD_PER_COUNT * 65536.0 * 256.0),
    .position_shift = 8,
    .rate_gain = (int32_t)(JOINT_RAD_PER_COUNT * TIMER_HZ / 8.0),
    .rate_bits = 31 - 3,
    .glitch_code = ERR_QDC_CH01_GLTCH,
    .full_code = ERR_QDC_CH01_BUF_F,
};
static const struct decoder_gains motor_gains = {
    .position_gain = (int32_t)(MOTOR_RAD_PER_COUNT * 65536.0 * 1024.0),
    .position_shift = 10,
    .rate_gain = (int32_t)(MOTOR_RAD_PER_COUNT * TIMER_HZ),
    .rate_bits = 31,
    .glitch_code = ERR_QDC_CH23_GLTCH,
    .full_code = ERR_QDC_CH23_BUF_F,
};

static struct decoder joint = DECODER(&joint_gains);
static struct decoder motor = DECODER(&motor_gains);
static struct capture joint_capture = CAPTURE(0u, FW_P0(22), FW_P0(27), &joint);
static struct capture motor_capture = CAPTURE(2u, FW_P0(16), FW_P0(29), &motor);

static int32_t on_joint_edge(void)
{
    capture_edge(&joint_capture);
    return 0;
}

static int32_t on_motor_edge(void)
{
    capture_edge(&motor_capture);
    return 0;
}

static int32_t joint_angle(void)
{
    decoder_update_angle(&joint);
    return 0;
}

static int32_t joint_rate(void) { return decoder_update_rate(&joint); }

static int32_t motor_angle(void)
{
    decoder_update_angle(&motor);
    return 0;
}

static int32_t motor_rate(void) { return decoder_update_rate(&motor); }

/* --- the motor's count is moved towards the joint's angle --- */

static int32_t rezero_count;
static int rezeroing;

static int32_t motor_encoder_rezero(void)
{
    if (HIP_REZERO) {
        const float angle = float_of_fixed(motor.position);
        const float difference = absolute_encoder_rad() - angle;
        const float wanted = (float)((double)angle + (double)difference * REZERO_SHARE);
        rezero_count = decoder_count_at(&motor, fixed_of_float(wanted));
        rezeroing = 1;
    }
    return 0;
}

/* What the row's line does at its end: set the motor's count (edges that came since the slot read the angle are
 * forgotten, on the robot as here), or send its frame. */
static int32_t end_line(void)
{
    if (rezeroing) {
        rezeroing = 0;
        motor.count = rezero_count;
    }
    can_link_transmit();
    return 0;
}

/* --- control: position by the absolute encoder, velocity by the motor's --- */

static int32_t mc_compliant_control(void)
{
    const int32_t velocity = motor.rate;
    const int64_t wanted = compliant_current(absolute_encoder_angle(), velocity);
    current_control_update(motor_limits_target(wanted, velocity), motor_current_fixed());
    return 0;
}

/* --- what is sent --- */

/* Returns 1, or 0 for the value 0: what costs more when it is not 0 counts by that. */
static int32_t publish(uint32_t identifier, float value)
{
    const uint32_t word = word_of_float(value);
    can_link_build(identifier, word, network_time_ms());
    return word != 0;
}

static int32_t send_angle(void) { return publish(MCH_ANGLE, absolute_encoder_rad()); }
static int32_t send_ang_rate(void) { return publish(MCH_ANG_RATE, float_of_fixed(joint.rate)); }
static int32_t send_batt_power(void) { return publish(MCH_BATT_POWER, battery_power()); }
static int32_t send_motor_position(void) { return publish(MCH_MOTOR_POSITION, float_of_fixed(motor.position)); }
static int32_t send_motor_current(void) { return publish(MCH_MOTOR_CURRENT, motor_current()); }
static int32_t send_status(void) { return publish(MCH_STATUS, 1.0f); }
static int32_t send_batt_current(void) { return publish(MCH_BATT_CURRENT, battery_current()); }
static int32_t send_batt_voltage(void) { return publish(MCH_BATT_VOLTAGE, battery_voltage()); }
static int32_t send_motor_velocity(void) { return publish(MCH_MOTOR_VELOCITY, float_of_fixed(motor.rate)); }
static int32_t send_execution_time(void) { return publish(MCH_EXECUTION_TIME, execution_seconds()); }
static int32_t send_max_execution_time(void) { return publish(MCH_MAX_EXECUTION_TIME, execution_longest_seconds()); }

static int32_t send_error(void)
{
    uint32_t word;
    uint32_t stamp;
    if (!error_take(&word, &stamp))
        return 0;
    can_link_build(ERROR_MCH, word, stamp);
    return 1;
}

/* --- the schedule: one pass takes 2 ms; each row's variable goes out at 500 Hz, the occasional ones at 45.45 Hz --- */

#define TRANSMIT_CYCLES (2 * 30) /* of a line that sends: what can_transmit takes, behind it */
#define SEND(instructions) (2 * (instructions) - TRANSMIT_CYCLES)

static const fw_task every_slot[] = {
    /* function              name                     cost     limit  per item  item */
    {adcx_convert_all,       "adcx_convert_all",      2 * 37,    110,       0, NULL},
    {adci_convert_all,       "adci_convert_all",      2 * 31,     90,       0, NULL},
    {joint_angle,            "qdc_cap01_angle",       2 * 23,     70,       0, NULL},
    {joint_rate,             "qdc_cap01_rate",        2 * 633,  6000,  2 * 24, "edge"},
    {motor_angle,            "qdc_cap23_angle",       2 * 23,     70,       0, NULL},
    {motor_rate,             "qdc_cap23_rate",        2 * 614,  6000,  2 * 24, "edge"},
    {absolute_encoder_start, "ae_update",             2 * 21,     60,       0, NULL},
    {can_link_receive_all,   "can_rx_dispatch_all",   2 * 15,   7500, 2 * 115, "frame"},
    {heartbeat_beat,         "hb_beat",               2 * 21,     90,       0, NULL},
    {mcu_led_update,         "mcu_led_update",        2 * 31,    130,       0, NULL},
    {joint_safety_check,     "dn_safety",             2 * 34,    140,       0, NULL},
    {error_update,           "error_update",          2 * 39,   5500, 2 * 213, "error"},
    {can_link_feed,          "can_tx1",               2 * 5,     600,  2 * 35, "frame", .transmits = 1},
    {adcx_sequence_done,     "adcx_conversion_wait",  2 * 6,    6500,       0, NULL, .kind = FW_WAIT},
    {mc_compliant_control,   "mc_compliant_control",  2 * 735,  2100,       0, NULL},
};
static const fw_task row_0[] = {
    {send_angle,             "MCH_ANGLE",             SEND(187), 2 * 450, 2 * 140, "value"},
};
static const fw_task row_1[] = {
    {send_ang_rate,          "MCH_ANG_RATE",          SEND(165), 2 * 320, 2 * 70, "value"},
};
static const fw_task row_2[] = {
    {send_batt_power,        "MCH_BATT_POWER",        SEND(262), 2 * 350, 0, NULL},
};
static const fw_task occasional[] = {
    {send_error,             "ERROR_MCH",              1,        2 * 300, 2 * 196, "value"}, /* 8 of 30 pass later */
    {send_motor_position,    "MCH_MOTOR_POSITION",     SEND(165), 2 * 350, 2 * 90, "value"},
    {send_motor_current,     "MCH_MOTOR_CURRENT",      SEND(320), 2 * 440, 0, NULL},
    {send_status,            "MCH_STATUS",             SEND(154), 2 * 210, 0, NULL},
    {send_batt_current,      "MCH_BATT_CURRENT",       SEND(320), 2 * 440, 0, NULL},
    {send_batt_voltage,      "MCH_BATT_VOLTAGE",       SEND(308), 2 * 410, 0, NULL},
    {send_motor_velocity,    "MCH_MOTOR_VELOCITY",     SEND(155), 2 * 320, 2 * 70, "value"},
    {motor_encoder_rezero,   "motor_encoder_rezero",   2 * 3730,  2 * 5000, 0, NULL},
    {send_execution_time,    "MCH_EXECUTION_TIME",     SEND(276), 2 * 370, 0, NULL},
    {send_max_execution_time, "MCH_MAX_EXECUTION_TIME", SEND(276), 2 * 370, 0, NULL},
};
static const fw_task last[] = {
    {end_line,               "can_transmit",          TRANSMIT_CYCLES, 100, 0, NULL, .transmits = 1},
    {execution_time_record,  "execution_time_record", 2 * 22,           60, 0, NULL},
};
static const fw_tasks rows[MCH_ROWS] = {FW_TASKS(row_0), FW_TASKS(row_1), FW_TASKS(row_2), {NULL, 0}};

/* --- start-up --- */

/* The low sides on, the encoder's multiplexer set, and one reading of the joint's angle. */
static void read_sensors_once(void)
{
    motor_output_enable_low_side(1);
    fw_pin_write(ENCODER_SELECT_PIN, 0);
    absolute_encoder_start();
}

/* When that reading has come: the encoders start at the absolute angle. */
static void set_start_values(void)
{
    joint.count = decoder_count_at(&joint, absolute_encoder_angle());
    if (HIP_MOTOR_ENCODER_PRESET)
        motor.count = decoder_count_at(&motor, absolute_encoder_angle());
}

static const fw_step steps[] = {
    {START_VALUES_NS, read_sensors_once},
    {SLOTS_BEGIN_NS - 1u, set_start_values},
};

static void note_overrun(void) { error_report(ERR_ASCHED_DNF); }
#if WARN_NEAR_SLOT_LIMIT
static void note_limit(void) { error_report(ERR_SCHED_TASK_LIMIT); }
static void note_near_limit(void) { error_report(ERR_SCHED_SLOT_NEAR_LIMIT); }
#endif

#define IRQ_LATENCY 25 /* cycles, part of those counted */
#define FIQ_LATENCY 12

static const fw_schedule schedule = {
    .slot_ns = MCH_SLOT_US * 1000u,
    .tick_cost = 180 - IRQ_LATENCY, /* to the first function of the row, 3 us */
    .tick_vic_slot = 4,
    .flags = FW_TRANSMITTERS_NAMED | (OCCASIONAL_IDLE_CALL ? 0 : FW_NO_IDLE_CALL),
    .first_slot_ns = SLOTS_BEGIN_NS,
    .every = FW_TASKS(every_slot),
    .rows = rows,
    .row_count = MCH_ROWS,
    .last = FW_TASKS(last),
    .occasional = FW_TASKS(occasional),
    .occasional_row = 3,
    .occasional_cost = 20,
    .steps = steps,
    .step_count = sizeof steps / sizeof steps[0],
    .on_overrun = note_overrun,
#if WARN_NEAR_SLOT_LIMIT
    .on_limit = note_limit,
    .on_near_limit = note_near_limit,
#endif
};

/* Interrupts; the cycles are those counted, latency included. A capture of before a wrap comes before the wrap. */
static const fw_interrupt interrupts[] = {
    /* source                   handler             name                cost                per item, VIC slot */
    {FW_CAN_RX, 1,              can_link_receive,   "can_receive",      2 * 27 - IRQ_LATENCY,  0, 0, FW_USUAL_LATENCY},
    {FW_CAN_STATUS, 1,          can_link_error,     "can_error",        2 * 50 - IRQ_LATENCY,  0, 8, FW_USUAL_LATENCY},
    {FW_EXTERNAL_INTERRUPT, 1,  adcx_busy_fell,     "adcx_busy",        2 * 68 - IRQ_LATENCY,  0, 1, FW_USUAL_LATENCY},
    {FW_ADC_DONE, 0,            adci_done,          "adci_done",        2 * 38 - IRQ_LATENCY,  0, 3, FW_USUAL_LATENCY},
    {FW_PIN_EDGE, FW_P0(22),    on_joint_edge,      "encoder_edge_0",   2 * 47 - FIQ_LATENCY,  0, FW_FIQ, FIQ_LATENCY},
    {FW_PIN_EDGE, FW_P0(16),    on_motor_edge,      "encoder_edge_2",   2 * 47 - FIQ_LATENCY,  0, FW_FIQ, FIQ_LATENCY},
    {FW_TIMER_MATCH, CAPTURE_TIMER, capture_wrap,   "encoder_timer_wrap", 2 * 9 - FIQ_LATENCY, 0, FW_FIQ, FIQ_LATENCY},
    {FW_SPI_DONE, 0,            absolute_encoder_accept, "ae_read",     2 * 35 - IRQ_LATENCY,  0, 10, FW_USUAL_LATENCY},
};

/* What is received. A gain or a command takes 28 instructions more than the time: from float to fixed point. */
#define GAIN_CYCLES (2u * 28u)
static const struct can_receiver receive_list[] = {
    {MCH_MOTOR_TARGET_CURRENT, compliant_receive_target,      GAIN_CYCLES},
    {TIMESTAMP,                network_time_receive,          0},
    {MCH_SHUTDOWN,             motor_output_receive_shutdown, 0},
    {MCH_COMMAND_CURRENT,      compliant_receive_command,     GAIN_CYCLES},
    {MCH_STIFFNESS,            compliant_receive_stiffness,   GAIN_CYCLES},
    {MCH_DAMPNESS,             compliant_receive_dampness,    GAIN_CYCLES},
    {MCH_SLEEP,                motor_output_receive_sleep,    0},
};

void firmware_start(void)
{
    size_t i;
    can_link_start(receive_list, sizeof receive_list / sizeof receive_list[0]);
    converters_start();
    motor_output_start();
    fw_timer_start(CAPTURE_TIMER, CAPTURE_PERIOD, 1);
    capture_start(&joint_capture);
    capture_start(&motor_capture);
    fw_spi_start(0);
    for (i = 0; i < sizeof interrupts / sizeof interrupts[0]; i++)
        fw_attach(&interrupts[i]);
}

const fw_schedule *firmware_schedule(void) { return &schedule; }
uint32_t firmware_table_version(void) { return RANGER_TABLE_VERSION; }
const fw_error_counts *firmware_errors(void) { return error_counts(); }
uint32_t firmware_time_ms(void) { return network_time_ms(); }
