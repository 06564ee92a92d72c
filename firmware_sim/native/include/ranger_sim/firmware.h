/* What firmware in C calls, and what it offers: a thin layer over the devices of an LPC2194 and of what hangs on it.
 *
 * One source, two builds. For this computer `ranger-sim firmware build` compiles it with an implementation that leads
 * to the simulator's models of the devices; for the chip it is compiled with one that reads and writes the registers
 * named here. Nothing here could not be done on the chip, but for CAN FD, which needs another one.
 *
 * How time passes. With a schedule: a task or an interrupt handler takes effect at its start; then the processor is
 * busy for its cost, per_item times what it returned, and what it gave to fw_spend. With a main loop of its own: only
 * fw_spend and fw_idle let time pass. On the chip time passes by itself, and fw_spend is empty.
 *
 * C99. No allocation, no threads. All state is static and starts from its initial values at power-up.
 */
#ifndef RANGER_SIM_FIRMWARE_H
#define RANGER_SIM_FIRMWARE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Counts up when a program that was written for an older header would not work as before. */
#define FW_VERSION 1u

/* --- what the compiler must be ---------------------------------------------------------------------------------------
 * int has 32 bits here as on the ARM7. long and pointers have 32 bits there and mostly 64 on this computer: the build
 * says which (FW_LONG_BITS, FW_POINTER_BITS; without it, what the chip has), and a compiler that has others stops here.
 * A program that needs them to be as on the chip says so by FW_NEEDS_32_BIT_LONG or FW_NEEDS_32_BIT_POINTERS. */
#ifndef FW_LONG_BITS
#define FW_LONG_BITS 32
#endif
#ifndef FW_POINTER_BITS
#define FW_POINTER_BITS 32
#endif
typedef char fw_a_char_must_have_8_bits[(unsigned char)-1 == 255 ? 1 : -1];
typedef char fw_a_short_must_have_16_bits[sizeof(short) == 2 ? 1 : -1];
typedef char fw_an_int_must_have_32_bits[sizeof(int) == 4 ? 1 : -1];
typedef char fw_a_long_long_must_have_64_bits[sizeof(long long) == 8 ? 1 : -1];
typedef char fw_a_float_must_have_32_bits[sizeof(float) == 4 ? 1 : -1];
typedef char fw_a_double_must_have_64_bits[sizeof(double) == 8 ? 1 : -1];
typedef char fw_long_is_not_of_FW_LONG_BITS[sizeof(long) * 8 == FW_LONG_BITS ? 1 : -1];
typedef char fw_pointers_are_not_of_FW_POINTER_BITS[sizeof(void *) * 8 == FW_POINTER_BITS ? 1 : -1];
#ifdef FW_NEEDS_32_BIT_LONG
typedef char fw_this_program_needs_a_long_of_32_bits[sizeof(long) == 4 ? 1 : -1];
#endif
#ifdef FW_NEEDS_32_BIT_POINTERS
typedef char fw_this_program_needs_pointers_of_32_bits[sizeof(void *) == 4 ? 1 : -1];
#endif

/* --- what the firmware offers ----------------------------------------------------------------------------------------
 * firmware_start and one of firmware_schedule and firmware_main. */

/* A task or a handler: does its work and returns how many items it handled (0 where nothing is counted). As a FW_WAIT
 * task: returns 0 while it has to spin. */
typedef int32_t (*fw_work)(void);
/* What is called for its effect only. */
typedef void (*fw_call)(void);

enum fw_kind {
    FW_TASK = 0, /* runs to its end */
    FW_WAIT = 1  /* spins until its function returns other than 0; asked at its start and after every interrupt */
};

/* One line of the schedule. Cycles of a call: cost + per_item * items + what it spends. limit 0: held against none. */
typedef struct fw_task {
    fw_work function;
    const char *name;
    uint32_t cost;
    uint32_t limit;
    uint32_t per_item;
    const char *item;   /* what is counted ("frame"), or NULL */
    enum fw_kind kind;  /* left out: FW_TASK */
    int32_t transmits;  /* counts only with FW_TRANSMITTERS_NAMED: this task of every slot may send on a bus */
} fw_task;

typedef struct fw_tasks {
    const fw_task *tasks;
    uint32_t count;
} fw_tasks;

/* FW_TASKS(an array of fw_task): for the fields below. */
#define FW_TASKS(array) { (array), sizeof(array) / sizeof((array)[0]) }

/* A step of the start-up, before the first slot: `function` runs `after_ns` after power-up. On the chip the start-up
 * waits so long for its sensors; here nothing else of the program runs meanwhile but interrupt handlers. */
typedef struct fw_step {
    uint32_t after_ns;
    fw_call function;
} fw_step;

enum fw_schedule_flags {
    FW_TRANSMITTERS_NAMED = 1, /* only tasks of rows, of the occasional list, and those with `transmits` send on a bus;
                                  no interrupt handler does. Lets the rest of the robot run ahead, changes nothing */
    FW_NO_COMPLETION_FLAG = 2, /* an overrun drops tasks but calls nobody */
    FW_NO_IDLE_CALL = 4       /* n occasional tasks come round every n calls, not every n + 1 */
};

/* When what runs. A slot runs `every`, then its row, then `last`. A tick that finds the row unfinished is an overrun:
 * the running task is completed, the rest of the row is dropped. Fields left out are 0 and mean what is told. */
typedef struct fw_schedule {
    uint32_t slot_ns;
    uint32_t divider;          /* timer ticks per slot; 0: 1 */
    uint32_t tick_cost;        /* cycles of the timer's interrupt */
    int32_t tick_vic_slot;     /* FW_FIQ or 0 ... 15 */
    uint32_t flags;            /* of fw_schedule_flags */
    uint32_t first_slot_ns;    /* after power-up */
    fw_tasks every;
    const fw_tasks *rows;
    uint32_t row_count;        /* 0: one empty row */
    fw_tasks last;
    fw_tasks occasional;       /* one of them per pass through the rows, at the end of row `occasional_row` */
    uint32_t occasional_row;
    uint32_t occasional_cost;  /* of choosing, per call */
    uint32_t occasional_limit;
    const fw_step *steps;
    uint32_t step_count;
    fw_call on_tick;           /* in every interrupt of the slot timer, or NULL; the others likewise */
    fw_call on_overrun;        /* a tick found the row unfinished */
    fw_call on_limit;          /* a task took more than its limit */
    fw_call on_near_limit;     /* a slot took more than 90 % of its length */
} fw_schedule;

/* From reset: set up the devices, attach the interrupts. Not inlined: a debugger finds it by its name. */
__attribute__((noinline)) void firmware_start(void);
/* The schedule, asked for once after firmware_start; it must stay where it is. */
const fw_schedule *firmware_schedule(void);
/* Or, instead of a schedule: the main loop. It is not expected to return. */
void firmware_main(void);
/* Optional: the version of the master table that the program was compiled with (RANGER_TABLE_VERSION of ranger_table.h).
 * The loader refuses another one than its own. */
uint32_t firmware_table_version(void);

/* Optional, for reports and tests, as a debugger would read it; no part of the program calls them. */
typedef struct fw_error_counts {
    const uint32_t *counts; /* how often each error was noted since power-up, by its number in the master table */
    uint32_t count;         /* numbers 0 ... count - 1 */
} fw_error_counts;
const fw_error_counts *firmware_errors(void);
/* The robot's time as the program has it, ms. */
uint32_t firmware_time_ms(void);

/* --- interrupts ------------------------------------------------------------------------------------------------------
 * A source is one line into the vectored interrupt controller, named by kind and index. */
enum fw_interrupt_kind {
    FW_PIN_EDGE = 1,            /* index: pin whose capture asks */
    FW_CAN_RX = 2,              /* index: CAN controller 1 ... 4; a frame waits */
    FW_CAN_TX_DONE = 3,         /* a transmit buffer has ended (of those that CxIER lets) */
    FW_CAN_STATUS = 4,          /* errors and data overruns (of those that CxIER lets) */
    FW_UART_BYTE = 5,           /* index: UART */
    FW_SSP_SEGMENT = 6,         /* index: SSP; the exchange is through */
    FW_TIMER_MATCH = 64,        /* index: timer; it matched MR0 and restarted */
    FW_EXTERNAL_INTERRUPT = 65, /* index: EINT; the external converter's BUSY fell */
    FW_ADC_DONE = 66,           /* index 0: the internal converter */
    FW_SPI_DONE = 67,           /* index: SPI */
    FW_UART_TRANSMIT = 68,      /* index: UART; its transmit FIFO is empty */
    FW_SOFTWARE = 70            /* index free: VICSoftInt */
};

#define FW_FIQ (-1)           /* VIC slot: the fast interrupt */
#define FW_USUAL_LATENCY (-1) /* 12 cycles for FW_FIQ, 25 for a slot */

typedef struct fw_interrupt {
    enum fw_interrupt_kind kind;
    uint32_t index;
    fw_work handler;    /* takes effect at its start, which is `latency` after the processor is free for it */
    const char *name;
    uint32_t cost;      /* cycles beside the latency */
    uint32_t per_item;
    int32_t vic_slot;   /* FW_FIQ, or 0 ... 15 for one source each, 0 first */
    int32_t latency;    /* cycles, or FW_USUAL_LATENCY */
} fw_interrupt;

/* Enable a source. A second call for the same source takes the place of the first. */
void fw_attach(const fw_interrupt *interrupt);
/* Disable it; a request that waits is forgotten. */
void fw_detach(enum fw_interrupt_kind kind, uint32_t index);
/* Raise it by software. */
void fw_request(enum fw_interrupt_kind kind, uint32_t index);
/* From fw_lock to fw_unlock no handler runs, the fast interrupt neither: for a few lines on what both sides change.
 * They nest; fw_unlock gets what fw_lock returned. Here a task or handler takes effect at one instant anyhow. */
uint32_t fw_lock(void);
void fw_unlock(uint32_t state);

/* --- time ------------------------------------------------------------------------------------------------------------
 */
/* These core cycles pass: added to the task or handler that runs, or, in a main loop, they pass now. */
void fw_spend(uint32_t cycles);
/* In a main loop: sleep until an interrupt or a device has done something (PCON idle mode). */
void fw_idle(void);
/* Core cycles since the slot timer's latest match: its count register. */
uint32_t fw_slot_cycles(void);
/* Core cycles since power-up, modulo 2^32: a free-running timer. */
uint32_t fw_cycles(void);

/* --- pins (IOPIN, IOSET, IOCLR): P0.n is pin n, P1.n is pin 32 + n ---------------------------------------------------
 */
#define FW_P0(bit) (bit)
#define FW_P1(bit) (32 + (bit))
uint32_t fw_pin(uint32_t pin);
void fw_pin_write(uint32_t pin, uint32_t level);
void fw_pin_toggle(uint32_t pin);
uint32_t fw_IOPIN(uint32_t port);
void fw_IOSET(uint32_t port, uint32_t mask);
void fw_IOCLR(uint32_t port, uint32_t mask);

/* --- timers with capture channels (TxMR0, TxCCR, TxCR0 ... TxCR3, TxIR, TxTC) ----------------------------------------
 */
#define FW_IR_MR0 0x1u                           /* TxIR: the match that restarts the timer */
#define FW_IR_CR(channel) (0x10u << (channel))   /* TxIR: a capture of the channel */
#define FW_CCR_RISING(channel) (1u << 3 * (channel))
#define FW_CCR_FALLING(channel) (2u << 3 * (channel))
#define FW_CCR_INTERRUPT(channel) (4u << 3 * (channel))
/* The timer counts 0 ... period - 1 core cycles and starts again, from power-up on; each restart may ask for
 * (FW_TIMER_MATCH, timer). */
void fw_timer_start(uint32_t timer, uint32_t period, uint32_t match_interrupt);
/* Connect a pin to a capture channel 0 ... 3 (PINSEL). Which edges it captures, TxCCR says. Edges at the pin ask for
 * (FW_PIN_EDGE, pin). */
void fw_capture_connect(uint32_t timer, uint32_t channel, uint32_t pin);
uint32_t fw_timer_CCR(uint32_t timer);
void fw_timer_write_CCR(uint32_t timer, uint32_t value);
uint32_t fw_timer_CR(uint32_t timer, uint32_t channel);
uint32_t fw_timer_IR(uint32_t timer);
/* Write TxIR: the bits of `mask` are cleared; the channels may capture again. */
void fw_timer_clear_IR(uint32_t timer, uint32_t mask);
uint32_t fw_timer_TC(uint32_t timer);

/* --- PWM unit (PWMMR0 ... PWMMR6, PWMLER) ----------------------------------------------------------------------------
 */
void fw_pwm_start(uint32_t period);
uint32_t fw_pwm_MR(uint32_t match);
void fw_pwm_write_MR(uint32_t match, uint32_t counts);
/* PWMLER: the match values whose bits are set drive the pins from the next period on. */
void fw_pwm_latch(uint32_t mask);
/* The two leads of a bridge at once: MR2, MR6, and their latches. */
void fw_pwm_write(uint32_t MR2, uint32_t MR6);

/* --- internal converter (ADCR, ADGDR, ADDR0 ... ADDR7), 10 bits ------------------------------------------------------
 */
void fw_adc_start_clock(uint32_t clkdiv); /* power on; a conversion takes 11 * clkdiv core cycles */
/* Start one conversion; its end asks for (FW_ADC_DONE, 0). 0 while one is under way. */
uint32_t fw_adc_start(uint32_t channel);
uint32_t fw_adc_result(void);
/* Convert the channels of `mask` in turn for ever, from the lowest on. */
void fw_adc_burst(uint32_t mask);
uint32_t fw_adc_DR(uint32_t channel);

/* --- external converter ADS7871, signed 14 bits ----------------------------------------------------------------------
 */
#define FW_ADS7871_REGISTER4(channel_code, gain_code) (0x80u | (gain_code) << 4 | (channel_code))
/* The converter hangs on the SSP; nothing else can be called before. */
void fw_adcx_start_ssp(void);
/* Write register 4: bit 7 starts a conversion, whose end asks for (FW_EXTERNAL_INTERRUPT, its EINT). The word is there
 * `later_ns` after the task or handler took effect: what the code before it takes, and the transfers (on the chip they
 * take it). 0, and nothing is written, while a conversion is under way. */
uint32_t fw_adcx_write(uint32_t register4, uint32_t later_ns);
uint32_t fw_adcx_busy(void);
/* Registers 1 and 0: -8192 ... 8191. */
int32_t fw_adcx_result(void);

/* --- SPI master with an absolute encoder (S0SPDR, S0SPSR) ------------------------------------------------------------
 */
void fw_spi_start(uint32_t number);
/* Write S0SPDR: begin a transfer; its end asks for (FW_SPI_DONE, number). 0 while one is under way. */
uint32_t fw_spi_transfer(uint32_t number);
uint32_t fw_spi_SPSR(uint32_t number);
uint32_t fw_spi_SPDR(uint32_t number);

/* --- SSP as a link of segments of 31 half-words ----------------------------------------------------------------------
 */
#define FW_SEGMENT_WORDS 31
void fw_ssp_start(uint32_t number);
/* Master: exchange this segment from now on. The last word is sent as the checksum that it is meant to be. */
void fw_ssp_exchange(uint32_t number, const uint16_t words[FW_SEGMENT_WORDS]);
/* Slave: send this segment in every exchange from the next one on. */
void fw_ssp_load(uint32_t number, const uint16_t words[FW_SEGMENT_WORDS]);
/* What came in last; 0 when it has been taken already. */
uint32_t fw_ssp_take(uint32_t number, uint16_t words[FW_SEGMENT_WORDS]);

/* --- SSP as a master of words (SSPCR0, SSPCPSR, SSPDR), for what hangs on it and has a select pin ------------------
 */
/* Words of 4 ... 16 bits, the first bit read at the first edge of a clock that is low between words; its rate is the
 * core clock / divider, which is even, 2 ... 512. Nothing else can be started on the SSP then. */
void fw_ssp_start_words(uint32_t bits, uint32_t divider);
/* Send a word, and wait for its end; returns the one that came the other way. The program moves the select pin. (Here
 * it is through at once: bits * divider cycles belong to the cost of the task or handler.) */
uint32_t fw_ssp_word(uint32_t word);

/* --- UARTs, 8N1 (UnRBR, UnTHR, UnLSR, UnIIR, UnDLL and UnDLM as one divisor, UnFDR, UnFCR) ---------------------------
 */
/* baud = core clock / (16 * divisor * (1 + divaddval / mulval)); trigger of the receive FIFO: 1, 4, 8 or 14. */
void fw_uart_start(uint32_t number, uint32_t divisor, uint32_t divaddval, uint32_t mulval, uint32_t trigger);
uint32_t fw_uart_RBR(uint32_t number);
uint32_t fw_uart_THR(uint32_t number, uint32_t byte); /* 0 when the FIFO is full */
uint32_t fw_uart_LSR(uint32_t number);
uint32_t fw_uart_IIR(uint32_t number);

/* --- CAN controllers 1 ... 4 (CxMOD, CxCMR, CxGSR, CxSR, CxICR, CxIER, CxBTR, CxRFS ... CxTDB3) ----------------------
 */
#define FW_CAN_EIGHT_BYTES 0x00080000u /* CxRFS and CxTFI: 8 data bytes, not remote, identifier of 11 bits */
#define FW_CAN_REMOTE 0x40000000u
#define FW_CAN_EXTENDED 0x80000000u
#define FW_CAN_DLC(frame_word) ((frame_word) >> 16 & 15u)

/* CxICR and CxIER */
#define FW_ICR_RI 0x1u
#define FW_ICR_TI1 0x2u
#define FW_ICR_EI 0x4u /* an error counter has passed the warning limit */
#define FW_ICR_DOI 0x8u
#define FW_ICR_EPI 0x20u
#define FW_ICR_ALI 0x40u
#define FW_ICR_BEI 0x80u
#define FW_ICR_TI2 0x200u
#define FW_ICR_TI3 0x400u
#define FW_ICR_ERRDIR 0x200000u /* the bus error came while receiving */

/* CxGSR */
#define FW_GSR_RBS 0x1u
#define FW_GSR_DOS 0x2u
#define FW_GSR_TBS 0x4u
#define FW_GSR_TCS 0x8u
#define FW_GSR_ES 0x40u
#define FW_GSR_BS 0x80u

#define FW_MOD_RESET 0x1u

typedef struct fw_can_frame {
    uint32_t FS; /* CxRFS or CxTFI */
    uint32_t ID;
    uint32_t DA; /* data bytes 1 ... 4, the first one lowest */
    uint32_t DB;
} fw_can_frame;

/* CxBTR and CxIER, and on the bus. BTR of 3 Mbit/s at 60 MHz: 0x00254001. */
void fw_can_start(uint32_t controller, uint32_t BTR, uint32_t IER);
/* Fill transmit buffer 1 ... 3 and request it. 0, and nothing is done, while it is not free or the controller resets. */
uint32_t fw_can_transmit(uint32_t controller, uint32_t buffer, const fw_can_frame *frame);
/* TBS of the buffer. */
uint32_t fw_can_buffer_free(uint32_t controller, uint32_t buffer);
void fw_can_abort(uint32_t controller, uint32_t buffer);
/* CxRFS ... CxRDB of the frame that waits. */
void fw_can_read(uint32_t controller, fw_can_frame *frame);
/* CxCMR.RRB: free the receive buffer; a second frame moves up and asks for the interrupt again. */
void fw_can_release(uint32_t controller);
/* CxCMR.CDO */
void fw_can_clear_overrun(uint32_t controller);
uint32_t fw_can_GSR(uint32_t controller);
uint32_t fw_can_SR(uint32_t controller);
/* Reading clears all but the receive bit. */
uint32_t fw_can_ICR(uint32_t controller);
uint32_t fw_can_MOD(uint32_t controller);
/* FW_MOD_RESET or 0; after bus-off, 0 begins the recovery. */
void fw_can_write_MOD(uint32_t controller, uint32_t value);
void fw_can_write_IER(uint32_t controller, uint32_t value);

/* The acceptance filter of all four controllers (AFMR, SFF_sa, SFF_GRP_sa, EFF_sa, EFF_GRP_sa, ENDofTable, and the RAM
 * of its lookup table). Identifiers first ... last of a controller, of 29 bits where both have FW_CAN_EXTENDED. */
typedef struct fw_can_range {
    uint32_t controller;
    uint32_t first;
    uint32_t last;
} fw_can_range;

#define FW_CAN_ONE(controller, id) { (controller), (id), (id) }
/* From now on only frames in one of the ranges are received; others cost no interrupt. The ranges ascend: for 11 and for
 * 29 bits by controller and identifier, without an overlap. count 0: every frame is received again (bypass), as before
 * the first call. On the chip 0, and nothing is done, for ranges that do not ascend or take more than the table's 2 KB: two
 * bytes for a single identifier, four for a range, twice as many for 29 bits. Here such a call ends the run. */
uint32_t fw_can_accept(const fw_can_range *ranges, uint32_t count);

/* --- CAN FD controllers 1 ... 4 --------------------------------------------------------------------------------------
 * Not of the LPC2194, whose controllers are classic, but of no particular chip: a board has either these or those, as the
 * master table says (can = "fd" in boards.toml; without a table in firmware.toml). Not in an image for the LPC2194.
 * Interrupt sources, fw_can_accept, and the bits of CxGSR, CxICR, CxIER and CxMOD are those above. */
#define FW_CANFD_BRS 1u /* flags of a frame: its data are sent at the data bit rate */
#define FW_CANFD_ESI 2u /* received: its sender was error passive. Sent: as a gateway does; otherwise the controller sets it */
#define FW_CANFD_FDF 4u /* a CAN FD frame; without it a classic one */

typedef struct fw_canfd_frame {
    uint32_t ID;      /* with FW_CAN_EXTENDED one of 29 bits; with FW_CAN_REMOTE a remote frame, which CAN FD has not */
    uint8_t length;   /* data bytes: 0 ... 8, in a CAN FD frame also 12, 16, 20, 24, 32, 48, 64 */
    uint8_t flags;
    uint8_t reserved[2];
    uint8_t data[64];
} fw_canfd_frame;

/* Bit rates of both phases in bit/s, those of the bus; data_bit_rate 0: classic CAN only. To be called in
 * firmware_start. */
void fw_canfd_start(uint32_t controller, uint32_t bit_rate, uint32_t data_bit_rate, uint32_t IER);
/* Fill transmit buffer 1 ... 3 and request it. 0, and nothing is done, while it is not free or the controller resets. A
 * frame that does not exist, such as one of nine bytes, ends the run. */
uint32_t fw_canfd_transmit(uint32_t controller, uint32_t buffer, const fw_canfd_frame *frame);
uint32_t fw_canfd_buffer_free(uint32_t controller, uint32_t buffer);
void fw_canfd_abort(uint32_t controller, uint32_t buffer);
/* Take the oldest frame out of the receive queue of 32; 0 when it is empty. While frames are left, the interrupt is asked
 * for again. */
uint32_t fw_canfd_receive(uint32_t controller, fw_canfd_frame *frame);
void fw_canfd_clear_overrun(uint32_t controller);
uint32_t fw_canfd_GSR(uint32_t controller);
/* Reading clears all but the receive bit. */
uint32_t fw_canfd_ICR(uint32_t controller);
uint32_t fw_canfd_MOD(uint32_t controller);
/* FW_MOD_RESET or 0; after bus-off, 0 begins the recovery. */
void fw_canfd_write_MOD(uint32_t controller, uint32_t value);
void fw_canfd_write_IER(uint32_t controller, uint32_t value);

#ifdef __cplusplus
}
#endif

#endif
