"""Messages of a recording read by the libraries of others: mcap for the file, Google's protobuf for what
is in it."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, unknown_fields
from mcap.reader import make_reader


def messages(path: Path, *topics: str) -> Iterator[tuple[str, int, Any]]:
    """Topic, log time and message (protobuf, or what JSON says), as the schemas in the file describe them."""
    kinds: dict[int, Any] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(topics or None):
            assert schema is not None
            if channel.message_encoding == "json":
                assert schema.encoding == "jsonschema"
                body = json.loads(message.data)
                assert set(body) <= set(json.loads(schema.data)["properties"])
                yield channel.topic, message.log_time, body
                continue
            assert (channel.message_encoding, schema.encoding) == ("protobuf", "protobuf")
            if schema.id not in kinds:
                files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
                pool = descriptor_pool.DescriptorPool()
                for each in files.file:
                    pool.Add(each)
                kinds[schema.id] = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            told = kinds[schema.id].FromString(message.data)
            assert not len(unknown_fields.UnknownFieldSet(told))
            yield channel.topic, message.log_time, told


def sample_rows(told: Any) -> list[tuple[int, ...]]:
    """index, t_us, ax, ay, enc1, enc2, flags of each sample of a message, as docs/recording.md says."""
    count = 1 + len(told.ax_steps)
    columns = {}
    for name in ("ax", "ay", "enc1", "enc2"):
        values = [getattr(told, name)]
        for step in getattr(told, f"{name}_steps"):
            values.append((values[-1] + step + 2**31) % 2**32 - 2**31)
        columns[name] = values
    flags = [told.flags, *(told.flags_rest or [told.flags] * (count - 1))]
    return [
        (told.index + i, told.t_us + 1000 * i, *(columns[name][i] for name in columns), flags[i])
        for i in range(count)
    ]
