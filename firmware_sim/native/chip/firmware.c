/* The header for the chip: every call reads and writes the registers that it is named after.
 *
 * What a program needs of pins is chosen by us where the chip offers several: those of the robot's boards. What is not
 * here: the SSP as a link of segments (fw_ssp_start, fw_ssp_exchange, fw_ssp_load, fw_ssp_take). */
#include "chip.h"
#include "registers.h"

/* --- interrupts ------------------------------------------------------------------------------------------------------
 * A line is a source with its handler. Lines that share an input of the VIC, as the captures and the match of a timer,
 * are asked one after the other in the order in which they were attached. */

struct line {
    fw_work handler;
    fw_call acknowledge;       /* before the handler, or NULL: the handler does it */
    volatile uint32_t *status; /* whether it asks: a bit of `mask` is set there */
    uint32_t mask;
    uint32_t input;
    uint32_t kind;
    uint32_t index;
    int32_t slot;
    uint32_t requested; /* by fw_request */
    struct line *next;
};

#define LINES 24u
static struct line lines[LINES];
static uint32_t line_count;
static struct line *fast; /* the first line of the fast interrupt */

uint32_t fw_lock(void)
{
    uint32_t state;
    __asm__ volatile("mrs %0, cpsr\n\tmsr cpsr_c, %1" : "=&r"(state) : "r"(0xDFu) : "memory");
    return state;
}

void fw_unlock(uint32_t state) { __asm__ volatile("msr cpsr_c, %0" : : "r"(state) : "memory"); }

void chip_interrupts_on(void) { fw_unlock(0x1Fu); }

static void serve_line(struct line *line)
{
    if (line->requested) {
        line->requested = 0;
        VICSoftIntClear = 1u << line->input;
    } else if (!(*line->status & line->mask)) {
        return;
    }
    if (line->acknowledge != NULL)
        line->acknowledge();
    line->handler();
}

/* From startup.S: the lines of a vectored slot. NULL: the request is gone. */
__attribute__((used)) void chip_serve(struct line *line);
void chip_serve(struct line *line)
{
    for (; line != NULL; line = line->next)
        serve_line(line);
}

__attribute__((used)) void chip_serve_fast(void);
void chip_serve_fast(void)
{
    struct line *line;
    for (line = fast; line != NULL; line = line->next)
        serve_line(line);
}

static struct line *find_line(uint32_t kind, uint32_t index)
{
    uint32_t i;
    for (i = 0; i < line_count; i++)
        if (lines[i].kind == kind && lines[i].index == index)
            return &lines[i];
    return NULL;
}

/* Where a chain of lines begins: of the fast interrupt, or of a VIC slot. */
static struct line *first_of(int32_t slot)
{
    return slot == FW_FIQ ? fast : (struct line *)VICVectAddrOf((uint32_t)slot);
}

static void set_first_of(int32_t slot, struct line *line)
{
    if (slot == FW_FIQ)
        fast = line;
    else
        VICVectAddrOf((uint32_t)slot) = (uint32_t)line;
}

static void take_out(struct line *line)
{
    struct line *each = first_of(line->slot);
    if (each == line) {
        set_first_of(line->slot, line->next);
        return;
    }
    for (; each != NULL; each = each->next)
        if (each->next == line)
            each->next = line->next;
}

static void attach_line(const struct line *wanted)
{
    const uint32_t state = fw_lock();
    struct line *line = find_line(wanted->kind, wanted->index);
    struct line *last;
    if (line != NULL)
        take_out(line);
    else if (line_count < LINES)
        line = &lines[line_count++];
    else
        for (;;) /* more than the chip has */
            ;
    *line = *wanted;
    last = first_of(line->slot);
    if (last == NULL) {
        set_first_of(line->slot, line);
    } else {
        while (last->next != NULL)
            last = last->next;
        last->next = line;
    }
    if (line->slot == FW_FIQ) {
        VICIntSelect |= 1u << line->input;
    } else {
        VICIntSelect &= ~(1u << line->input);
        VICVectCntl((uint32_t)line->slot) = VICVectCntl_ENABLED | line->input;
    }
    VICIntEnable = 1u << line->input;
    fw_unlock(state);
}

static void read_adc(void);
static void read_spi(void);
static void note_conversion(void);

/* Which pin leads to which capture: (pin, its function in PINSEL, timer, channel). LPC2194 user manual, PINSEL0, 1. */
struct capture_pin {
    uint8_t pin;
    uint8_t function;
    uint8_t timer;
    uint8_t channel;
};
static const struct capture_pin capture_pins[] = {
    {2, 2, 0, 0},  {22, 2, 0, 0}, {30, 3, 0, 0}, {4, 2, 0, 1},  {27, 2, 0, 1}, {6, 2, 0, 2},
    {16, 3, 0, 2}, {28, 2, 0, 2}, {29, 2, 0, 3}, {10, 2, 1, 0}, {11, 2, 1, 1}, {17, 1, 1, 2},
    {19, 3, 1, 2}, {18, 1, 1, 3}, {21, 3, 1, 3},
};

static const struct capture_pin *capture_of(uint32_t pin)
{
    uint32_t i;
    for (i = 0; i < sizeof capture_pins / sizeof capture_pins[0]; i++)
        if (capture_pins[i].pin == pin)
            return &capture_pins[i];
    return NULL;
}

/* Input of the VIC, where it can be seen that a source asks, and what takes the request back. */
static int find_source(struct line *line)
{
    const struct capture_pin *capture;
    const uint32_t n = line->index;
    line->status = &VICFIQStatus;
    line->acknowledge = NULL;
    switch (line->kind) {
    case FW_PIN_EDGE:
        capture = capture_of(n);
        if (capture == NULL)
            return 0;
        line->input = INPUT_TIMER(capture->timer);
        line->status = &TxIR(capture->timer);
        line->mask = FW_IR_CR(capture->channel);
        return 1;
    case FW_TIMER_MATCH:
        line->input = INPUT_TIMER(n);
        line->status = &TxIR(n);
        line->mask = FW_IR_MR0;
        return 1;
    case FW_CAN_RX:
        line->input = INPUT_CAN_RX(n);
        break;
    case FW_CAN_TX_DONE:
        line->input = INPUT_CAN_TX(n);
        break;
    case FW_CAN_STATUS:
        line->input = INPUT_CAN_ERRORS;
        break;
    case FW_UART_BYTE:
    case FW_UART_TRANSMIT:
        line->input = INPUT_UART(n);
        break;
    case FW_EXTERNAL_INTERRUPT:
        line->input = INPUT_EINT(n);
        line->acknowledge = note_conversion;
        break;
    case FW_ADC_DONE:
        line->input = INPUT_ADC;
        line->acknowledge = read_adc;
        break;
    case FW_SPI_DONE:
        line->input = INPUT_SPI0;
        line->acknowledge = read_spi;
        break;
    case FW_SOFTWARE:
        line->input = INPUT_SOFTWARE;
        break;
    default:
        return 0;
    }
    line->mask = 1u << line->input;
    return 1;
}

/* An interrupt that has an input of the VIC for itself asks when it is served. */
static volatile uint32_t always = 0xFFFFFFFFu;

void fw_attach(const fw_interrupt *interrupt)
{
    struct line line = {0};
    line.kind = interrupt->kind;
    line.index = interrupt->index;
    line.handler = interrupt->handler;
    line.slot = interrupt->vic_slot;
    if (!find_source(&line))
        for (;;) /* no such source: on the simulated chip a line says so */
            ;
    if (line.slot != FW_FIQ && line.status == &VICFIQStatus)
        line.status = &always;
    if (line.kind == FW_UART_BYTE)
        UxIER(line.index) |= IER_RBR;
    else if (line.kind == FW_UART_TRANSMIT)
        UxIER(line.index) |= IER_THRE;
    attach_line(&line);
}

void chip_attach_slot_timer(fw_work handler, int32_t vic_slot)
{
    struct line line = {0};
    line.kind = FW_TIMER_MATCH;
    line.index = SLOT_TIMER;
    line.handler = handler;
    line.slot = vic_slot;
    find_source(&line);
    attach_line(&line);
}

void fw_detach(enum fw_interrupt_kind kind, uint32_t index)
{
    const uint32_t state = fw_lock();
    struct line *line = find_line(kind, index);
    if (line != NULL) {
        uint32_t i;
        uint32_t shared = 0;
        take_out(line);
        line->kind = 0;
        for (i = 0; i < line_count; i++)
            if (lines[i].kind != 0 && lines[i].input == line->input)
                shared = 1;
        if (!shared)
            VICIntEnClr = 1u << line->input;
    }
    fw_unlock(state);
}

void fw_request(enum fw_interrupt_kind kind, uint32_t index)
{
    struct line *line = find_line(kind, index);
    if (line != NULL) {
        line->requested = 1;
        VICSoftInt = 1u << line->input;
    }
}

/* --- pins --- */

static void select_function(uint32_t pin, uint32_t function)
{
    const uint32_t shift = 2u * (pin & 15u);
    PINSEL(pin >> 4) = (PINSEL(pin >> 4) & ~(3u << shift)) | function << shift;
}

static uint32_t outputs[2]; /* FIODIR */

uint32_t fw_pin(uint32_t pin) { return FIOPIN(pin >> 5) >> (pin & 31u) & 1u; }

void fw_IOSET(uint32_t port, uint32_t mask)
{
    FIOSET(port) = mask;
    if ((outputs[port] & mask) != mask)
        FIODIR(port) = outputs[port] |= mask;
}

void fw_IOCLR(uint32_t port, uint32_t mask)
{
    FIOCLR(port) = mask;
    if ((outputs[port] & mask) != mask)
        FIODIR(port) = outputs[port] |= mask;
}

uint32_t fw_IOPIN(uint32_t port) { return FIOPIN(port); }

void fw_pin_write(uint32_t pin, uint32_t level)
{
    if (level)
        fw_IOSET(pin >> 5, 1u << (pin & 31u));
    else
        fw_IOCLR(pin >> 5, 1u << (pin & 31u));
}

void fw_pin_toggle(uint32_t pin) { fw_pin_write(pin, !fw_pin(pin)); }

void chip_begin(void)
{
    SCS = SCS_FAST_GPIO;
    VICIntEnClr = 0xFFFFFFFFu;
    VICIntSelect = 0;
    VICDefVectAddr = 0;
}

/* --- timers --- */

void fw_timer_start(uint32_t timer, uint32_t period, uint32_t match_interrupt)
{
    TxTCR(timer) = TCR_RESET;
    TxPR(timer) = 0;
    TxMR0(timer) = period - 1u;
    TxMCR(timer) = MCR_MR0_RESET | (match_interrupt ? MCR_MR0_INTERRUPT : 0u);
    TxCCR(timer) = 0;
    TxIR(timer) = 0xFFu;
    TxTCR(timer) = TCR_ENABLE;
}

void fw_capture_connect(uint32_t timer, uint32_t channel, uint32_t pin)
{
    const struct capture_pin *capture = capture_of(pin);
    if (capture != NULL && capture->timer == timer && capture->channel == channel)
        select_function(pin, capture->function);
}

uint32_t fw_timer_CCR(uint32_t timer) { return TxCCR(timer); }
void fw_timer_write_CCR(uint32_t timer, uint32_t value) { TxCCR(timer) = value; }
uint32_t fw_timer_CR(uint32_t timer, uint32_t channel) { return TxCR(timer, channel); }
uint32_t fw_timer_IR(uint32_t timer) { return TxIR(timer); }
void fw_timer_clear_IR(uint32_t timer, uint32_t mask) { TxIR(timer) = mask; }
uint32_t fw_timer_TC(uint32_t timer) { return TxTC(timer); }

/* --- PWM --- */

static const uint8_t pwm_pins[7][2] = {{0, 0}, {0, 2}, {7, 2}, {1, 2}, {8, 2}, {21, 1}, {9, 2}}; /* pin, function */
static uint32_t pwm_outputs;

void fw_pwm_start(uint32_t period)
{
    PWMTCR = TCR_RESET;
    PWMPR = 0;
    PWMMCR = PWMMCR_MR0_RESET;
    PWMMR(0) = period;
    PWMLER = 0x7Fu;
    PWMTCR = PWMTCR_ON;
}

/* A channel gets its pin when its first value is latched, so that no lead is driven before. */
static void connect_pwm(uint32_t mask)
{
    uint32_t match;
    for (match = 1; match < 7u; match++)
        if (mask & ~pwm_outputs & 1u << match) {
            pwm_outputs |= 1u << match;
            PWMPCR |= PWMPCR_OUTPUT(match);
            select_function(pwm_pins[match][0], pwm_pins[match][1]);
        }
}

uint32_t fw_pwm_MR(uint32_t match) { return PWMMR(match); }
void fw_pwm_write_MR(uint32_t match, uint32_t counts) { PWMMR(match) = counts; }

void fw_pwm_latch(uint32_t mask)
{
    PWMLER = mask;
    if (mask & 0x7Eu & ~pwm_outputs)
        connect_pwm(mask);
}

void fw_pwm_write(uint32_t MR2, uint32_t MR6)
{
    PWMMR(2) = MR2;
    PWMMR(6) = MR6;
    fw_pwm_latch(1u << 2 | 1u << 6);
}

/* --- internal converter --- */

static uint32_t adc_power; /* ADCR without what it converts */
static volatile uint32_t adc_converting;
static volatile uint32_t adc_last;

static const uint8_t adc_pins[8][2] = {{27, 1}, {28, 1}, {29, 1}, {30, 1}}; /* AIN0 ... AIN3 of the LPC2194 */

void fw_adc_start_clock(uint32_t clkdiv)
{
    adc_power = ADCR_PDN | (clkdiv - 1u) << 8;
    ADCR = adc_power;
    ADINTEN = 0x100u;
}

static void read_adc(void)
{
    const uint32_t word = ADGDR;
    if (word & ADGDR_DONE) {
        adc_last = word >> 6 & 0x3FFu;
        adc_converting = 0;
    }
}

static void connect_adc(uint32_t mask)
{
    uint32_t channel;
    static uint32_t connected;
    for (channel = 0; channel < 4u; channel++)
        if (mask & ~connected & 1u << channel) {
            connected |= 1u << channel;
            select_function(adc_pins[channel][0], adc_pins[channel][1]);
        }
}

uint32_t fw_adc_start(uint32_t channel)
{
    if (adc_converting) {
        if (find_line(FW_ADC_DONE, 0) == NULL)
            read_adc();
        if (adc_converting)
            return 0;
    }
    connect_adc(1u << channel);
    adc_converting = 1;
    ADCR = adc_power | ADCR_START | 1u << channel;
    return 1;
}

uint32_t fw_adc_result(void)
{
    if (adc_converting && find_line(FW_ADC_DONE, 0) == NULL)
        read_adc();
    return adc_last;
}

void fw_adc_burst(uint32_t mask)
{
    connect_adc(mask);
    ADINTEN = 0;
    ADCR = adc_power | ADCR_BURST | mask;
}

uint32_t fw_adc_DR(uint32_t channel) { return ADDR(channel) >> 6 & 0x3FFu; }

/* --- external converter ADS7871 on the SSP, BUSY on EINT1 (P0.14) --- */

#define ADCX_EINT 1u
#define WRITE_REGISTER(number, value) ((uint32_t)(number) << 8 | (value))
#define READ_REGISTER(number) (0x4000u | (uint32_t)(number) << 8)
#define CONVERT 0x80u

static volatile uint32_t adcx_converting;

static uint32_t ssp_wait(void)
{
    uint32_t word = 0;
    while (SSPSR & SSPSR_BSY)
        ;
    while (SSPSR & SSPSR_RNE)
        word = SSPDR;
    return word;
}

void fw_adcx_start_ssp(void)
{
    uint32_t pin;
    for (pin = 17; pin <= 20; pin++)
        select_function(pin, 2);
    SSPCPSR = 2;
    SSPCR0 = 0x02CFu; /* 16 bits, CPOL 1, CPHA 1, 60 MHz / (2 * 3) */
    SSPCR1 = 2;
    SSPDR = WRITE_REGISTER(24, 0);
    SSPDR = WRITE_REGISTER(3, 0);
    SSPDR = WRITE_REGISTER(7, 0); /* external reference */
    ssp_wait();
    select_function(14, 2);
    EXTMODE = 1u << ADCX_EINT; /* falling edge */
    EXTPOLAR = 0;
    EXTINT = 1u << ADCX_EINT;
}

static void note_conversion(void)
{
    EXTINT = 1u << ADCX_EINT;
    adcx_converting = 0;
}

static uint32_t adcx_is_busy(void)
{
    if (adcx_converting && find_line(FW_EXTERNAL_INTERRUPT, ADCX_EINT) == NULL && EXTINT & 1u << ADCX_EINT)
        note_conversion();
    return adcx_converting;
}

uint32_t fw_adcx_write(uint32_t register4, uint32_t later_ns)
{
    (void)later_ns; /* here it takes what it takes */
    if (adcx_is_busy())
        return 0;
    adcx_converting = (register4 & CONVERT) != 0;
    SSPDR = WRITE_REGISTER(4, register4 & 0xFFu);
    return 1;
}

uint32_t fw_adcx_busy(void) { return adcx_is_busy(); }

int32_t fw_adcx_result(void)
{
    uint32_t high;
    uint32_t low;
    ssp_wait(); /* the answer to what was written before */
    SSPDR = READ_REGISTER(1);
    SSPDR = READ_REGISTER(0);
    while (SSPSR & SSPSR_BSY)
        ;
    high = SSPDR & 0xFFu;
    low = SSPDR & 0xFFu;
    return (int32_t)(int16_t)(high << 8 | low) >> 2;
}

/* --- the SSP as a master of words --- */

void fw_ssp_start_words(uint32_t bits, uint32_t divider)
{
    uint32_t pin;
    for (pin = 17; pin <= 19; pin++) /* SCK1, MISO1, MOSI1 */
        select_function(pin, 2);
    SSPCR1 = 0;
    SSPCPSR = 2;
    SSPCR0 = (divider / 2u - 1u) << 8 | (bits - 1u); /* CPOL 0, CPHA 0 */
    SSPCR1 = 2;
}

uint32_t fw_ssp_word(uint32_t word)
{
    SSPDR = word;
    return ssp_wait();
}

/* --- SPI 0 with an absolute encoder --- */

static volatile uint32_t spi_transferring;
static volatile uint32_t spi_word;

void fw_spi_start(uint32_t number)
{
    (void)number;
    select_function(4, 1); /* SCK0 */
    select_function(5, 1); /* MISO0 */
    S0SPCCR = 60;          /* 1 MHz */
    S0SPCR = 0x0EB4u;      /* 14 bits, master, clock active low, interrupt */
    S0SPINT = 1;
}

static void read_spi(void)
{
    S0SPINT = 1;
    if (S0SPSR & SPSR_SPIF) {
        spi_word = S0SPDR;
        spi_transferring = 0;
    }
}

uint32_t fw_spi_transfer(uint32_t number)
{
    (void)number;
    if (spi_transferring) {
        if (find_line(FW_SPI_DONE, 0) == NULL)
            read_spi();
        if (spi_transferring)
            return 0;
    }
    spi_transferring = 1;
    S0SPDR = 0;
    return 1;
}

uint32_t fw_spi_SPSR(uint32_t number)
{
    (void)number;
    return spi_transferring ? 0 : SPSR_SPIF;
}

uint32_t fw_spi_SPDR(uint32_t number)
{
    (void)number;
    if (spi_transferring && find_line(FW_SPI_DONE, 0) == NULL)
        read_spi();
    return spi_word;
}

/* --- UARTs --- */

static uint32_t uart_room[2]; /* places in the transmit FIFO that are known to be free */

void fw_uart_start(uint32_t number, uint32_t divisor, uint32_t divaddval, uint32_t mulval, uint32_t trigger)
{
    const uint32_t level = trigger >= 14u ? 3u : trigger >= 8u ? 2u : trigger >= 4u ? 1u : 0u;
    select_function(number ? 8u : 0u, 1);
    select_function(number ? 9u : 1u, 1);
    UxLCR(number) = LCR_8N1 | LCR_DIVISOR;
    UxDLL(number) = divisor & 0xFFu;
    UxDLM(number) = divisor >> 8;
    UxLCR(number) = LCR_8N1;
    UxFDR(number) = mulval << 4 | divaddval;
    UxFCR(number) = FCR_ENABLE | level << 6;
}

uint32_t fw_uart_RBR(uint32_t number) { return UxRBR(number); }

uint32_t fw_uart_THR(uint32_t number, uint32_t byte)
{
    if (UxLSR(number) & LSR_THRE)
        uart_room[number] = UART_FIFO;
    if (uart_room[number] == 0)
        return 0;
    uart_room[number]--;
    UxTHR(number) = byte & 0xFFu;
    return 1;
}

uint32_t fw_uart_LSR(uint32_t number) { return UxLSR(number); }
uint32_t fw_uart_IIR(uint32_t number) { return UxIIR(number); }

/* --- CAN --- */

static int filtering; /* the acceptance filter has a table */

void fw_can_start(uint32_t controller, uint32_t BTR, uint32_t IER)
{
    /* RD1 and RD2, TD2; TD1 has a pin of its own */
    if (controller == 1u) {
        select_function(25, 1);
    } else if (controller == 2u) {
        select_function(23, 1);
        select_function(24, 1);
    }
    CxMOD(controller) = FW_MOD_RESET;
    if (!filtering)
        AFMR = AFMR_BYPASS;
    CxCMR(controller) = CMR_AT | CMR_RRB | CMR_CDO;
    CxBTR(controller) = BTR;
    CxIER(controller) = IER;
    CxMOD(controller) = 0;
}

uint32_t fw_can_buffer_free(uint32_t controller, uint32_t buffer)
{
    return (CxSR(controller) & SR_TBS(buffer)) != 0;
}

uint32_t fw_can_transmit(uint32_t controller, uint32_t buffer, const fw_can_frame *frame)
{
    if (!fw_can_buffer_free(controller, buffer) || CxMOD(controller) & FW_MOD_RESET)
        return 0;
    CxTFI(controller, buffer) = frame->FS;
    CxTID(controller, buffer) = frame->ID;
    CxTDA(controller, buffer) = frame->DA;
    CxTDB(controller, buffer) = frame->DB;
    CxCMR(controller) = CMR_TR | CMR_STB(buffer);
    return 1;
}

void fw_can_abort(uint32_t controller, uint32_t buffer) { CxCMR(controller) = CMR_AT | CMR_STB(buffer); }

void fw_can_read(uint32_t controller, fw_can_frame *frame)
{
    frame->FS = CxRFS(controller) & ~RFS_BY_FILTER;
    frame->ID = CxRID(controller);
    frame->DA = CxRDA(controller);
    frame->DB = CxRDB(controller);
}

void fw_can_release(uint32_t controller) { CxCMR(controller) = CMR_RRB; }
void fw_can_clear_overrun(uint32_t controller) { CxCMR(controller) = CMR_CDO; }
uint32_t fw_can_GSR(uint32_t controller) { return CxGSR(controller); }
uint32_t fw_can_SR(uint32_t controller) { return CxSR(controller); }
uint32_t fw_can_ICR(uint32_t controller) { return CxICR(controller); }
uint32_t fw_can_MOD(uint32_t controller) { return CxMOD(controller); }
void fw_can_write_MOD(uint32_t controller, uint32_t value) { CxMOD(controller) = value; }
void fw_can_write_IER(uint32_t controller, uint32_t value) { CxIER(controller) = value; }

#define FILTER_IDENTIFIER 0x1FFFFFFFu
#define FILTER_LAST_STANDARD 0x7FFu
#define FILTER_UNUSED 0x1000u /* of a half-word: disabled */

/* Whether a range is of the section: one of 11 or of 29 bits, a single identifier or more. */
static int in_section(const fw_can_range *range, int extended, int group)
{
    return !(range->first & FW_CAN_EXTENDED) == !extended && (range->first == range->last) == !group;
}

/* Whether the table can hold the ranges. */
static int ranges_fit(const fw_can_range *ranges, uint32_t count)
{
    uint32_t half_words = 0, bytes = 0, before[2] = {0, 0};
    for (uint32_t i = 0; i < count; i++) {
        const fw_can_range *range = &ranges[i];
        const int extended = (range->first & FW_CAN_EXTENDED) != 0;
        const uint32_t most = extended ? FILTER_IDENTIFIER : FILTER_LAST_STANDARD;
        const uint32_t first = range->first & ~FW_CAN_EXTENDED, last = range->last & ~FW_CAN_EXTENDED;
        const uint32_t controller = (range->controller - 1u) << 29;
        if (range->controller < 1 || range->controller > 4 || ((range->first ^ range->last) & FW_CAN_EXTENDED)
            || first > last || last > most || (controller | first) + 1u <= before[extended])
            return 0;
        before[extended] = (controller | last) + 1u;
        if (in_section(range, 0, 0))
            half_words++;
        else
            bytes += in_section(range, 1, 1) ? 8u : 4u;
    }
    return (half_words + 1u) / 2u * 4u + bytes <= AFRAM_BYTES;
}

/* Write a section of the table from `at` on; returns its end. */
static uint32_t write_section(uint32_t at, const fw_can_range *ranges, uint32_t count, int extended, int group)
{
    uint32_t upper = 0, halves = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t controller = (ranges[i].controller - 1u) << 29;
        const uint32_t first = ranges[i].first & FILTER_IDENTIFIER, last = ranges[i].last & FILTER_IDENTIFIER;
        if (!in_section(&ranges[i], extended, group))
            continue;
        if (extended) {
            AFRAM(at) = controller | first;
            at += 4;
            if (group) {
                AFRAM(at) = controller | last;
                at += 4;
            }
        } else if (group) {
            AFRAM(at) = controller | first << 16 | controller >> 16 | last;
            at += 4;
        } else if (halves++ & 1u) {
            AFRAM(at) = upper | controller >> 16 | first;
            at += 4;
        } else {
            upper = controller | first << 16;
        }
    }
    if (halves & 1u) {
        AFRAM(at) = upper | upper >> 16 | FILTER_UNUSED;
        at += 4;
    }
    return at;
}

uint32_t fw_can_accept(const fw_can_range *ranges, uint32_t count)
{
    uint32_t end;
    if (!ranges_fit(ranges, count))
        return 0;
    AFMR = AFMR_OFF;
    filtering = count > 0;
    if (!filtering) {
        AFMR = AFMR_BYPASS;
        return 1;
    }
    SFF_sa = 0; /* no identifiers of the chips that store frames by themselves come before */
    SFF_GRP_sa = end = write_section(0, ranges, count, 0, 0);
    EFF_sa = end = write_section(end, ranges, count, 0, 1);
    EFF_GRP_sa = end = write_section(end, ranges, count, 1, 0);
    ENDofTable = write_section(end, ranges, count, 1, 1);
    AFMR = 0;
    return 1;
}
