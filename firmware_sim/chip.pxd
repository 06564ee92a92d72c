cimport cython

from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.firmware_sim.clock cimport Crystal, TickTrain
from ranger_sim.firmware_sim.vic cimport InterruptController, InterruptSource
from ranger_sim.foundation.events cimport NEVER

cpdef enum:
    PINS = 64
    ALARMS = 16
    ALARM_PLACES = 18

# Fields that nearly every event touches come first, close together.
cdef class Chip(Board):
    cdef public long long now, instant, code_time, stop_time
    cdef public long long alarm_time, alarms_set
    cdef public bint waiting, check_wait
    cdef public InterruptController vic
    cdef public double ns_per_cycle, cycles_per_ns
    cdef public TickTrain ticks
    cdef public InterruptSource tick_source
    cdef public long long tick_time, match_time
    cdef public long long[::1] pins
    cdef public long long[ALARM_PLACES] alarm_times
    cdef public long long[ALARM_PLACES] alarm_places
    cdef public long long hz
    cdef public Crystal crystal
    cdef public long long unclaimed
    cdef public list peripherals, followers
    cdef public object pwm_follower, panel
