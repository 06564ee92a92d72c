"""Writes body and signals of a timeline as MCAP, for Foxglove and PlotJuggler: protobuf messages, one topic a group.

`/body` and `/variables/MCH` ... A message has every quantity of its group as a double, by name; units are in the names
of the body's, and in the channel's metadata of all. Time is virtual, from the start of the run.
"""

from typing import IO, Any

import numpy as np

from ranger_sim.foundation.libraries import imported
from ranger_sim.harness.timeline.model import Counter, Events

PACKAGE = "ranger_sim"


def write(events: Events, file: IO[bytes], title: str) -> None:
    """The whole timeline into `file`; `title` is kept as metadata. The same timeline gives the same bytes."""
    writer = imported("mcap.writer").Writer(file)
    writer.start(profile="", library="ranger-sim")
    writer.add_metadata("run", {"title": title})
    groups: dict[tuple[str, ...], list[Counter]] = {}
    for counter in events.counters:
        if counter.path[0] in ("Body", "Variables"):
            groups.setdefault(counter.path[:-1], []).append(counter)
    messages = []
    for path, counters in groups.items():
        message_class, descriptors = message_type("".join(path), [counter.path[-1] for counter in counters])
        schema = writer.register_schema(message_class.DESCRIPTOR.full_name, "protobuf", descriptors)
        units = {counter.path[-1]: counter.unit for counter in counters if counter.unit}
        channel = writer.register_channel("/" + "/".join((path[0].lower(), *path[1:])), "protobuf", schema, units)
        messages += [(time, channel, text) for time, text in rows(message_class, counters)]
    messages.sort(key=lambda message: message[:2])
    for time, channel, text in messages:
        writer.add_message(channel, log_time=time, publish_time=time, data=text)
    writer.finish()


def message_type(name: str, fields: list[str]) -> tuple[Any, bytes]:
    """(class of a message of doubles, the description of it that MCAP keeps)."""
    descriptor_pb2 = imported("google.protobuf.descriptor_pb2")
    pool = imported("google.protobuf.descriptor_pool").DescriptorPool()
    described = descriptor_pb2.FileDescriptorProto(name=f"{PACKAGE}/{name}.proto", package=PACKAGE, syntax="proto3")
    message = described.message_type.add(name=name)
    for number, field in enumerate(fields, start=1):
        message.field.add(
            name=field,
            number=number,
            type=descriptor_pb2.FieldDescriptorProto.TYPE_DOUBLE,
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
        )
    pool.Add(described)
    found = pool.FindMessageTypeByName(f"{PACKAGE}.{name}")
    made = imported("google.protobuf.message_factory").GetMessageClass(found)
    return made, descriptor_pb2.FileDescriptorSet(file=[described]).SerializeToString()


def rows(message_class: Any, counters: list[Counter]) -> list[tuple[int, bytes]]:
    """(ns, message) whenever one of them changed, with the latest of all; those without one yet are left out."""
    times = np.unique(np.concatenate([counter.time_ns for counter in counters]))
    names = [counter.path[-1] for counter in counters]
    columns = []
    for counter in counters:
        place = np.searchsorted(counter.time_ns, times, side="right") - 1
        latest = np.asarray(counter.values, dtype=np.float64)[np.maximum(place, 0)]
        columns.append(np.where(place >= 0, latest, np.nan).tolist())
    found = []
    for time, *values in zip(times.tolist(), *columns, strict=True):
        known = {name: value for name, value in zip(names, values, strict=True) if value == value}
        found.append((time, message_class(**known).SerializeToString()))
    return found
