#include "error_module.h"

#include "mch_table.h"
#include "network_time.h"
#include "quirks.h"

#define CODES 128u /* of the table: 0 ... 127 */
#define RING 32u   /* errors that wait to be sent */
#define RING_MASK (RING - 1u)

/* Fields of an error word. */
#define CODE_MASK 0xFFFFu
#define BOARD_SHIFT 16
#define COUNT_MASK 1023u
#define COUNT_SHIFT 22

typedef char the_errors_do_not_fit[ERR_MC_SPEED_LIMIT < CODES ? 1 : -1];

struct waiting_error {
    uint32_t code;
    uint32_t count;
    uint32_t stamp; /* ms of the network time at the first event */
};

static uint32_t totals[CODES];
static volatile uint32_t flags[CODES]; /* events of this slot */
static volatile uint32_t any_flag;

static struct waiting_error ring[RING];
static uint32_t first;
static uint32_t waiting;

void error_report(uint32_t code)
{
    const uint32_t state = fw_lock();
    if (code >= CODES)
        code = ERR_DEFAULT; /* a wrong call is visible */
    totals[code]++;
    flags[code]++;
    any_flag = 1;
    fw_unlock(state);
}

static struct waiting_error *find(uint32_t code)
{
    uint32_t i;
    if (waiting == RING)
        return NULL; /* a full ring is not searched: its ends have met */
    for (i = 0; i < waiting; i++) {
        struct waiting_error *each = &ring[(first + i) & RING_MASK];
        if (each->code == code)
            return each;
    }
    return NULL;
}

static void append(uint32_t code, uint32_t count)
{
    struct waiting_error *place;
    if (waiting == RING) { /* the oldest goes */
        first = (first + 1u) & RING_MASK;
        waiting--;
    }
    place = &ring[(first + waiting) & RING_MASK];
    place->code = code;
    place->count = count;
    place->stamp = network_time_ms();
    waiting++;
}

int32_t error_update(void)
{
    uint32_t code;
    int32_t moved = 0;
    int repeated = 0;
    if (!any_flag)
        return 0;
    any_flag = 0; /* first: what is noted from here on is looked at now or in the next slot */
    for (code = 0; code < CODES; code++) {
        struct waiting_error *same;
        uint32_t events;
        uint32_t state;
        if (!flags[code])
            continue;
        state = fw_lock();
        events = flags[code];
        flags[code] = 0;
        fw_unlock(state);
        if (!ERRORS_COUNTED_PER_EVENT)
            events = 1;
        moved++;
        same = find(code);
        if (same != NULL) {
            same->count += events;
            repeated = 1;
        } else if (!(repeated && NEW_ERRORS_LOST_AFTER_REPEAT)) {
            append(code, events);
        }
    }
    return moved;
}

int error_take(uint32_t *word, uint32_t *stamp)
{
    const struct waiting_error *oldest = &ring[first];
    if (waiting == 0)
        return 0;
    *word = (oldest->code & CODE_MASK) | (uint32_t)MCH_BOARD_NUMBER << BOARD_SHIFT
        | (oldest->count & COUNT_MASK) << COUNT_SHIFT;
    *stamp = oldest->stamp;
    first = (first + 1u) & RING_MASK;
    waiting--;
    return 1;
}

const fw_error_counts *error_counts(void)
{
    static const fw_error_counts counts = {totals, CODES};
    return &counts;
}
