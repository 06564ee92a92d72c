cimport cython

from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.vic cimport SSP_INPUT
from ranger_sim.firmware_sim.peripherals.adc_external cimport START, Ads7871
from ranger_sim.firmware_sim.peripherals.ssp cimport SspDevice, SspSegment
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport SSP_START

cpdef enum:
    DEPTH = 8
    WORD_ALARM = 0
    SILENCE_ALARM = 1
    SILENT_BITS = 32
    SR_TFE = 1
    SR_TNF = 2
    SR_RNE = 4
    SR_RFF = 8
    SR_BSY = 16
    ROR = 1
    RT = 2
    RX = 4
    TX = 8
    CR1_LOOPBACK = 1
    CR1_ENABLE = 2
    CR1_SLAVE = 4

@cython.final
cdef class SerialConverter(SspDevice):
    cdef public Ads7871 adc

@cython.final
cdef class SegmentLink(SspDevice):
    cdef public long long sent, interval_ns, earliest
    cdef public list words, coming, came
    cdef public SspSegment going
    cdef public Alarm alarm
    cpdef object _start(self, time)

@cython.final
cdef class SspBlock(Block):
    cdef public SspDevice device
    cdef public long long CR0, CR1, CPSR, IMSC, flags
    cdef public long long[8] going, came
    cdef public long long going_count, came_count, word, word_ns, bit_ns, words
    cdef public bint busy
    cdef public Alarm word_alarm, silence_alarm
    cdef long long raw(self) noexcept
    cpdef object _set_rate(self)
    cdef int _start(self, long long time) except -1
