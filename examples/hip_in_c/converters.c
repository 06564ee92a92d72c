#include "converters.h"

#include <ranger_sim/firmware.h>

#include "error_module.h"
#include "fixed.h"
#include "mch_table.h"

#define CLKDIV 200u                /* 60 MHz / 200: 36.7 us for a conversion */
#define BATTERY_VOLTAGE_CHANNEL 1u /* AIN1, P0.28 */

/* The sequence: motor current on inputs 4-5, battery current on 2-3, both times 2. */
enum { MOTOR_CURRENT, BATTERY_CURRENT, ENTRIES };
static const uint32_t sequence[ENTRIES] = {
    [MOTOR_CURRENT] = FW_ADS7871_REGISTER4(2, 1),
    [BATTERY_CURRENT] = FW_ADS7871_REGISTER4(1, 1),
};
/* From the handler's start to its next start word, after two registers were read over the SSP. */
#define RESTART_NS 2500u

#define MOTOR_GAIN 0.00154 /* A per count */
#define MOTOR_OFFSET (-9)
#define BATTERY_GAIN 0.000506
#define BATTERY_OFFSET (-4)
#define VOLTAGE_GAIN 0.0323 /* V per count */

static volatile int32_t results[ENTRIES];
static volatile uint32_t step;
static volatile int32_t converting;

void converters_start(void)
{
    fw_adcx_start_ssp();
    fw_adc_start_clock(CLKDIV);
}

int32_t adcx_convert_all(void)
{
    if (converting) {
        error_report(ERR_ADCX_DNF);
        return 0;
    }
    step = 0;
    converting = 1;
    if (!fw_adcx_write(sequence[0], 0)) {
        converting = 0;
        error_report(ERR_ADCX_DNF);
    }
    return 0;
}

int32_t adcx_busy_fell(void)
{
    results[step] = fw_adcx_result();
    if (step + 1u < ENTRIES) {
        step++;
        fw_adcx_write(sequence[step], RESTART_NS);
    } else {
        step = 0;
        converting = 0;
    }
    return 0;
}

int32_t adcx_sequence_done(void) { return !converting; }

int32_t adci_convert_all(void)
{
    if (!fw_adc_start(BATTERY_VOLTAGE_CHANNEL))
        error_report(ERR_ADCI_DNF);
    return 0;
}

int32_t adci_done(void) { return 0; }

static int32_t motor_counts(void) { return results[MOTOR_CURRENT] - MOTOR_OFFSET; }
static int32_t battery_counts(void) { return results[BATTERY_CURRENT] - BATTERY_OFFSET; }

int32_t motor_current_fixed(void) { return -motor_counts() * FIXED(MOTOR_GAIN); }
float motor_current(void) { return -(float)MOTOR_GAIN * (float)motor_counts(); }
float battery_current(void) { return (float)BATTERY_GAIN * (float)battery_counts(); }
float battery_voltage(void) { return (float)VOLTAGE_GAIN * (float)fw_adc_result(); }

float battery_power(void)
{
    /* the whole numbers first, then once the product of the gains */
    const int32_t counts = (int32_t)fw_adc_result() * battery_counts();
    return (float)VOLTAGE_GAIN * (float)BATTERY_GAIN * (float)counts;
}
