/* The schedule on the chip: a timer steps from row to row, the main loop runs what the row lists; or the program's own
 * main loop. Costs and limits are those of a model and stand aside here: cycles pass by themselves. */
#include "chip.h"
#include "registers.h"

void firmware_main(void) __attribute__((weak));
const fw_schedule *firmware_schedule(void) __attribute__((weak));

/* Of 60 MHz, from reset to the start of the timer in startup.S: mostly the PLL's lock, of which the user manual only says
 * that a program has to wait for it. Measured on the simulated chip, whose PLL locks in 100 us. */
#define CYCLES_BEFORE 6750u

volatile struct chip_slot_record chip_slots;

static const fw_schedule *table;
static volatile uint32_t row;    /* that the latest tick chose */
static volatile uint32_t done;   /* the main loop has finished it */
static uint32_t ticks;           /* of the divider */
static uint32_t next_occasional;

/* --- time --- */

void chip_wait_until(uint32_t after_ns)
{
    const uint32_t cycles = after_ns / 1000u * CYCLES_PER_US + after_ns % 1000u * CYCLES_PER_US / 1000u;
    while (TxTC(SLOT_TIMER) + CYCLES_BEFORE < cycles)
        ;
}

void fw_spend(uint32_t cycles) { (void)cycles; }
void fw_idle(void) { PCON = PCON_IDLE; }
uint32_t fw_slot_cycles(void) { return TxTC(SLOT_TIMER); }

uint32_t fw_cycles(void)
{
    uint32_t before;
    uint32_t count;
    if (table == NULL)
        return TxTC(SLOT_TIMER) + CYCLES_BEFORE;
    do {
        before = chip_slots.slots;
        count = TxTC(SLOT_TIMER);
    } while (before != chip_slots.slots);
    return before * (table->slot_ns / 1000u * CYCLES_PER_US) + count;
}

/* --- slots --- */

/* The timer's interrupt: the next row. */
static int32_t tick(void)
{
    TxIR(SLOT_TIMER) = FW_IR_MR0;
    if (table->on_tick != NULL)
        table->on_tick();
    if (++ticks < (table->divider ? table->divider : 1u))
        return 0;
    ticks = 0;
    if (!done) {
        chip_slots.overruns++;
        if (table->on_overrun != NULL && !(table->flags & FW_NO_COMPLETION_FLAG))
            table->on_overrun();
    }
    done = 0;
    row = row + 1u < table->row_count ? row + 1u : 0;
    chip_slots.slots++;
    return 0;
}

/* One entry of the occasional list per pass. */
static void run_occasional(void)
{
    const fw_tasks *list = &table->occasional;
    if (next_occasional >= list->count) {
        next_occasional = 0;
        if (!(table->flags & FW_NO_IDLE_CALL))
            return;
    }
    list->tasks[next_occasional++].function();
}

/* The tasks of a list, up to a tick; 0 when one came. */
static int run_list(const fw_tasks *list, uint32_t slot)
{
    const fw_task *task = list->tasks;
    const fw_task *const end = task + list->count;
    for (; task != end; task++) {
        if (chip_slots.slots != slot) {
            chip_slots.dropped += (uint32_t)(end - task);
            return 0;
        }
        if (task->kind == FW_WAIT) {
            while (!task->function())
                ;
        } else {
            task->function();
        }
    }
    return chip_slots.slots == slot;
}

static void run_slot(uint32_t slot)
{
    uint32_t cycles;
    const uint32_t now = row;
    if (!run_list(&table->every, slot))
        return;
    if (table->row_count > 0 && !run_list(&table->rows[now], slot))
        return;
    if (table->occasional.count > 0 && now == table->occasional_row)
        run_occasional();
    if (!run_list(&table->last, slot))
        return;
    cycles = TxTC(SLOT_TIMER);
    done = 1;
    chip_slots.last_cycles = cycles;
    chip_slots.total_cycles += cycles;
    if (cycles > chip_slots.most_cycles)
        chip_slots.most_cycles = cycles;
    if (table->on_near_limit != NULL && cycles > table->slot_ns / 1000u * CYCLES_PER_US / 10u * 9u)
        table->on_near_limit();
}

void chip_run_schedule(const fw_schedule *schedule)
{
    const uint32_t period = schedule->slot_ns / 1000u * CYCLES_PER_US / (schedule->divider ? schedule->divider : 1u);
    uint32_t i;
    for (i = 0; i < schedule->step_count; i++) {
        chip_wait_until(schedule->steps[i].after_ns);
        schedule->steps[i].function();
    }
    row = schedule->row_count ? schedule->row_count - 1u : 0; /* the first tick chooses row 0 */
    done = 1;
    ticks = schedule->divider ? schedule->divider - 1u : 0;
    chip_attach_slot_timer(tick, schedule->tick_vic_slot);
    chip_wait_until(schedule->first_slot_ns);
    table = schedule;
    TxTCR(SLOT_TIMER) = TCR_RESET;
    TxMR0(SLOT_TIMER) = period - 1u;
    TxMCR(SLOT_TIMER) = MCR_MR0_INTERRUPT | MCR_MR0_RESET;
    TxIR(SLOT_TIMER) = 0xFFu;
    TxTCR(SLOT_TIMER) = 0;
    TxTC(SLOT_TIMER) = period - 1u; /* the first slot begins at once */
    TxTCR(SLOT_TIMER) = TCR_ENABLE;
    for (;;)
        if (!done)
            run_slot(chip_slots.slots); /* looked at after `done`, which a tick clears before it counts */
}

__attribute__((used)) void chip_main(void);
void chip_main(void)
{
    chip_begin();
    firmware_start();
    chip_interrupts_on();
    if (firmware_schedule)
        chip_run_schedule(firmware_schedule());
    else if (firmware_main)
        firmware_main();
}
