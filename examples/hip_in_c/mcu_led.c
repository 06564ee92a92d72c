#include "mcu_led.h"

#include <ranger_sim/firmware.h>

#include "mch_table.h"
#include "network_time.h"

#define FIRST_PIN FW_P1(23) /* green, red, blue; active low */
#define SLOTS_PER_MS (1000 / MCH_SLOT_US)
#define ALWAYS (-1)
#define HEARTBEAT_MS 50
#define HEARTBEAT_BIT 8 /* of the network time */

static int32_t remaining[LEDS]; /* slots until it goes out */
static uint32_t lit;
static uint32_t last_bit;

static void set_remaining(enum led led, int32_t slots)
{
    const uint32_t bit = 1u << led;
    remaining[led] = slots;
    if (slots != 0) {
        if (!(lit & bit)) {
            lit |= bit;
            fw_pin_write(FIRST_PIN + led, 0);
        }
    } else if (lit & bit) {
        lit &= ~bit;
        fw_pin_write(FIRST_PIN + led, 1);
    }
}

void led_flash(enum led led, int32_t ms) { set_remaining(led, ms * SLOTS_PER_MS); }
void led_on(enum led led) { set_remaining(led, ALWAYS); }
void led_off(enum led led) { set_remaining(led, 0); }

int32_t mcu_led_update(void)
{
    int led;
    if (lit == 0)
        return 0;
    for (led = 0; led < LEDS; led++)
        if (remaining[led] > 0 && --remaining[led] == 0)
            set_remaining((enum led)led, 0);
    return 0;
}

int32_t heartbeat_beat(void)
{
    const uint32_t bit = network_time_ms() >> HEARTBEAT_BIT & 1u;
    if (bit != last_bit) {
        last_bit = bit;
        if (bit)
            led_flash(LED_BLUE, HEARTBEAT_MS);
    }
    return 0;
}
