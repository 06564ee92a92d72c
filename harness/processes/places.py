"""The place of every word in the memory that the processes share (block.py makes it), and the ranges of some.

Every word is a signed 64-bit integer in the machine's byte order; doubles occupy the same words.
"""

from typing import Final

import cython  # noqa: F401  (compiled: its constants are C constants for other modules)

SLOTS: Final = 1024  # of each mailbox: forty times the most that a turn of the default scenario needs

# --- a board's block: header
MAGIC_WORD: Final = 0
VERSION_WORD: Final = 1
PLACE_WORD: Final = 2
SLOTS_WORD: Final = 3
TABLE_WORD: Final = 4
# the plant's words
ASKED: Final = 16  # how often the plant has rung
BOARD_SLEEPS: Final = 17
COMMAND: Final = 18  # one of the COMMAND_* below
UNTIL: Final = 19  # ns: run everything before this time
ASK_USED: Final = 20  # slots in use of the mailbox to the board
ROWS: Final = 21  # rows of the stage that were written so far
POWER_UP: Final = 22  # ns: when a restarted board gets its power
KEEP_NS: Final = 23  # how much of its activity the board keeps for later readers; 0: as much as fits
FRAMES_ONLY: Final = 24  # 1: nothing but its controllers is connected, and its other outputs are not sent
# the board's words
ANSWERED: Final = 32  # how often the board has rung
PLANT_SLEEPS: Final = 33
RESULT: Final = 34  # one of the RESULT_* below
NEXT_TIME: Final = 35  # ns: `next_time` of the board
NEXT_OUTPUT: Final = 36  # ns: before this time it puts nothing out, whatever inputs arrive of a kind that can wait
ANSWER_USED: Final = 37  # slots in use of the mailbox from the board
WATCHED: Final = 38  # `watched` of the board: of the main brain, the swing leg
SLOT_TIME: Final = 39  # ns: start of the latest slot
SLOT_COUNT: Final = 40
OVERRUNS: Final = 41
MAX_SLOT_CYCLES: Final = 42
ERRORS: Final = 43  # errors that the board recorded, all names together
DAMAGED: Final = 44  # messages to the board that were not readable
REACHED: Final = 45  # ns: the time up to which it has run
LATE_MAX: Final = 46  # ns
LATE_COUNT: Final = 47
TURNS: Final = 48
URGENT: Final = 49  # message kinds (bits) that the board may answer at once
HELD: Final = 50  # 1 while a debugger has the board, or is awaited: it keeps its turn and does not hang
RING_ROWS: Final = 51  # slots that were written into the ring so far; the latest may not have ended yet
NEXT_TRANSMIT: Final = 52  # ns: before this time it puts nothing on a bus, unless an urgent message arrives
# the supervisor's words
LET_GO: Final = 55  # 1: the run is to end, debuggers have to let the board go
# where a program in C was when a signal ended its process: firmware_sim/native/crash.py
CRASH: Final = 57
CRASH_WORDS: Final = 7
# text of what ended the process, UTF-8, its length in bytes in the first word
FAULT_TEXT: Final = 64
FAULT_WORDS: Final = 64
LATENESS: Final = 128  # see lateness.py
LATENESS_WORDS: Final = 1344
TABLE: Final = 1472  # LATENESS + LATENESS_WORDS: the main brain's data table, then the two mailboxes

# after both mailboxes: a ring of the latest slots, a row each
RING: Final = 512  # a quarter of a second of the fastest board; readers poll 50 times a second of the robot
RING_ROW: Final = 3
RING_START: Final = 0  # ns: when its tick was due
RING_CYCLES: Final = 1  # to the end of its last task; 0 as long as it has not ended
RING_LATE: Final = 2  # ns: how late it was computed by the wall clock; -1 where no pace is kept

COMMAND_ADVANCE: Final = 1
COMMAND_MORE: Final = 2
COMMAND_COUNTERS: Final = 3
COMMAND_STOP: Final = 4
COMMAND_ACTIVITY: Final = 5
RESULT_DONE: Final = 0
RESULT_MORE: Final = 1

# --- a board's private words: memory that its own process does not have, so that no program can feign an answer
FATE: Final = 0  # ALIVE or GONE: no process will answer
ALIVE: Final = 0
GONE: Final = 1
AWAITED: Final = 1  # 1 while the process that passes time waits for the board's answer
WAITS: Final = 2  # how often it has waited for one
PRIVATE_WORDS: Final = 3

# --- the stage: header, pace, then a ring of rows, one per step of the plant
STAGE_ROWS: Final = 2  # rows written so far
PACED: Final = 3  # 1 when virtual time follows the wall clock
PACE_WALL_NS: Final = 4  # monotonic clock when virtual time was PACE_TIME_NS
PACE_TIME_NS: Final = 5
PACE_WALL_PER_TIME: Final = 6  # a double: 1 / speed
PACE_BEGUN_NS: Final = 7  # monotonic clock when the pace last restarted, or a debugger that held a board moved it on
HEARTBEAT_NS: Final = 8  # monotonic clock when the plant process last ran its loop
STAGE_FIRST: Final = 64
STAGE_RING: Final = 64
ROW_START: Final = 0
ROW_END: Final = 1
ROW_WORDS: Final = 2
ROW_ANALOG_START: Final = 16
ROW_ANALOG_END: Final = 48
ROW_SIZE: Final = 80
MOST_WORDS: Final = 14
MOST_VOLTAGES: Final = 32

# --- payloads of messages, in words
SSP_WORDS: Final = 32  # 31 half-words of a segment, and how many are used:
SSP_USED: Final = 31  # the place of that number
NOTE_WORDS: Final = 256  # 2 KB: a length in bytes and the bytes
FRAME_WORDS: Final = 9  # 64 bytes of a CAN FD frame, and how many are used

# --- the row of a kind in kinds.limits()
DIRECTION: Final = 0  # TO_BOARD, FROM_BOARD, or -1 for an unknown kind
LEAST_PAYLOAD: Final = 1  # words
MOST_PAYLOAD: Final = 2
RANGES: Final = 3  # least and largest of field a, of b ... of f
LIMIT_SIZE: Final = 15  # numbers per kind
