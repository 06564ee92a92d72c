/* The ExampleBoard of firmware_sim/README.md, line by line. */
#include <ranger_sim/firmware.h>

#define ENCODER_A FW_P0(22)
#define ENCODER_B FW_P0(27)

static struct {
    int32_t count;
    fw_can_frame frames[64];
    int32_t frames_waiting;
    int32_t results[2];
    int converting;
    int step;
} board;

static int32_t on_edge(void)
{
    board.count += fw_pin(ENCODER_A) == fw_pin(ENCODER_B) ? -1 : 1;
    fw_timer_clear_IR(0, FW_IR_CR(0));
    return 0;
}

static int32_t on_frame(void)
{
    fw_can_read(1, &board.frames[board.frames_waiting++ & 63]);
    fw_can_release(1);
    return 0;
}

static const uint32_t sequence[] = {FW_ADS7871_REGISTER4(2, 1), FW_ADS7871_REGISTER4(0, 0)};

static int32_t on_busy(void)
{
    board.results[board.step] = fw_adcx_result();
    board.step++;
    if (board.step < 2)
        fw_adcx_write(sequence[board.step], 2500); /* behind the handler's own way to here */
    else
        board.converting = 0;
    return 0;
}

static int32_t start_sequence(void)
{
    if (!board.converting && fw_adcx_write(sequence[0], 0)) {
        board.converting = 1;
        board.step = 0;
    }
    return 0;
}

static int32_t receive_all(void)
{
    int32_t handled = board.frames_waiting;
    board.frames_waiting = 0;
    return handled;
}

static int32_t sequence_done(void) { return !board.converting; }

static int32_t control(void)
{
    int32_t magnitude = board.results[0] < 0 ? -board.results[0] : board.results[0];
    fw_pwm_write(magnitude < 600 ? (uint32_t)magnitude : 600, 0);
    return 0;
}

static int32_t send_count(void)
{
    fw_can_frame frame = {FW_CAN_EIGHT_BYTES, 0x14, (uint32_t)board.count, 0};
    fw_can_transmit(1, 1, &frame);
    return 0;
}

static const fw_task every[] = {
    /* function      name              cost limit per_item item */
    {start_sequence, "start_sequence", 300, 400, 0, NULL},
    {receive_all, "receive_all", 50, 2500, 90, "frame"},
    {sequence_done, "wait", 10, 0, 0, NULL, .kind = FW_WAIT},
    {control, "control", 900, 1000, 0, NULL},
};
static const fw_task row0[] = {{send_count, "send_count", 260, 0, 0, NULL}};
static const fw_tasks rows[] = {FW_TASKS(row0), {NULL, 0}};
static const fw_schedule schedule = {
    .slot_ns = 500000,
    .tick_cost = 60,
    .tick_vic_slot = 4,
    .every = FW_TASKS(every),
    .rows = rows,
    .row_count = 2,
};

static const fw_interrupt interrupts[] = {
    {FW_PIN_EDGE, ENCODER_A, on_edge, "on_edge", 150, 0, FW_FIQ, FW_USUAL_LATENCY},
    {FW_CAN_RX, 1, on_frame, "on_frame", 90, 0, 0, FW_USUAL_LATENCY},
    {FW_EXTERNAL_INTERRUPT, 1, on_busy, "on_busy", 200, 0, 1, FW_USUAL_LATENCY},
};

void firmware_start(void)
{
    fw_timer_start(0, 30000, 0);
    fw_capture_connect(0, 0, ENCODER_A);
    fw_timer_write_CCR(0, FW_CCR_RISING(0) | FW_CCR_FALLING(0) | FW_CCR_INTERRUPT(0));
    fw_adcx_start_ssp();
    fw_can_start(1, 0x00254001, FW_ICR_RI);
    fw_pwm_start(600);
    for (size_t i = 0; i < sizeof interrupts / sizeof interrupts[0]; i++)
        fw_attach(&interrupts[i]);
}

const fw_schedule *firmware_schedule(void) { return &schedule; }
