/* A board of twelve on one bus: it counts the edges of its encoder and sends rate and angle; board 0 sends the target.
 * Four straps at P1.16 ... P1.19 have its number. AHEAD: its schedule names the tasks that send (none of every slot).
 * FILTER: its acceptance filter lets only the target through. */
#include <ranger_sim/firmware.h>

#define ENCODER_A FW_P0(22) /* CAP0.0 */
#define ENCODER_B FW_P0(27)
#define STRAPS 16
#define BTR_1_MBIT 0x001A4003u /* at 60 MHz: 15 quanta of 4 clocks, sampled at 80 % */
#define TARGET 0x10u
#define RATE 0x20u
#define ANGLE 0x40u
#define PWM_PERIOD 3000

static uint32_t node, ms;
static int32_t edges, edges_before, rate, target, duty, integral;

static int32_t on_edge(void)
{
    edges += fw_pin(ENCODER_A) == fw_pin(ENCODER_B) ? -1 : 1;
    fw_timer_clear_IR(0, FW_IR_CR(0));
    return 0;
}

static int32_t on_frame(void)
{
    fw_can_frame frame;
    fw_can_read(1, &frame);
    fw_can_release(1);
    if (frame.ID == TARGET)
        target = (int32_t)frame.DA;
    return 0;
}

static int32_t observe(void)
{
    if (ms++ == 0)
        for (uint32_t bit = 0; bit < 4; bit++)
            node |= fw_pin(FW_P1(STRAPS + bit)) << bit;
    rate += (1000 * (edges - edges_before) - rate) / 16;
    edges_before = edges;
    return 0;
}

static int32_t control(void)
{
    int32_t error = target - rate;
    integral += error / 64;
    integral = integral > PWM_PERIOD ? PWM_PERIOD : integral < -PWM_PERIOD ? -PWM_PERIOD : integral;
    duty = error + integral;
    duty = duty > PWM_PERIOD ? PWM_PERIOD : duty < -PWM_PERIOD ? -PWM_PERIOD : duty;
    fw_pwm_write(duty > 0 ? (uint32_t)duty : 0, duty < 0 ? (uint32_t)-duty : 0);
    return 0;
}

static void send(uint32_t id, uint32_t word)
{
    fw_can_frame frame = {FW_CAN_EIGHT_BYTES, id, word, ms};
    fw_can_transmit(1, 1, &frame);
}

static int32_t send_rate(void)
{
    send(node ? RATE + node : TARGET, node ? (uint32_t)rate : ms < 1000 ? 300 : 600);
    return 0;
}

static int32_t send_angle(void)
{
    if (node)
        send(ANGLE + node, (uint32_t)edges);
    return 0;
}

static const fw_task every[] = {
    {observe, "observe", 900, 1200},
    {control, "control", 900, 1200},
};
static const fw_task row0[] = {{send_rate, "rate", 260, 400}};
static const fw_task row2[] = {{send_angle, "angle", 260, 400}};
static const fw_tasks rows[] = {FW_TASKS(row0), {NULL, 0}, FW_TASKS(row2), {NULL, 0}, {NULL, 0}};
static const fw_schedule schedule = {
    .slot_ns = 1000000,
    .tick_cost = 60,
    .tick_vic_slot = 4,
    .every = FW_TASKS(every),
    .rows = rows,
    .row_count = 5,
    .flags = AHEAD ? FW_TRANSMITTERS_NAMED : 0,
};
static const fw_interrupt interrupts[] = {
    {FW_PIN_EDGE, ENCODER_A, on_edge, "on_edge", 90, 0, FW_FIQ, FW_USUAL_LATENCY},
    {FW_CAN_RX, 1, on_frame, "on_frame", 180, 0, 0, FW_USUAL_LATENCY},
};

#if FILTER
static const fw_can_range accepted[] = {FW_CAN_ONE(1, TARGET)};
#endif

void firmware_start(void)
{
    fw_timer_start(0, 0xFFFFFFFFu, 0);
    fw_capture_connect(0, 0, ENCODER_A);
    fw_timer_write_CCR(0, FW_CCR_RISING(0) | FW_CCR_FALLING(0) | FW_CCR_INTERRUPT(0));
    fw_pwm_start(PWM_PERIOD);
    fw_can_start(1, BTR_1_MBIT, FW_ICR_RI);
#if FILTER
    fw_can_accept(accepted, 1);
#endif
    fw_attach(&interrupts[0]);
    fw_attach(&interrupts[1]);
}

const fw_schedule *firmware_schedule(void) { return &schedule; }
