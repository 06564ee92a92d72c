/* What firmware of a motor board does all day, each as a function that a test calls; results are checked in
 * test_compiled.py against the same arithmetic in Python. Built for the ARM7TDMI by compiled.py. */

#include <stdint.h>
#include <string.h>

/* ---- a function of a table, by search and interpolation, as of a thermistor */

static const int16_t table[32][2] = {
    {-2000, 312}, {-1870, 340}, {-1755, 377}, {-1650, 402}, {-1500, 433}, {-1388, 480}, {-1260, 511}, {-1111, 570},
    {-1003, 614}, {-890, 660},  {-775, 699},  {-640, 747},  {-512, 801},  {-377, 850},  {-250, 903},  {-120, 961},
    {-11, 1010},  {110, 1077},  {233, 1122},  {350, 1190},  {470, 1240},  {590, 1302},  {715, 1377},  {830, 1433},
    {950, 1499},  {1077, 1560}, {1200, 1633}, {1333, 1705}, {1450, 1777}, {1600, 1866}, {1790, 1955}, {2000, 2050},
};

int search_table(int x)
{
    int low = 0, high = 31;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (table[middle][0] <= x)
            low = middle;
        else
            high = middle;
    }
    int x0 = table[low][0], y0 = table[low][1];
    return y0 + (table[high][1] - y0) * (x - x0) / (table[high][0] - x0);
}

/* ---- a controller in fixed point, 16 bits after the point, with limits and a filter */

static struct {
    int32_t integral, last, filtered;
} state;
static volatile int32_t duty;

int control(int wanted, int measured)
{
    int32_t error = wanted - measured;
    int32_t rate = measured - state.last;
    state.last = measured;
    state.filtered += (rate - state.filtered) >> 3;
    state.integral += error;
    if (state.integral > 0x400000)
        state.integral = 0x400000;
    else if (state.integral < -0x400000)
        state.integral = -0x400000;
    int64_t sum = (int64_t)error * 0x28000 + (int64_t)state.integral * 0x0800 - (int64_t)state.filtered * 0x14000;
    int32_t out = (int32_t)(sum >> 16);
    if (out > 0xFFFF)
        out = 0xFFFF;
    else if (out < -0xFFFF)
        out = -0xFFFF;
    duty = out;
    return out;
}

/* ---- floating point without a unit: product, quotient and sum */

float scale(float x)
{
    return x * 0.0012345f / (x + 1.75f) - 0.25f;
}

/* ---- a model with floats kept in memory, as a compliant controller's */

float stiffness = 14.5f, damping = 0.85f, offset = 0.35f, limit = 8.0f;
static float angle, rate;
static float current;

int comply(int counts)
{
    float now = (float)counts * 0.000767f;
    rate += ((now - angle) * 1000.0f - rate) * 0.25f;
    angle = now;
    current = stiffness * (offset - angle) - damping * rate;
    if (current > limit)
        current = limit;
    if (current < -limit)
        current = -limit;
    return (int)(current * 1000.0f);
}

/* ---- bytes: a copy, and a check sum over it */

static uint8_t from[96], to[96];

int copy_and_sum(int seed)
{
    for (int i = 0; i < 96; i++)
        from[i] = (uint8_t)(seed + i * 7);
    memcpy(to, from, sizeof to);
    uint16_t sum = 0xFFFF;
    for (int i = 0; i < 96; i++) {
        sum ^= (uint16_t)(to[i] << 8);
        for (int bit = 0; bit < 8; bit++)
            sum = sum & 0x8000 ? (uint16_t)(sum << 1 ^ 0x1021) : (uint16_t)(sum << 1);
    }
    return sum;
}

/* ---- a dispatcher: a list of frames, a ring, a function by its number */

typedef struct {
    uint32_t id, low, high, stamp;
} frame;

static frame ring[16];
static unsigned head, tail;
static uint32_t variables[64];

static void store_float(const frame *f) { variables[f->id & 63] = f->low; }
static void store_int(const frame *f) { variables[f->id & 63] = f->low + f->stamp; }
static void count(const frame *f) { variables[f->id & 63] += 1; }
static void ignore(const frame *f) { (void)f; }
static void (*const handlers[4])(const frame *) = {store_float, store_int, count, ignore};
static const uint8_t kinds[64] = {0, 1, 2, 3, 0, 0, 1, 2, 3, 3, 3, 0, 1, 1, 0, 2};

int dispatch(int seed)
{
    for (int i = 0; i < 9; i++) {
        frame *f = &ring[head];
        f->id = (uint32_t)(seed + 5 * i);
        f->low = (uint32_t)(seed * i);
        f->high = 0;
        f->stamp = (uint32_t)i;
        head = (head + 1) & 15;
    }
    int handled = 0;
    while (tail != head) {
        handlers[kinds[ring[tail].id & 63]](&ring[tail]);
        tail = (tail + 1) & 15;
        handled++;
    }
    return handled + (int)variables[seed & 63];
}

/* ---- all of it, again and again: what the speed is measured on */

volatile float result;
volatile int last;

void forever(void)
{
    for (int i = 0;; i++) {
        last = search_table(i % 4000 - 2000);
        last = control(1000 * (i % 7), 900 * (i % 5) - 300);
        result = scale((float)i * 0.37f - 3.0f);
        last = comply(13 * i % 900);
        last = dispatch(i);
        if (i % 16 == 0)
            last = copy_and_sum(i);
    }
}
