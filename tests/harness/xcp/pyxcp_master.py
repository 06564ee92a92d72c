"""pyxcp as the master, in a separate process; prints what it found as JSON.

Arguments: the port of UDP, or the channel of python-can's interface ranger_sim with the two identifiers behind it, as
"robot/can2,2000,2001"; then three addresses.
"""

import json
import logging
import struct
import sys
import threading

from pyxcp.config import create_application_from_config, set_application
from pyxcp.daq_stim import DaqList, DaqOnlinePolicy
from pyxcp.master import Master
from pyxcp.master.errorhandler import SystemExit as Refused
from pyxcp.types import XcpResponseError


class Kept(DaqOnlinePolicy):
    """Keeps what a list brings."""

    rows: list = []
    enough = threading.Event()

    def on_daq_list(self, daq_list, timestamp0, timestamp1, payload):
        self.rows.append((timestamp1, *payload))
        if len(self.rows) >= 200:
            self.enough.set()


def refusal(master, address, value):
    """The error with which a write is refused, or None."""
    master.setMta(address)
    try:
        master.download(struct.pack("<f", value))
    except (XcpResponseError, Refused) as error:
        return repr(error)
    return None


where = sys.argv[1]
first, second, parameter = map(int, sys.argv[2:])
if where.isdecimal():
    layer = "eth"
    transport = {"Eth": {"host": "127.0.0.1", "port": int(where), "protocol": "UDP"}}
else:
    layer = "can"
    channel, master_id, slave_id = where.split(",")
    transport = {
        "CAN": {
            "interface": "ranger_sim",
            "channel": channel,
            "bitrate": 3_000_000,
            "can_id_master": int(master_id),
            "can_id_slave": int(slave_id),
        }
    }
application = create_application_from_config({"Transport": transport, "General": {}}, logging.ERROR)
set_application(application)
application.transport.layer = layer.upper()
kept = Kept(
    [
        DaqList(
            name="fast",
            event_num=0,
            stim=False,
            enable_timestamps=True,
            priority=0,
            prescaler=1,
            measurements=[("first", first, 0, "U32"), ("second", second, 0, "F32")],
        )  # fmt: skip
    ]
)
with Master(layer, config=application, policy=kept) as master:
    master.connect()
    found = {"name": master.identifier(1)}
    kept.setup(write_multiple=False)
    kept.start()
    kept.enough.wait()
    kept.stop()
    found["refused"] = refusal(master, parameter, 1e9)
    found["measured_refused"] = refusal(master, first, 1.0)
    found["accepted"] = refusal(master, parameter, 0.5)
    found["now"] = struct.unpack("<f", bytes(master.shortUpload(4, parameter)))[0]
    found["rows"] = kept.rows
    master.disconnect()
print("FOUND " + json.dumps(found))
