/* The three LEDs beside the processor, and the heartbeat. */
#ifndef MCU_LED_H
#define MCU_LED_H

#include <stdint.h>

enum led { LED_GREEN, LED_RED, LED_BLUE, LEDS };

/* Light for `ms` from now; a running flash starts anew. */
void led_flash(enum led led, int32_t ms);
void led_on(enum led led);
void led_off(enum led led);
/* Task of every slot: advance the timers. */
int32_t mcu_led_update(void);
/* Task of every slot: the blue one flashes when bit 8 of the network time rises, so every 512 ms. */
int32_t heartbeat_beat(void);

#endif
