/* The header for a simulated chip: every call leads to the board's models of the devices (native_board.py).
 *
 * Compiled together with a program into one library. The harness finds out by name which calls there are, and puts
 * its functions in. A main loop of its own runs on a stack of its own; what it calls is done on the harness's stack,
 * between two turns of it, so that the harness's language never runs on the program's stack.
 */
#define _GNU_SOURCE
#include <ranger_sim/firmware.h>

#include <stdlib.h>
#include <sys/mman.h>
#include <ucontext.h>
#ifdef __linux__
#include <link.h>
#include <signal.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <unistd.h>
#endif

#define EXPORTED __attribute__((visibility("default")))

#define CALLS(CALL) \
    CALL(attach) CALL(detach) CALL(request) \
    CALL(spend) CALL(idle) CALL(slot_cycles) CALL(cycles) \
    CALL(pin_write) CALL(pin_toggle) CALL(IOPIN) CALL(IOSET) CALL(IOCLR) \
    CALL(timer_start) CALL(capture_connect) CALL(timer_CCR) CALL(timer_write_CCR) CALL(timer_CR) CALL(timer_IR) \
    CALL(timer_clear_IR) CALL(timer_TC) \
    CALL(pwm_start) CALL(pwm_MR) CALL(pwm_write_MR) CALL(pwm_latch) CALL(pwm_write) \
    CALL(adc_start_clock) CALL(adc_start) CALL(adc_result) CALL(adc_burst) CALL(adc_DR) \
    CALL(adcx_start_ssp) CALL(adcx_write) CALL(adcx_busy) CALL(adcx_result) \
    CALL(spi_start) CALL(spi_transfer) CALL(spi_SPSR) CALL(spi_SPDR) \
    CALL(ssp_start) CALL(ssp_exchange) CALL(ssp_load) CALL(ssp_take) \
    CALL(uart_start) CALL(uart_RBR) CALL(uart_THR) CALL(uart_LSR) CALL(uart_IIR) \
    CALL(can_start) CALL(can_transmit) CALL(can_buffer_free) CALL(can_abort) CALL(can_read) CALL(can_release) \
    CALL(can_clear_overrun) CALL(can_GSR) CALL(can_SR) CALL(can_ICR) CALL(can_MOD) CALL(can_write_MOD) \
    CALL(can_write_IER) \
    CALL(ssp_start_words) CALL(ssp_word) \
    CALL(can_accept) \
    CALL(canfd_start) CALL(canfd_transmit) CALL(canfd_buffer_free) CALL(canfd_abort) CALL(canfd_receive) \
    CALL(canfd_clear_overrun) CALL(canfd_GSR) CALL(canfd_ICR) CALL(canfd_MOD) CALL(canfd_write_MOD) \
    CALL(canfd_write_IER)

/* One of the two a program leaves out. */
void firmware_main(void) __attribute__((weak));

#define NUMBER(name) CALL_##name,
#define NAME(name) #name,
enum call { CALLS(NUMBER) CALL_COUNT };

/* What calls do in the harness: its own pointer, the number of the call, and up to five numbers in, one out. */
typedef int64_t (*host_call)(void *, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t);

EXPORTED const uint32_t fw_compiled_version = FW_VERSION;
EXPORTED const uint32_t fw_sizes[4] = {sizeof(fw_task), sizeof(fw_step), sizeof(fw_schedule), sizeof(fw_interrupt)};
EXPORTED const char *const fw_call_names[CALL_COUNT + 1] = {CALLS(NAME) NULL};
EXPORTED host_call fw_answer;
EXPORTED void *fw_host;
EXPORTED const int64_t *fw_pin_levels; /* of the chip's 64 pins */
#define TIMERS 2u
/* Where the registers of a timer are that the program has started, where it can reach them without a call. */
EXPORTED struct {
    int64_t *IR;
    int64_t *CCR;
    const int64_t *CR;
} fw_timers[TIMERS];
EXPORTED int64_t fw_mail[32];          /* what does not fit into five numbers, both ways */
EXPORTED fw_canfd_frame fw_canfd_mail; /* the same, of a CAN FD frame */

/* --- the main loop's own stack --- */

#define STACK_BYTES (256u * 1024u) /* sixteen times the RAM of the chip: its own would have overflowed before */
#define TURN_ENDED_MAIN (-1)       /* what a turn returns beside cycles: the main loop has returned, */
#define TURN_FAILED (-2)           /* or there is no memory for its stack */

static struct {
    int exists;
    int running; /* the code that runs now is the main loop's */
    int ended;
    ucontext_t harness;
    ucontext_t program;
    enum call asked;
    int64_t arguments[5];
    int64_t answer;
    void *frame;
} loop;

/* The frame of the program's call that the harness is carrying out, NULL between two: for who asks where it was. */
static void *volatile asking;

static void loop_body(void)
{
    firmware_main();
    loop.ended = 1;
}

static int loop_begin(void)
{
    const size_t guard = 4096;
    char *stack = mmap(NULL, STACK_BYTES + guard, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (stack == MAP_FAILED || mprotect(stack + guard, STACK_BYTES, PROT_READ | PROT_WRITE) != 0
        || getcontext(&loop.program) != 0)
        return 0;
    loop.program.uc_stack.ss_sp = stack + guard;
    loop.program.uc_stack.ss_size = STACK_BYTES;
    loop.program.uc_link = &loop.harness;
    makecontext(&loop.program, loop_body, 0);
    loop.exists = 1;
    return 1;
}

/* A turn of the main loop: until it lets time pass. Returns the cycles that pass, 0 when it sleeps. */
EXPORTED int64_t fw_turn(void)
{
    if (loop.ended)
        return TURN_ENDED_MAIN;
    if (!loop.exists && !loop_begin())
        return TURN_FAILED;
    for (;;) {
        loop.running = 1;
        swapcontext(&loop.harness, &loop.program);
        loop.running = 0;
        if (loop.ended)
            return TURN_ENDED_MAIN;
        if (loop.asked == CALL_spend)
            return loop.arguments[0];
        if (loop.asked == CALL_idle)
            return 0;
        const int64_t *with = loop.arguments;
        asking = loop.frame;
        loop.answer = fw_answer(fw_host, loop.asked, with[0], with[1], with[2], with[3], with[4]);
        asking = NULL;
    }
}

static int64_t host(enum call asked, int64_t a, int64_t b, int64_t c, int64_t d, int64_t e)
{
    if (!loop.running) {
        asking = __builtin_frame_address(0);
        const int64_t answer = fw_answer(fw_host, asked, a, b, c, d, e);
        asking = NULL;
        return answer;
    }
    loop.asked = asked;
    loop.arguments[0] = a;
    loop.arguments[1] = b;
    loop.arguments[2] = c;
    loop.arguments[3] = d;
    loop.arguments[4] = e;
    loop.frame = __builtin_frame_address(0);
    swapcontext(&loop.program, &loop.harness);
    return loop.answer;
}

#define HOST0(name) host(CALL_##name, 0, 0, 0, 0, 0)
#define HOST1(name, a) host(CALL_##name, a, 0, 0, 0, 0)
#define HOST2(name, a, b) host(CALL_##name, a, b, 0, 0, 0)
#define HOST3(name, a, b, c) host(CALL_##name, a, b, c, 0, 0)
#define HOST4(name, a, b, c, d) host(CALL_##name, a, b, c, d, 0)
#define HOST5(name, a, b, c, d, e) host(CALL_##name, a, b, c, d, e)

/* --- the calls of the header --- */

void fw_attach(const fw_interrupt *interrupt) { HOST1(attach, (int64_t)(intptr_t)interrupt); }
void fw_detach(enum fw_interrupt_kind kind, uint32_t index) { HOST2(detach, kind, index); }
void fw_request(enum fw_interrupt_kind kind, uint32_t index) { HOST2(request, kind, index); }
uint32_t fw_lock(void) { return 0; }
void fw_unlock(uint32_t state) { (void)state; }

void fw_spend(uint32_t cycles)
{
    if (cycles > 0)
        HOST1(spend, cycles);
}
void fw_idle(void) { HOST0(idle); }
uint32_t fw_slot_cycles(void) { return (uint32_t)HOST0(slot_cycles); }
uint32_t fw_cycles(void) { return (uint32_t)HOST0(cycles); }

uint32_t fw_pin(uint32_t pin) { return (uint32_t)fw_pin_levels[pin & 63]; }
void fw_pin_write(uint32_t pin, uint32_t level) { HOST2(pin_write, pin, level); }
void fw_pin_toggle(uint32_t pin) { HOST1(pin_toggle, pin); }
uint32_t fw_IOPIN(uint32_t port) { return (uint32_t)HOST1(IOPIN, port); }
void fw_IOSET(uint32_t port, uint32_t mask) { HOST2(IOSET, port, mask); }
void fw_IOCLR(uint32_t port, uint32_t mask) { HOST2(IOCLR, port, mask); }

void fw_timer_start(uint32_t timer, uint32_t period, uint32_t match_interrupt)
{
    HOST3(timer_start, timer, period, match_interrupt);
}
void fw_capture_connect(uint32_t timer, uint32_t channel, uint32_t pin) { HOST3(capture_connect, timer, channel, pin); }

/* The handler of an edge does nearly nothing but this, and a call of the harness costs more than all of it. */
static int is_near(uint32_t timer) { return timer < TIMERS && fw_timers[timer].IR != NULL; }

uint32_t fw_timer_CCR(uint32_t timer)
{
    return (uint32_t)(is_near(timer) ? *fw_timers[timer].CCR : HOST1(timer_CCR, timer));
}
void fw_timer_write_CCR(uint32_t timer, uint32_t value)
{
    if (is_near(timer))
        *fw_timers[timer].CCR = value & 0xFFFu;
    else
        HOST2(timer_write_CCR, timer, value);
}
uint32_t fw_timer_CR(uint32_t timer, uint32_t channel)
{
    return (uint32_t)(is_near(timer) ? fw_timers[timer].CR[channel & 3u] : HOST2(timer_CR, timer, channel));
}
uint32_t fw_timer_IR(uint32_t timer)
{
    return (uint32_t)(is_near(timer) ? *fw_timers[timer].IR : HOST1(timer_IR, timer));
}
void fw_timer_clear_IR(uint32_t timer, uint32_t mask)
{
    if (is_near(timer))
        *fw_timers[timer].IR &= ~(int64_t)mask;
    else
        HOST2(timer_clear_IR, timer, mask);
}
uint32_t fw_timer_TC(uint32_t timer) { return (uint32_t)HOST1(timer_TC, timer); }

void fw_pwm_start(uint32_t period) { HOST1(pwm_start, period); }
uint32_t fw_pwm_MR(uint32_t match) { return (uint32_t)HOST1(pwm_MR, match); }
void fw_pwm_write_MR(uint32_t match, uint32_t counts) { HOST2(pwm_write_MR, match, counts); }
void fw_pwm_latch(uint32_t mask) { HOST1(pwm_latch, mask); }
void fw_pwm_write(uint32_t MR2, uint32_t MR6) { HOST2(pwm_write, MR2, MR6); }

void fw_adc_start_clock(uint32_t clkdiv) { HOST1(adc_start_clock, clkdiv); }
uint32_t fw_adc_start(uint32_t channel) { return (uint32_t)HOST1(adc_start, channel); }
uint32_t fw_adc_result(void) { return (uint32_t)HOST0(adc_result); }
void fw_adc_burst(uint32_t mask) { HOST1(adc_burst, mask); }
uint32_t fw_adc_DR(uint32_t channel) { return (uint32_t)HOST1(adc_DR, channel); }

void fw_adcx_start_ssp(void) { HOST0(adcx_start_ssp); }
uint32_t fw_adcx_write(uint32_t register4, uint32_t later_ns) { return (uint32_t)HOST2(adcx_write, register4, later_ns); }
uint32_t fw_adcx_busy(void) { return (uint32_t)HOST0(adcx_busy); }
int32_t fw_adcx_result(void) { return (int32_t)HOST0(adcx_result); }

void fw_spi_start(uint32_t number) { HOST1(spi_start, number); }
uint32_t fw_spi_transfer(uint32_t number) { return (uint32_t)HOST1(spi_transfer, number); }
uint32_t fw_spi_SPSR(uint32_t number) { return (uint32_t)HOST1(spi_SPSR, number); }
uint32_t fw_spi_SPDR(uint32_t number) { return (uint32_t)HOST1(spi_SPDR, number); }

static void post_words(const uint16_t *words)
{
    for (int i = 0; i < FW_SEGMENT_WORDS; i++)
        fw_mail[i] = words[i];
}

void fw_ssp_start(uint32_t number) { HOST1(ssp_start, number); }
void fw_ssp_exchange(uint32_t number, const uint16_t words[FW_SEGMENT_WORDS])
{
    post_words(words);
    HOST1(ssp_exchange, number);
}
void fw_ssp_load(uint32_t number, const uint16_t words[FW_SEGMENT_WORDS])
{
    post_words(words);
    HOST1(ssp_load, number);
}
uint32_t fw_ssp_take(uint32_t number, uint16_t words[FW_SEGMENT_WORDS])
{
    uint32_t came = (uint32_t)HOST1(ssp_take, number);
    if (came)
        for (int i = 0; i < FW_SEGMENT_WORDS; i++)
            words[i] = (uint16_t)fw_mail[i];
    return came;
}

void fw_ssp_start_words(uint32_t bits, uint32_t divider) { HOST2(ssp_start_words, bits, divider); }
uint32_t fw_ssp_word(uint32_t word) { return (uint32_t)HOST1(ssp_word, word); }

void fw_uart_start(uint32_t number, uint32_t divisor, uint32_t divaddval, uint32_t mulval, uint32_t trigger)
{
    HOST5(uart_start, number, divisor, divaddval, mulval, trigger);
}
uint32_t fw_uart_RBR(uint32_t number) { return (uint32_t)HOST1(uart_RBR, number); }
uint32_t fw_uart_THR(uint32_t number, uint32_t byte) { return (uint32_t)HOST2(uart_THR, number, byte); }
uint32_t fw_uart_LSR(uint32_t number) { return (uint32_t)HOST1(uart_LSR, number); }
uint32_t fw_uart_IIR(uint32_t number) { return (uint32_t)HOST1(uart_IIR, number); }

void fw_can_start(uint32_t controller, uint32_t BTR, uint32_t IER) { HOST3(can_start, controller, BTR, IER); }
uint32_t fw_can_transmit(uint32_t controller, uint32_t buffer, const fw_can_frame *frame)
{
    int64_t place = (int64_t)controller << 32 | buffer;
    return (uint32_t)HOST5(can_transmit, place, frame->FS, frame->ID, frame->DA, frame->DB);
}
uint32_t fw_can_buffer_free(uint32_t controller, uint32_t buffer)
{
    return (uint32_t)HOST2(can_buffer_free, controller, buffer);
}
void fw_can_abort(uint32_t controller, uint32_t buffer) { HOST2(can_abort, controller, buffer); }
void fw_can_read(uint32_t controller, fw_can_frame *frame)
{
    HOST1(can_read, controller);
    frame->FS = (uint32_t)fw_mail[0];
    frame->ID = (uint32_t)fw_mail[1];
    frame->DA = (uint32_t)fw_mail[2];
    frame->DB = (uint32_t)fw_mail[3];
}
void fw_can_release(uint32_t controller) { HOST1(can_release, controller); }
void fw_can_clear_overrun(uint32_t controller) { HOST1(can_clear_overrun, controller); }
uint32_t fw_can_GSR(uint32_t controller) { return (uint32_t)HOST1(can_GSR, controller); }
uint32_t fw_can_SR(uint32_t controller) { return (uint32_t)HOST1(can_SR, controller); }
uint32_t fw_can_ICR(uint32_t controller) { return (uint32_t)HOST1(can_ICR, controller); }
uint32_t fw_can_MOD(uint32_t controller) { return (uint32_t)HOST1(can_MOD, controller); }
void fw_can_write_MOD(uint32_t controller, uint32_t value) { HOST2(can_write_MOD, controller, value); }
void fw_can_write_IER(uint32_t controller, uint32_t value) { HOST2(can_write_IER, controller, value); }
uint32_t fw_can_accept(const fw_can_range *ranges, uint32_t count)
{
    return (uint32_t)HOST2(can_accept, (int64_t)(intptr_t)ranges, count);
}

void fw_canfd_start(uint32_t controller, uint32_t bit_rate, uint32_t data_bit_rate, uint32_t IER)
{
    HOST4(canfd_start, controller, bit_rate, data_bit_rate, IER);
}
uint32_t fw_canfd_transmit(uint32_t controller, uint32_t buffer, const fw_canfd_frame *frame)
{
    fw_canfd_mail = *frame;
    return (uint32_t)HOST2(canfd_transmit, controller, buffer);
}
uint32_t fw_canfd_buffer_free(uint32_t controller, uint32_t buffer)
{
    return (uint32_t)HOST2(canfd_buffer_free, controller, buffer);
}
void fw_canfd_abort(uint32_t controller, uint32_t buffer) { HOST2(canfd_abort, controller, buffer); }
uint32_t fw_canfd_receive(uint32_t controller, fw_canfd_frame *frame)
{
    uint32_t came = (uint32_t)HOST1(canfd_receive, controller);
    if (came)
        *frame = fw_canfd_mail;
    return came;
}
void fw_canfd_clear_overrun(uint32_t controller) { HOST1(canfd_clear_overrun, controller); }
uint32_t fw_canfd_GSR(uint32_t controller) { return (uint32_t)HOST1(canfd_GSR, controller); }
uint32_t fw_canfd_ICR(uint32_t controller) { return (uint32_t)HOST1(canfd_ICR, controller); }
uint32_t fw_canfd_MOD(uint32_t controller) { return (uint32_t)HOST1(canfd_MOD, controller); }
void fw_canfd_write_MOD(uint32_t controller, uint32_t value) { HOST2(canfd_write_MOD, controller, value); }
void fw_canfd_write_IER(uint32_t controller, uint32_t value) { HOST2(canfd_write_IER, controller, value); }

/* --- where the program was when a signal ended its process --- */

#define PLACES 6u           /* of the program's functions, innermost first */
#define MOST_FRAMES 64u     /* looked at for them: between them are frames of the harness */
#define OVERFLOW_FLAG 256   /* in the record's first number, beside the signal */
#define EXIT_FLAG 512       /* in its place: the program called exit, whose code is added */
#define NEAR_WORDS 1024u    /* of the stack, looked at where there are no frames */
#define NEAR_STACK 65536u   /* bytes: an access so near to the stack pointer that fails has left the stack */

/* Odd while the harness runs the program; another number for every time that it does. */
EXPORTED volatile uint32_t fw_turns;

#ifdef FW_COVERAGE
void __gcov_dump(void);
void __gcov_reset(void);
#endif

#ifdef FW_COVERAGE
EXPORTED const uint32_t fw_counts_lines = 1;

/* Write what was counted, and begin anew. */
EXPORTED void fw_write_counts(void)
{
    __gcov_dump();
    __gcov_reset();
}

/* Write it for the last time: nothing is written when the library or the process ends. */
EXPORTED void fw_end_counts(void)
{
    __gcov_reset();
    __gcov_dump();
}
#else
EXPORTED const uint32_t fw_counts_lines = 0;
EXPORTED void fw_write_counts(void) {}
EXPORTED void fw_end_counts(void) {}
#endif

#ifdef __linux__

static const int ENDS[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP, SIGXCPU};
#define END_COUNT (sizeof ENDS / sizeof *ENDS)

static struct {
    int64_t *record;
    const char *message;     /* NULL: who reads the record tells of it */
    uint32_t seen;           /* fw_turns at the last tick of the processor's time */
    struct sigaction before[END_COUNT];
    struct sigaction before_tick;
    uintptr_t base; /* of this library; its code is within first ... end */
    uintptr_t first;
    uintptr_t end;
    char stack[131072]; /* the handler's own: the program's may be what is used up */
} watch;

void __real__exit(int code) __attribute__((noreturn));

/* The two words of a frame: the frame before, and where it goes on. By the kernel, as nothing need be there. */
static int frame_at(uintptr_t address, uintptr_t words[2])
{
    const size_t size = 2 * sizeof *words;
    struct iovec here = {words, size}, there = {(void *)address, size};
    return process_vm_readv(getpid(), &here, 1, &there, 1, 0) == (ssize_t)size;
}

static uint32_t noted(uint32_t count, uintptr_t address)
{
    if (address < watch.first || address >= watch.end)
        return count;
    watch.record[1 + count] = (int64_t)(address - watch.base);
    return count + 1;
}

static uint32_t note_frames(uint32_t count, uintptr_t frame)
{
    uintptr_t words[2];
    for (uint32_t i = 0; i < MOST_FRAMES && count < PLACES && frame_at(frame, words); i++) {
        count = noted(count, words[1] - 1); /* the call, not what comes behind it */
        if (words[0] <= frame)
            break;
        frame = words[0];
    }
    return count;
}

/* The program's places, innermost first; returns how many. */
static uint32_t note_places(const ucontext_t *at, uintptr_t *top)
{
    uintptr_t pc = 0, frame = 0, stack = 0, words[2];
#if defined __x86_64__
    pc = (uintptr_t)at->uc_mcontext.gregs[REG_RIP];
    frame = (uintptr_t)at->uc_mcontext.gregs[REG_RBP];
    stack = (uintptr_t)at->uc_mcontext.gregs[REG_RSP];
#elif defined __aarch64__
    pc = (uintptr_t)at->uc_mcontext.pc;
    frame = (uintptr_t)at->uc_mcontext.regs[29];
    stack = (uintptr_t)at->uc_mcontext.sp;
#else
    (void)at;
#endif
    *top = stack;
    uint32_t count = noted(0, pc);
    if (count == 0 && asking != NULL) /* the harness works for a call of the program's: where that was made */
        return note_frames(0, (uintptr_t)asking);
    /* A function without a frame of its own is not in the chain of frames. Of the program: its caller's address is on
       top of the stack. Of another library: the program's address nearest to the top is where it was called. */
    const uint32_t looked_at = count > 0 ? 1 : NEAR_WORDS, before = count;
    for (uint32_t i = 0; i < looked_at && count == before && stack != frame && frame_at(stack, words); i++) {
        count = noted(count, words[0] - 1);
        stack += sizeof *words;
    }
    return note_frames(count, frame);
}

static char *hexadecimal(char *to, uint64_t number)
{
    int shift = 60;
    while (shift > 0 && number >> shift == 0)
        shift -= 4;
    for (; shift >= 0; shift -= 4)
        *to++ = "0123456789abcdef"[number >> shift & 15];
    return to;
}

static void say(const char *text)
{
    const char *end = text;
    while (*end)
        end++;
    if (write(2, text, (size_t)(end - text)) < 0)
        return;
}

/* Only what is allowed in a signal's handler. */
static void tell_places(uint32_t count)
{
    char text[32 * PLACES + 1], *to = text;
    for (uint32_t i = 0; i < count; i++) {
        *to++ = ' ';
        *to++ = '0';
        *to++ = 'x';
        to = hexadecimal(to, (uint64_t)watch.record[1 + i]);
    }
    *to++ = '\n';
    *to = 0;
    say(watch.message);
    say(text);
}

/* The program ends the process by itself: a failure, whatever code it chose. */
static void leave(int code, void *frame)
{
    char text[16], *to = text + sizeof text - 1;
    *to = 0;
    for (uint32_t rest = (uint32_t)code & 0xFFu; to == text + sizeof text - 1 || rest > 0; rest /= 10)
        *--to = (char)('0' + rest % 10);
    if (watch.record != NULL) {
        for (uint32_t i = 0; i <= PLACES; i++)
            watch.record[i] = 0;
        const uint32_t count = note_frames(0, (uintptr_t)frame);
        watch.record[0] = EXIT_FLAG + (code & 0xFF);
        if (watch.message != NULL)
            tell_places(count);
    }
    if (watch.record == NULL ? getenv("RANGER_SIM_TRIAL") == NULL : watch.message != NULL) {
        say("ranger-sim: firmware in C ended this process: it called exit(");
        say(to);
        say(")\n");
    }
    if (watch.record == NULL && getenv("RANGER_SIM_TRIAL") != NULL)
        __real__exit(code); /* the other process reports it */
#ifdef FW_COVERAGE
    __gcov_dump();
#endif
    signal(SIGABRT, SIG_DFL);
    raise(SIGABRT);
    __real__exit(1);
}

void __wrap_exit(int code) { leave(code, __builtin_frame_address(0)); }
void __wrap__exit(int code) { leave(code, __builtin_frame_address(0)); }
void __wrap__Exit(int code) { leave(code, __builtin_frame_address(0)); }
void __wrap_quick_exit(int code) { leave(code, __builtin_frame_address(0)); }

static void note_signal(int number, siginfo_t *what, void *context)
{
    uintptr_t top = 0;
    for (uint32_t i = 0; i <= PLACES; i++)
        watch.record[i] = 0;
    const uint32_t count = note_places(context, &top);
    const struct sigaction *before = NULL;
    for (uint32_t i = 0; i < END_COUNT; i++)
        if (ENDS[i] == number)
            before = &watch.before[i];
    if (count == 0 && before != NULL && before->sa_flags & SA_SIGINFO && before->sa_sigaction != NULL) {
        before->sa_sigaction(number, what, context); /* another board's program, in the same process */
        return;
    }
    const int overflow = (number == SIGSEGV || number == SIGBUS)
        && (uintptr_t)what->si_addr + NEAR_STACK - top < 2 * (uintptr_t)NEAR_STACK;
    watch.record[0] = number + (overflow ? OVERFLOW_FLAG : 0);
    if (watch.message != NULL)
        tell_places(count);
#ifdef FW_COVERAGE
    /* Not meant for a handler; but what is lost without it is the way to the crash. If it fails, so does the rest. */
    for (uint32_t i = 0; i < END_COUNT; i++)
        signal(ENDS[i], SIG_DFL);
    __gcov_dump();
#endif
    signal(number, SIG_DFL);
    raise(number); /* ends the process when this function returns */
}

/* A tick of the processor's time that this process has used: two of them in one turn, and the program is endless. */
static void tick(int number, siginfo_t *what, void *context)
{
    const uint32_t turns = fw_turns;
    if (turns & 1 && turns == watch.seen)
        note_signal(SIGXCPU, what, context);
    watch.seen = turns;
    if (watch.before_tick.sa_flags & SA_SIGINFO && watch.before_tick.sa_sigaction != NULL)
        watch.before_tick.sa_sigaction(number, what, context); /* another board's program, in the same process */
}

static int own_code(struct dl_phdr_info *library, size_t size, void *unused)
{
    (void)size;
    (void)unused;
    for (int i = 0; i < library->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &library->dlpi_phdr[i];
        const uintptr_t first = library->dlpi_addr + part->p_vaddr;
        if (part->p_type == PT_LOAD && (part->p_flags & PF_X) && (uintptr_t)own_code - first < part->p_memsz) {
            watch.base = library->dlpi_addr;
            watch.first = first;
            watch.end = first + part->p_memsz;
            return 1;
        }
    }
    return 0;
}

/* From now on a signal that ends this process leaves the signal and up to six places in `record` (seven numbers), and
 * a turn of the program that takes `limit_s` to twice that of the processor's time is ended so, as by SIGXCPU.
 * message: written to the terminal then, with the places behind it; NULL: somebody else tells of it. */
EXPORTED int32_t fw_watch(int64_t *record, int32_t limit_s, const char *message)
{
    const int again = watch.record != NULL;
    stack_t own = {.ss_sp = watch.stack, .ss_size = sizeof watch.stack};
    struct sigaction action = {.sa_sigaction = note_signal, .sa_flags = SA_SIGINFO | SA_ONSTACK};
    struct sigaction ticking = {.sa_sigaction = tick, .sa_flags = SA_SIGINFO | SA_ONSTACK | SA_RESTART};
    const struct itimerval each = {.it_interval = {.tv_sec = limit_s}, .it_value = {.tv_sec = limit_s}};
    watch.record = record;
    watch.message = message;
    if (!dl_iterate_phdr(own_code, NULL) || sigaltstack(&own, NULL) != 0)
        return 0;
    for (uint32_t i = 0; i < END_COUNT && !again; i++)
        sigaction(ENDS[i], &action, &watch.before[i]);
    if (!again)
        sigaction(SIGPROF, &ticking, &watch.before_tick);
    return setitimer(ITIMER_PROF, &each, NULL) == 0;
}

#else

void __real__exit(int code) __attribute__((noreturn));

/* Not a success, whatever code it chose. */
void __wrap_exit(int code) { __real__exit(code != 0 ? code : 1); }
void __wrap__exit(int code) { __real__exit(code != 0 ? code : 1); }
void __wrap__Exit(int code) { __real__exit(code != 0 ? code : 1); }
void __wrap_quick_exit(int code) { __real__exit(code != 0 ? code : 1); }

EXPORTED int32_t fw_watch(int64_t *record, int32_t limit_s, const char *message)
{
    (void)record;
    (void)limit_s;
    (void)message;
    return 0;
}

#endif
