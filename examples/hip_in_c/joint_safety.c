#include "joint_safety.h"

#include "absolute_encoder.h"
#include "current_control.h"
#include "mcu_led.h"

#define LIMIT_COUNTS 800 /* 0.614 rad */
#define FLASH_MS 100

int32_t joint_safety_check(void)
{
    const int32_t counts = absolute_encoder_counts();
    const int high = counts > LIMIT_COUNTS;
    const int low = counts < -LIMIT_COUNTS;
    if (high)
        led_flash(LED_RED, FLASH_MS);
    else if (low)
        led_flash(LED_GREEN, FLASH_MS);
    current_control_block(high, low);
    return 0;
}
