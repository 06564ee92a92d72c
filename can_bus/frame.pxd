from ranger_sim.foundation.events cimport FLAG_EXTENDED, FLAG_REMOTE, FLAG_SINGLE_SHOT

cpdef enum:
    LENGTH_CODE = 15
    EIGHT_BYTES = 8
    SENDABLE = 0x7F
    RECEIVERS_SEE = 0x5F
    HIGHEST_STANDARD = 0x7FF
    HIGHEST_EXTENDED = 0x1FFFFFFF
    INTERMISSION_BITS = 3
    TAIL_BITS = 10
    ACK_DELIMITER_FROM_END = 8
    STANDARD_BITS = 44
    EXTENDED_BITS = 64
    ARBITRATION_END = 17
    EXTENDED_ARBITRATION_END = 41
    CRC_POLYNOMIAL = 0x4599
    CRC_BITS = 15
    CRC_MASK = 0x7FFF
    MEASURED_BITS = 0xFFFF
    MEASURED_CRC_SHIFT = 16
    DOMINANT = 0
    RECESSIVE = 1
    FIELD_ID_28_21 = 2
    FIELD_START = 3
    FIELD_SRTR = 4
    FIELD_IDE = 5
    FIELD_ID_20_18 = 6
    FIELD_ID_17_13 = 7
    FIELD_CRC = 8
    FIELD_R0 = 9
    FIELD_DATA = 10
    FIELD_DLC = 11
    FIELD_RTR = 12
    FIELD_R1 = 13
    FIELD_ID_4_0 = 14
    FIELD_ID_12_5 = 15
    FIELD_CRC_DELIMITER = 24
    FIELD_ACK_SLOT = 25
    FIELD_END = 26
    FIELD_ACK_DELIMITER = 27
    FIELD_ACTIVE_FLAG = 17
    FIELD_INTERMISSION = 18
    FIELD_TOLERATED = 19
    FIELD_PASSIVE_FLAG = 22
    FIELD_DELIMITER = 23
    FIELD_OVERLOAD_FLAG = 28
    STATE_SHIFT = 15
    STATE_MASK = 7
    RUN_MASK = 3
    LEVEL_SHIFT = 17
    STUFFED_SHIFT = 18
    IDLE = 0x20000
    STUFF_AFTER = 5
    STANDARD_HEADER_BITS = 19
    DATA_BITS = 64
    STATES = 8
    BYTES = 256
    TABLE_BYTES = 2048
    STANDARD_IDENTIFIERS = 2048
    BEGUN_CRC_SHIFT = 16
    BEGUN_STUFFED_SHIFT = 8
    BEGUN_STUFFED_MASK = 0xFF00
    STEP_STATE_SHIFT = 3
    STEP_STATE_MASK = 56
    STEP_STUFFED_SHIFT = 6
    STEP_STUFFED_MASK = 192
    STEP_PLACE_MASK = 63

cdef short CRC_OF_BYTE[TABLE_BYTES]
cdef unsigned long long STUFF[BYTES]
cdef int BEGUN[STANDARD_IDENTIFIERS]

cdef long long _feed(long long chain, long long value, long long count) noexcept
cdef long long _state(long long chain) noexcept
cdef long long _header(long long identifier, long long flags) noexcept
cdef long long _measure_bitwise(long long identifier, long long flags, long long lo, long long hi) noexcept
cdef long long _measure_by_bytes(long long identifier, long long lo, long long hi) noexcept
cpdef long long measure(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long crc15(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long frame_bits(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long arbitration_key(long long identifier, long long flags) noexcept
