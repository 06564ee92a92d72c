"""Where every word stands in the memory that the processes share (block.py makes it), and what may stand in some.

Every word is a signed 64-bit integer in the machine's order; doubles stand in the same words.
"""

import cython

# C constants when compiled: the same numbers stand in the .pxd, and a test holds them together.
if not cython.compiled:
    SLOTS = 1024  # of each mailbox: forty times what a turn of the default scenario needs at most

    # --- a board's block: header
    MAGIC_WORD = 0
    VERSION_WORD = 1
    PLACE_WORD = 2
    SLOTS_WORD = 3
    TABLE_WORD = 4
    # the plant's words
    ASKED = 16  # how often the plant has rung
    BOARD_SLEEPS = 17
    COMMAND = 18  # one of the COMMAND_* below
    UNTIL = 19  # ns: run everything before this instant
    ASK_USED = 20  # slots in use of the mailbox to the board
    ROWS = 21  # rows of the stage that were written so far
    POWER_UP = 22  # ns: when a restarted board gets its power
    KEEP_NS = 23  # how much of its activity the board keeps for who has not asked yet; 0: as much as there is room for
    # the board's words
    ANSWERED = 32  # how often the board has rung
    PLANT_SLEEPS = 33
    RESULT = 34  # one of the RESULT_* below
    NEXT_TIME = 35  # ns: `next_time` of the board
    NEXT_OUTPUT = 36  # ns: before this instant it puts nothing out, whatever comes in of a kind that can wait
    ANSWER_USED = 37  # slots in use of the mailbox from the board
    WATCHED = 38  # `watched` of the board: of the main brain, the swing leg
    SLOT_TIME = 39  # ns: start of the latest slot
    SLOT_COUNT = 40
    OVERRUNS = 41
    MAX_SLOT_CYCLES = 42
    ERRORS = 43  # errors that the board noted, all names together
    DAMAGED = 44  # messages to the board that were not readable
    REACHED = 45  # ns: the instant up to which it has run
    LATE_MAX = 46  # ns
    LATE_COUNT = 47
    TURNS = 48
    URGENT = 49  # message kinds (bits) that the board may answer at once
    HELD = 50  # 1 while a debugger has the board, or is waited for: it keeps its turn and does not hang
    RING_ROWS = 51  # slots that were written into the ring so far; the latest may not have ended yet
    # the supervisor's words
    LET_GO = 55  # 1: the run is to end, debuggers have to let the board go
    FATE = 56  # ALIVE or GONE: nobody will answer
    ALIVE = 0
    GONE = 1
    # where a program in C was when a signal ended its process: firmware_sim/native/crash.py
    CRASH = 57
    CRASH_WORDS = 7
    # text of what ended the process, UTF-8, its length in bytes in the first word
    FAULT_TEXT = 64
    FAULT_WORDS = 64
    LATENESS = 128  # see lateness.py
    LATENESS_WORDS = 1344
    TABLE = 1472  # LATENESS + LATENESS_WORDS: the main brain's data table, then the two mailboxes

    # behind both mailboxes: a ring of the latest slots, a row each
    RING = 512  # a quarter of a second of the fastest board; who looks comes 50 times a second of the robot
    RING_ROW = 3
    RING_START = 0  # ns: when its tick was due
    RING_CYCLES = 1  # to the end of its last task; 0 as long as it has not ended
    RING_LATE = 2  # ns: how late it was computed by the wall clock; -1 where no pace is kept

    COMMAND_ADVANCE = 1
    COMMAND_MORE = 2
    COMMAND_COUNTERS = 3
    COMMAND_STOP = 4
    COMMAND_ACTIVITY = 5
    RESULT_DONE = 0
    RESULT_MORE = 1

    # --- the stage: header, pace, then a ring of rows, one per step of the plant
    STAGE_ROWS = 2  # rows written so far
    PACED = 3  # 1 when virtual time follows the wall clock
    PACE_WALL_NS = 4  # monotonic clock when virtual time was PACE_TIME_NS
    PACE_TIME_NS = 5
    PACE_WALL_PER_TIME = 6  # a double: 1 / speed
    PACE_BEGUN_NS = 7  # monotonic clock when the pace last began anew, or was set on because a debugger held a board
    HEARTBEAT_NS = 8  # monotonic clock when the plant process last went round its loop
    STAGE_FIRST = 64
    STAGE_RING = 64
    ROW_START = 0
    ROW_END = 1
    ROW_WORDS = 2
    ROW_ANALOG_START = 16
    ROW_ANALOG_END = 48
    ROW_SIZE = 80
    MOST_WORDS = 14
    MOST_VOLTAGES = 32

    # --- payloads of messages, in words
    SSP_WORDS = 32  # 31 half-words of a segment, and how many are used:
    SSP_USED = 31  # the place of that
    NOTE_WORDS = 256  # 2 KB: a length in bytes and the bytes

    # --- the row of a kind in kinds.limits()
    DIRECTION = 0  # TO_BOARD, FROM_BOARD, or -1 for no kind
    LEAST_PAYLOAD = 1  # words
    MOST_PAYLOAD = 2
    RANGES = 3  # least and largest of field a, of b ... of f
    LIMIT_SIZE = 15  # numbers per kind
