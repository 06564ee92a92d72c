"""TDMS files of LabVIEW: the channels of every group, at the stamps of their waveform or of a time channel."""

import pathlib
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Dataset, Finding, Loss
from ranger_sim.sysid.readers.arrays import Arrays

UNITS = ("unit_string", "NI_UnitDescription", "Unit")
STEP, OFFSET, START = "wf_increment", "wf_start_offset", "wf_start_time"


def read(dataset: Dataset, arrays: Arrays, library: Any, path: pathlib.Path, most_numbers: int) -> None:
    """Add the arrays of a file; where a waveform gives the stamps, a time for each channel.

    UserError for a file that unpacks to more than `most_numbers`.
    """
    with library.TdmsFile.open(path) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        count = sum(len(each) for each in channels)
        if count > most_numbers:
            raise DataError(f"{path}: it unpacks to {count} numbers, allowed are {most_numbers}")
        groups = {each.group_name for each in channels if len(each)}
        begins = [each.properties[START] for each in channels if START in each.properties and len(each)]
        first = min(begins, default=None)
        for each in channels:
            name = each.name if len(groups) == 1 else f"{each.group_name}.{each.name}"
            unit = next((str(each.properties[key]) for key in UNITS if each.properties.get(key)), "")
            value = each[:] if len(each) else np.empty(0)
            step = float(each.properties.get(STEP, 0.0))
            if step <= 0.0 or not len(each):
                arrays.add(name, value, unit)
                continue
            begin_s = float(each.properties.get(OFFSET, 0.0))
            if first is not None and START in each.properties:
                begin_s += float((each.properties[START] - first) / np.timedelta64(1, "ns")) * 1e-9
            arrays.own_times[name] = begin_s + step * np.arange(len(value), dtype=np.float64)
            arrays.add(name, value, unit)
        if file.file_status.incomplete_final_segment:
            statuses = (file.file_status.channel_statuses or {}).values()
            missing = max(1, sum(each.expected_length - each.read_length for each in statuses))
            dataset.rows += missing
            dataset.losses.append(Loss("cut_off", missing, "in the last segment"))
            text = f"the file is cut off: its last segment lacks {missing} samples"
            dataset.findings.append(Finding("", "cut_off", 0.0, 0.0, float(missing), "samples", text))
