"""Writes body and signals of a timeline as MCAP, for Foxglove and PlotJuggler: protobuf messages, one topic per group.

`/body` and `/variables/MCH` ... A message has every quantity of its group as a double, by name; units are in the names
of the body's, and in the channel's metadata of all. Time is virtual, from the start of the run.

`/events` has steps, falls, faults and overruns as messages of the type `foxglove.Log`, for Foxglove's log panel.
"""

import importlib
from typing import IO, Any

import numpy as np

from ranger_sim.harness.timeline.model import Counter, Events

PACKAGE = "ranger_sim"
LOG_LEVELS = {"UNKNOWN": 0, "DEBUG": 1, "INFO": 2, "WARNING": 3, "ERROR": 4, "FATAL": 5}  # of foxglove.Log


def write(events: Events, file: IO[bytes], title: str) -> None:
    """Write the whole timeline into `file`; `title` is kept as metadata. The same timeline gives the same bytes."""
    writer = importlib.import_module("mcap.writer").Writer(file)
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
    messages += log_messages(writer, events)
    messages.sort(key=lambda message: message[:2])
    for time, channel, text in messages:
        writer.add_message(channel, log_time=time, publish_time=time, data=text)
    writer.finish()


def message_type(name: str, fields: list[str]) -> tuple[Any, bytes]:
    """(class of a message of doubles, its description for MCAP)."""
    descriptor_pb2 = importlib.import_module("google.protobuf.descriptor_pb2")
    pool = importlib.import_module("google.protobuf.descriptor_pool").DescriptorPool()
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
    made = importlib.import_module("google.protobuf.message_factory").GetMessageClass(found)
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


def log_messages(writer: Any, events: Events) -> list[tuple[int, int, bytes]]:
    """(ns, channel, message) of every event at one moment; the channel exists only if it has an event."""
    if not any(instants.events for instants in events.instants):
        return []
    log_class, descriptors = log_type()
    schema = writer.register_schema(log_class.DESCRIPTOR.full_name, "protobuf", descriptors)
    channel = writer.register_channel("/events", "protobuf", schema)
    found = []
    for instants in events.instants:
        for event in instants.events:
            notes = ", ".join(f"{name} {value}" for name, value in event.notes.items())
            log = log_class(
                level=level_of(instants.path, event.name),
                message=f"{event.name} ({notes})" if notes else event.name,
                name=" ".join(instants.path),
            )
            log.timestamp.seconds, log.timestamp.nanos = divmod(event.time_ns, 1_000_000_000)
            found.append((event.time_ns, channel, log.SerializeToString()))
    return found


def level_of(path: tuple[str, ...], name: str) -> int:
    """The log level: a fall is an error, faults and overruns warn, steps inform."""
    if path == ("Steps",):
        return LOG_LEVELS["ERROR"] if name.startswith("fell") else LOG_LEVELS["INFO"]
    return LOG_LEVELS["WARNING"]


def log_type() -> tuple[Any, bytes]:
    """(class of `foxglove.Log`, its description with its dependencies), field by field as Foxglove published it."""
    descriptor_pb2 = importlib.import_module("google.protobuf.descriptor_pb2")
    kinds = descriptor_pb2.FieldDescriptorProto
    stamp = descriptor_pb2.FileDescriptorProto()
    importlib.import_module("google.protobuf.timestamp_pb2").DESCRIPTOR.CopyToProto(stamp)
    described = descriptor_pb2.FileDescriptorProto(name="foxglove/Log.proto", package="foxglove", syntax="proto3")
    described.dependency.append(stamp.name)
    log = described.message_type.add(name="Log")
    levels = log.enum_type.add(name="Level")
    for level, number in LOG_LEVELS.items():
        levels.value.add(name=level, number=number)
    for number, (field, kind, of) in enumerate(
        (
            ("timestamp", kinds.TYPE_MESSAGE, ".google.protobuf.Timestamp"),
            ("level", kinds.TYPE_ENUM, ".foxglove.Log.Level"),
            ("message", kinds.TYPE_STRING, None),
            ("name", kinds.TYPE_STRING, None),
            ("file", kinds.TYPE_STRING, None),
            ("line", kinds.TYPE_FIXED32, None),
        ),
        start=1,
    ):
        log.field.add(name=field, number=number, type=kind, type_name=of, label=kinds.LABEL_OPTIONAL)
    pool = importlib.import_module("google.protobuf.descriptor_pool").DescriptorPool()
    pool.Add(stamp)
    pool.Add(described)
    factory = importlib.import_module("google.protobuf.message_factory")
    made = factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.Log"))
    return made, descriptor_pb2.FileDescriptorSet(file=[stamp, described]).SerializeToString()
