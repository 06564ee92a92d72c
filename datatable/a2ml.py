"""The grammar of `IF_DATA XCP` in the description for calibration programs, in A2ML.

It has the tags, types and values that ASAM MCD-1 XCP (part 2 for the common parameters, part 3 for CAN and for UDP)
gives them, as far as our IF_DATA uses them: a program that knows the standard finds its names, and one that does not
can read the blocks with this text.
"""

from __future__ import annotations

# Optional commands with their codes (part 2, table of commands). The slave implements them in harness/xcp/slave.py
COMMANDS = {
    "GET_COMM_MODE_INFO": 0xFB,
    "GET_ID": 0xFA,
    "SET_MTA": 0xF6,
    "UPLOAD": 0xF5,
    "SHORT_UPLOAD": 0xF4,
    "BUILD_CHECKSUM": 0xF3,
    "TRANSPORT_LAYER_CMD": 0xF2,
    "DOWNLOAD": 0xF0,
    "DOWNLOAD_NEXT": 0xEF,
    "SHORT_DOWNLOAD": 0xED,
    "SET_DAQ_PTR": 0xE2,
    "WRITE_DAQ": 0xE1,
    "SET_DAQ_LIST_MODE": 0xE0,
    "GET_DAQ_LIST_MODE": 0xDF,
    "START_STOP_DAQ_LIST": 0xDE,
    "START_STOP_SYNCH": 0xDD,
    "GET_DAQ_CLOCK": 0xDC,
    "GET_DAQ_PROCESSOR_INFO": 0xDA,
    "GET_DAQ_RESOLUTION_INFO": 0xD9,
    "GET_DAQ_LIST_INFO": 0xD8,
    "GET_DAQ_EVENT_INFO": 0xD7,
    "FREE_DAQ": 0xD6,
    "ALLOC_DAQ": 0xD5,
    "ALLOC_ODT": 0xD4,
    "ALLOC_ODT_ENTRY": 0xD3,
    "WRITE_DAQ_MULTIPLE": 0xC7,
}
UNITS = ("1NS", "10NS", "100NS", "1US", "10US", "100US", "1MS", "10MS", "100MS", "1S")  # codes 0 ... 9


def enumeration(values: dict[str, int]) -> str:
    """An enum of A2ML, in one line."""
    return "enum { " + ", ".join(f'"{name}" = {value}' for name, value in values.items()) + " }"


A2ML = f"""\
/begin A2ML
  struct Protocol_Layer {{
    uint;  /* version of the protocol layer */
    uint; uint; uint; uint; uint; uint; uint;  /* time limits T1 ... T7, ms */
    uchar;  /* MAX_CTO, bytes */
    uint;  /* MAX_DTO, bytes */
    {enumeration({"BYTE_ORDER_MSB_LAST": 0, "BYTE_ORDER_MSB_FIRST": 1})};
    {enumeration({"ADDRESS_GRANULARITY_BYTE": 1, "ADDRESS_GRANULARITY_WORD": 2, "ADDRESS_GRANULARITY_DWORD": 4})};
    taggedstruct {{
      ("OPTIONAL_CMD" {enumeration(COMMANDS)})*;
      "COMMUNICATION_MODE_SUPPORTED" taggedunion {{
        "BLOCK" taggedstruct {{
          "SLAVE";
          "MASTER" struct {{ uchar; uchar; }};  /* most packets of a block, shortest pause between two in 100 us */
        }};
        "INTERLEAVED" uchar;
      }};
    }};
  }};
  struct Daq {{
    {enumeration({"STATIC": 0, "DYNAMIC": 1})};
    uint; uint; uchar;  /* lists, events, lists that are there already */
    {enumeration({"OPTIMISATION_TYPE_DEFAULT": 0})};
    {enumeration({"ADDRESS_EXTENSION_FREE": 0, "ADDRESS_EXTENSION_ODT": 1, "ADDRESS_EXTENSION_DAQ": 3})};
    {enumeration({"IDENTIFICATION_FIELD_TYPE_ABSOLUTE": 0})};
    {enumeration({"GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE": 1, "GRANULARITY_ODT_ENTRY_SIZE_DAQ_WORD": 2})};
    uchar;  /* bytes of an entry at most */
    {enumeration({"NO_OVERLOAD_INDICATION": 0, "OVERLOAD_INDICATION_PID": 1, "OVERLOAD_INDICATION_EVENT": 2})};
    taggedstruct {{
      "PRESCALER_SUPPORTED";
      block "TIMESTAMP_SUPPORTED" struct {{
        uint;  /* ticks of a count */
        {enumeration({"NO_TIME_STAMP": 0, "SIZE_BYTE": 1, "SIZE_WORD": 2, "SIZE_DWORD": 4})};
        {enumeration({f"UNIT_{unit}": code for code, unit in enumerate(UNITS)})};
        taggedstruct {{ "TIMESTAMP_FIXED"; }};
      }};
      (block "EVENT" struct {{
        char[101]; char[9]; uint;  /* name, short name, number */
        {enumeration({"DAQ": 1, "STIM": 2, "DAQ_STIM": 3})};
        uchar; uchar; uchar; uchar;  /* lists, cycle, unit of the cycle, priority */
        taggedstruct {{ "CONSISTENCY" {enumeration({"DAQ": 0, "EVENT": 1})}; }};
      }})*;
    }};
  }};
  struct Can {{
    uint;  /* version of the transport layer */
    taggedstruct {{
      "CAN_ID_BROADCAST" ulong;
      "CAN_ID_MASTER" ulong;
      "CAN_ID_SLAVE" ulong;
      "BAUDRATE" ulong;  /* bit/s */
      "SAMPLE_POINT" uchar;  /* % */
      "SAMPLE_RATE" {enumeration({"SINGLE": 1, "TRIPLE": 3})};
      "BTL_CYCLES" uchar;
      "SJW" uchar;
      "MAX_DLC_REQUIRED";
    }};
  }};
  struct Udp {{
    uint;  /* version of the transport layer */
    uint;  /* port */
    taggedunion {{ "HOST_NAME" char[256]; "ADDRESS" char[15]; }};
  }};
  taggedstruct Common_Parameters {{
    block "PROTOCOL_LAYER" struct Protocol_Layer;
    block "DAQ" struct Daq;
    block "DAQ_EVENT" taggedunion {{
      "VARIABLE" taggedstruct {{
        block "DEFAULT_EVENT_LIST" taggedstruct {{ ("EVENT" uint)*; }};
      }};
    }};
  }};
  block "IF_DATA" taggedunion if_data {{
    "XCP" struct {{
      taggedstruct Common_Parameters;
      taggedstruct {{
        block "XCP_ON_CAN" struct {{ struct Can; taggedstruct Common_Parameters; }};
        block "XCP_ON_UDP_IP" struct {{ struct Udp; taggedstruct Common_Parameters; }};
      }};
    }};
  }};
/end A2ML
"""
