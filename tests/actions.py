"""ActionResult as protobuf's own package reads and writes it, made of a description instead of a compiler."""

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from forge.cache.model import ActionResult, Digest, OutputFile

_Field = descriptor_pb2.FieldDescriptorProto

USED = {
    "Digest": {"hash": (1, "string"), "size_bytes": (2, "int64")},
    "OutputFile": {"path": (1, "string"), "digest": (2, "Digest")},
    "ActionResult": {
        "output_files": (2, "[OutputFile]"),
        "exit_code": (4, "int32"),
        "stdout_raw": (5, "bytes"),
    },
}
"""What forge uses of the messages: fields with their numbers and types."""

WHOLE = {
    **USED,
    "OutputFile": USED["OutputFile"] | {"is_executable": (4, "bool"), "contents": (5, "bytes")},
    "OutputDirectory": {"path": (1, "string"), "tree_digest": (3, "Digest")},
    "OutputSymlink": {"path": (1, "string"), "target": (2, "string")},
    "Metadata": {"worker": (1, "string")},
    "ActionResult": USED["ActionResult"]
    | {
        "output_directories": (3, "[OutputDirectory]"),
        "stdout_digest": (6, "Digest"),
        "stderr_raw": (7, "bytes"),
        "execution_metadata": (9, "Metadata"),
        "output_symlinks": (12, "[OutputSymlink]"),
    },
}
"""More of what servers and other clients put into them."""


def message_class(messages: dict[str, dict[str, tuple[int, str]]]) -> Any:
    """Return the class of ActionResult."""
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="a", syntax="proto3")
    for name, fields in messages.items():
        message = file.message_type.add(name=name)
        for field, (number, kind) in fields.items():
            inner = kind.strip("[]")
            label = _Field.LABEL_REPEATED if inner != kind else _Field.LABEL_OPTIONAL
            added = message.field.add(name=field, number=number, label=label)
            if inner in messages:
                added.type, added.type_name = _Field.TYPE_MESSAGE, f".a.{inner}"
            else:
                added.type = getattr(_Field, f"TYPE_{inner.upper()}")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("a.ActionResult"))


def as_message(result: ActionResult, kind: Any) -> Any:
    """Return a result as a message of protobuf's."""
    message = kind(stdout_raw=result.stdout)
    for file in result.files:
        digest = {"hash": file.digest.hash, "size_bytes": file.digest.size}
        message.output_files.add(path=file.path, digest=digest)
    return message


def as_result(message: Any) -> ActionResult:
    """Return what forge uses of a message."""
    files = (
        OutputFile(file.path, Digest(file.digest.hash, file.digest.size_bytes))
        for file in message.output_files
    )
    return ActionResult(tuple(files), message.stdout_raw)


def is_storable(message: Any) -> bool:
    """Apply the rules by which bazel-remote takes a result or refuses it, as far as forge uses its fields.

    Those of its function that checks an ActionResult: paths are there and relative, digests have 64 hex
    digits in lower case and no negative size.
    """
    return all(
        file.path
        and not file.path.startswith("/")
        and file.HasField("digest")
        and len(file.digest.hash) == 64
        and set(file.digest.hash) <= set("0123456789abcdef")
        and file.digest.size_bytes >= 0
        for file in message.output_files
    )
