"""A small good table in the format of the master files, for tests that spoil it."""

import pathlib

BOARDS = """\
[buses]
SSP = { channel = 0, bit_rate = 3_000_000 }
CAN1 = { channel = 1, bit_rate = 3_000_000 }
CAN2 = { channel = 2, bit_rate = 3_000_000 }

[boards.PC]
number = 0
role = "computer"
description = "a laptop"
firmware = false

[boards.MB]
number = 1
role = "main brain"
description = "a brain"
buses = ["SSP"]
firmware = true
slot_us = 2000
rows = [[]]

[boards.CSR]
number = 2
role = "router"
description = "a router"
buses = ["SSP", "CAN1", "CAN2"]
sends_itself = ["TIME"]
firmware = true
slot_us = 1000
every = ["TIME"]
rows = [[]]

[boards.LEG]
number = 3
description = "a leg"
ribbon = 0
controller = 1
buses = ["CAN1"]
firmware = true
slot_us = 500
rows = [["LEG_ANGLE"], []]
occasional_row = 1
occasional = ["LEG_CURRENT", "(housekeeping)"]

[boards.KEYS]
number = 4
description = "a keypad"
ribbon = 0
controller = 2
buses = ["CAN2"]
firmware = true
slot_us = 1000
rows = [["KEYS_DOWN"]]
"""

VARIABLES = """\
id,name,type,unit,initial,publisher,subscribers,bus,period_ms,minimum,maximum,description
0,TIME,u32,ms,0,CSR,MB;LEG;KEYS,CAN1;CAN2;SSP,1,,,time of all
1,LEG_ANGLE,f32,rad,0.5,LEG,MB;PC,CAN1;SSP,1,-3,3,an angle
2,LEG_CURRENT,f32,A,0,LEG,MB,CAN1;SSP,3,-12.5,12.5,a current
3,LEG_COMMAND,f32,A,0,MB,LEG,CAN1;SSP,,,,a command
4,KEYS_DOWN,i32,,0,KEYS,MB;LEG,CAN1;CAN2;SSP,1,0,63,keys
5,GAIN,f32,,1.5,PC,MB,,,,,a parameter
6,SPEED,f32,m/s,0,MB,PC,,,,,"an estimate, inside"
"""

ERRORS = """\
id,name,boards,normal_per_s,normal_at_start,description
0,NOTHING,MB;LEG,LEG:0.5,,no error
1,TOO_HOT,LEG,,,the leg is hot
"""


def write(folder: pathlib.Path, boards=BOARDS, variables=VARIABLES, errors=ERRORS) -> pathlib.Path:
    """Write the three files (text or bytes; None leaves one out) and return the folder."""
    for name, content in (("boards.toml", boards), ("variables.csv", variables), ("errors.csv", errors)):
        path = folder / name
        path.unlink(missing_ok=True)
        if content is not None:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder
