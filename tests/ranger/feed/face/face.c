/* Two lines, six lights, a tone, lights beside the processor; what keys and radio do is told on the bus. */
#include <ranger_sim/firmware.h>

#include "ui_table.h"

#define CONTROLLER 2u
#define BTR_3_MBIT_S 0x00254001u
#define SELECT FW_P0(20)
#define ENABLE (1u << 11)
#define READ (1u << 10)
#define DATA (1u << 15)
#define SYNC_LIGHT FW_P0(16)
#define GREEN_LED FW_P1(23)
#define RED_LED FW_P1(24)
#define BLUE_LED FW_P1(25)
#define RADIO FW_P0(22)
#define RADIO_PERIOD 600000u
#define CLOCK_HZ 60000000u
#define KEYS 6u
#define LETTERS 19u

static const uint32_t key_pins[KEYS] = {FW_P1(18), FW_P0(12), FW_P0(13), FW_P0(28), FW_P1(16), FW_P0(30)};
/* bytes for the display, commands with bit 8 */
static const uint16_t letters[LETTERS] = {
    0x138, 0x10C, 'C', ' ', 'd', 'r', 'i', 'v', 'e', 's', 0x1C0, 't', 'h', 'i', 's', ' ', 'f', 'a', 'c',
};

static uint32_t slots;
static uint32_t keys;
static uint32_t rose;
static uint32_t width;

/* --- display --- */

static void write_display(uint32_t is_data, uint32_t byte)
{
    if (is_data)
        fw_IOSET(0, DATA);
    else
        fw_IOCLR(0, DATA);
    fw_IOCLR(0, READ);
    fw_IOSET(0, ENABLE);
    fw_IOCLR(0, ~byte & 0xFFu);
    fw_IOSET(0, byte & 0xFFu);
    fw_IOCLR(0, ENABLE);
}

static int32_t write_letter(void)
{
    if (slots < LETTERS)
        write_display(!(letters[slots] & 0x100u), letters[slots] & 0xFFu);
    slots++;
    return 0;
}

/* --- lights --- */

static void write_lights(uint32_t far, uint32_t near)
{
    fw_pin_write(SELECT, 0);
    fw_ssp_word(far);
    fw_ssp_word(near);
    fw_pin_write(SELECT, 1);
}

/* Light l is 0x10 + l red, 0x20 + l green, 0x30 + l blue. */
static void start_lights(void)
{
    uint32_t light;
    fw_pin_write(SELECT, 1);
    fw_ssp_start_words(16, 4);
    write_lights(0x1001, 0x1001);
    for (light = 0; light < 3; light++) {
        const uint32_t port = 3u * light;
        write_lights((port << 8) | (0x33u + light), (port << 8) | (0x30u + light));
        write_lights(((port + 1u) << 8) | (0x23u + light), ((port + 1u) << 8) | (0x20u + light));
        write_lights(((port + 2u) << 8) | (0x13u + light), ((port + 2u) << 8) | (0x10u + light));
    }
}

/* --- buzzer, keys --- */

static void sound(uint32_t hertz)
{
    fw_pwm_write_MR(0, CLOCK_HZ / hertz);
    fw_pwm_write_MR(5, CLOCK_HZ / hertz / 2u);
    fw_pwm_latch(1u << 0 | 1u << 5);
}

/* 440 Hz, with key 2 880 Hz; key 5 is silent, and lights the sync light. */
static int32_t look_at_keys(void)
{
    uint32_t now = 0;
    uint32_t key;
    for (key = 0; key < KEYS; key++)
        now |= fw_pin(key_pins[key]) << key;
    if (now == keys)
        return 0;
    keys = now;
    fw_pin_write(SYNC_LIGHT, !(keys & 1u << 5));
    if (keys & 1u << 5) {
        fw_pwm_write_MR(5, 0);
        fw_pwm_latch(1u << 5);
    } else {
        sound(keys & 1u << 2 ? 880 : 440);
    }
    return 0;
}

/* --- radio --- */

static int32_t measure(void)
{
    const uint32_t now = fw_timer_CR(0, 0);
    if (fw_pin(RADIO))
        rose = now;
    else
        width = now >= rose ? now - rose : now + RADIO_PERIOD - rose;
    fw_timer_clear_IR(0, FW_IR_CR(0));
    return 0;
}

static const fw_interrupt radio_edge = {
    .kind = FW_PIN_EDGE, .index = RADIO, .handler = measure, .name = "radio", .cost = 100, .vic_slot = 2,
    .latency = FW_USUAL_LATENCY,
};

/* --- the bus --- */

static void send(uint32_t identifier, uint32_t value)
{
    const fw_can_frame frame = {FW_CAN_EIGHT_BYTES, identifier, value, slots};
    fw_can_transmit(CONTROLLER, 1, &frame);
}

static uint32_t word_of(float value)
{
    union {
        float value;
        uint32_t word;
    } both;
    both.value = value;
    return both.word;
}

static int32_t send_keys(void)
{
    send(UI_BUTTONS, keys);
    return 0;
}

static int32_t send_radio(void)
{
    send(UI_RC_0, word_of((float)width));
    return 0;
}

/* --- the whole --- */

static const fw_task every[] = {
    {write_letter, "write_letter", 300, 0},
    {look_at_keys, "look_at_keys", 300, 0},
};
static const fw_task row0[] = {{send_keys, "send_keys", 300, 0}};
static const fw_task row1[] = {{send_radio, "send_radio", 300, 0}};
static const fw_tasks rows[] = {FW_TASKS(row0), FW_TASKS(row1)};
static const fw_schedule schedule = {
    .slot_ns = 1000000,
    .tick_cost = 60,
    .tick_vic_slot = 1,
    .every = FW_TASKS(every),
    .rows = rows,
    .row_count = 2,
};

void firmware_start(void)
{
    fw_pin_write(SYNC_LIGHT, 1);
    fw_pin_write(RED_LED, 1);
    fw_pin_write(GREEN_LED, 0);
    fw_pin_write(BLUE_LED, 0);
    start_lights();
    fw_pwm_start(CLOCK_HZ / 440u);
    sound(440);
    fw_timer_start(0, RADIO_PERIOD, 0);
    fw_capture_connect(0, 0, RADIO);
    fw_timer_write_CCR(0, FW_CCR_RISING(0) | FW_CCR_FALLING(0) | FW_CCR_INTERRUPT(0));
    fw_attach(&radio_edge);
    fw_can_start(CONTROLLER, BTR_3_MBIT_S, 0);
}

const fw_schedule *firmware_schedule(void) { return &schedule; }
uint32_t firmware_table_version(void) { return RANGER_TABLE_VERSION; }
