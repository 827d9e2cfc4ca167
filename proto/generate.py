"""Make everything that follows from the .proto files: *_pb2.py, *_pb2.pyi and interfaces.py beside them, WIRE.md.

Run it after every edit of a .proto: `python proto/generate.py`.
"""

import hashlib
import importlib
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    EnumDescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)
from google.protobuf.message import Message
from google.protobuf.unknown_fields import UnknownFieldSet

ROOT = Path(__file__).resolve().parent
PROTOS = ROOT / "posed" / "proto"
# Output of this release loads on protobuf 6.31 to 7; that of later ones refuses protobuf 6.
COMPILER = "1.73.1"


def main() -> None:
    """Regenerate; exits with a message if the compiler is another one or a .proto lacks a comment."""
    try:
        installed = version("grpcio-tools")
    except PackageNotFoundError:
        installed = "not installed"
    if installed != COMPILER:
        sys.exit(f"grpcio-tools is {installed}, it must be {COMPILER}: pip install grpcio-tools=={COMPILER}")
    files = compile_protos()
    # Only now: what is imported must be what has just been made.
    sys.path.insert(0, str(ROOT))
    (PROTOS / "interfaces.py").write_text("\n".join(interfaces(files)) + "\n", encoding="utf-8")
    (ROOT / "WIRE.md").write_text("\n".join(wire(files)) + "\n", encoding="utf-8")


def compile_protos() -> list[FileDescriptorProto]:
    """Write the Python modules and return the descriptors, comments included."""
    for stale in PROTOS.glob("*_pb2.py*"):
        stale.unlink()
    names = sorted(str(path.relative_to(ROOT)) for path in PROTOS.glob("*.proto"))
    with tempfile.TemporaryDirectory() as directory:
        written, plain = Path(directory) / "written", Path(directory) / "plain"
        _protoc("-I.", f"--descriptor_set_out={written}", "--include_source_info", *names)
        files = FileDescriptorSet.FromString(written.read_bytes()).file
        plain.write_bytes(FileDescriptorSet(file=map(_without_our_options, files)).SerializeToString())
        _protoc(f"--descriptor_set_in={plain}", "--python_out=.", "--pyi_out=.", *names)
    by_stem = {Path(file.name).stem: file for file in files}
    return [*(by_stem.pop(stem) for stem in _READING_ORDER), *by_stem.values()]


def _protoc(*arguments: str) -> None:
    if subprocess.run([sys.executable, "-m", "grpc_tools.protoc", *arguments], cwd=ROOT).returncode != 0:
        sys.exit("protoc failed, see above")


def _without_our_options(file: FileDescriptorProto) -> FileDescriptorProto:
    """Return a file without what interfaces.py says in its place, and without the import that goes with it."""
    plain = _bare(file)
    del plain.extension[:]
    plain.dependency[:] = [name for name in file.dependency if name != "google/protobuf/descriptor.proto"]
    for service in plain.service:
        service.ClearField("options")
        for method in service.method:
            method.ClearField("options")
    return plain


def interfaces(files: list[FileDescriptorProto]) -> Iterator[str]:
    """Yield the lines of interfaces.py; its hashes are what aidl_api/<interface>/<version>/.hash is for AIDL."""
    numbers = {extension.name: extension.number for file in files for extension in file.extension}
    versions, hashes, oneway = [], [], []
    for file in files:
        behind = {each.name: _bare(each).SerializeToString() for each in _behind(file, files)}
        digest = hashlib.sha256(b"".join(behind[name] for name in sorted(behind))).hexdigest()
        for service in file.service:
            name = f"{file.package}.{service.name}"
            versions.append(f'    "{name}": {_option(service.options, numbers["interface_version"])},')
            hashes.append(f'    "{name}": "{digest}",')
            marked = [method for method in service.method if _option(method.options, numbers["oneway"])]
            oneway += [f'    "{name}.{method.name}",' for method in marked]
    yield '"""What the .proto files say of each interface. Made by `python proto/generate.py`.'
    yield ""
    yield "Kept, not found out at run time: hashlib loads OpenSSL, 3.5 MB of every process that makes a call; and who"
    yield 'reads the options needs the descriptor of descriptors, half a megabyte.\n"""\n'
    yield from ("VERSIONS = {", *versions, "}\n")
    yield from ("HASHES = {", *hashes, "}")
    yield '"""SHA-256 of the serialised descriptors behind each interface."""\n'
    yield from ("ONEWAY = {", *oneway, "}")


def _option(options: Message, number: int) -> Any:
    """Return what one of our options says, which nothing has been made to know; 0 where it is not given."""
    fields = UnknownFieldSet(options)
    return next((fields[i].data for i in range(len(fields)) if fields[i].field_number == number), 0)


def _bare(file: FileDescriptorProto) -> FileDescriptorProto:
    """Return a file as generated code holds it: without what stands in comments, or follows from the names."""
    bare = FileDescriptorProto()
    bare.CopyFrom(file)
    bare.ClearField("source_code_info")
    for field in (*bare.extension, *(field for message in bare.message_type for field in message.field)):
        field.ClearField("json_name")
    return bare


def _behind(file: FileDescriptorProto, files: list[FileDescriptorProto]) -> Iterator[FileDescriptorProto]:
    yield file
    for other in files:
        if other.name in file.dependency:
            yield from _behind(other, files)


def _module(file: FileDescriptorProto) -> Any:
    return importlib.import_module(file.name.removesuffix(".proto").replace("/", ".") + "_pb2")


def wire(files: list[FileDescriptorProto]) -> Iterator[str]:
    """Yield the lines of WIRE.md."""
    comments = {file.name: _Comments(file) for file in files}
    yield _INTRODUCTION
    yield "## Interfaces\n"
    yield _INTERFACES
    for file in files:
        yield from _services(file, comments[file.name])
    yield "## Messages\n"
    for file in files:
        name = Path(file.name).name
        yield f"### {name}\n\n{comments[file.name].of_file()}\n"
        for index, message in enumerate(file.message_type):
            yield from _message(message, comments[file.name], index)
    yield "## Enums\n"
    for file in files:
        for index, enum in enumerate(file.enum_type):
            yield from _enum(enum, comments[file.name], index)
    yield from _example()


class _Comments:
    """The comments of one .proto file by the path of what they stand at."""

    def __init__(self, file: FileDescriptorProto) -> None:
        self._file = file.name
        self._locations = {tuple(location.path): location for location in file.source_code_info.location}

    def of_file(self) -> str:
        """What stands above the syntax line."""
        return _one_line(self._locations[(FileDescriptorProto.SYNTAX_FIELD_NUMBER,)].leading_comments)

    def at(self, name: str, *path: int) -> str:
        """What stands above a declaration; exits if that is nothing."""
        text = self.if_any(*path)
        if not text:
            sys.exit(f"{self._file}: {name} has no comment; say its meaning and unit above it")
        return text

    def if_any(self, *path: int) -> str:
        """What stands above a declaration."""
        return _one_line(self._locations[path].leading_comments)


def _services(file: FileDescriptorProto, comments: _Comments) -> Iterator[str]:
    from posed.binder.interface import interface_of

    module = _module(file)
    number = FileDescriptorProto.SERVICE_FIELD_NUMBER
    for index, service in enumerate(file.service):
        interface = interface_of(module.DESCRIPTOR.services_by_name[service.name])
        yield f"### {service.name}\n"
        yield f"{comments.at(service.name, number, index)} Version {interface.version}, hash `{interface.hash}`.\n"
        yield "| code | method | request | response | meaning |\n| --- | --- | --- | --- | --- |"
        for at, declared in enumerate(service.method):
            method = interface.methods_by_name[declared.name]
            response = "none (oneway)" if method.oneway else _link(declared.output_type)
            text = _cell(comments.at(f"{service.name}.{declared.name}", number, index, 2, at))
            yield f"| {method.code} | {declared.name} | {_link(declared.input_type)} | {response} | {text} |"
        yield ""


def _message(message: DescriptorProto, comments: _Comments, index: int) -> Iterator[str]:
    number = FileDescriptorProto.MESSAGE_TYPE_FIELD_NUMBER
    yield f"#### {message.name}\n"
    explained = comments.if_any(number, index)  # a request can do without: its call explains it
    if explained:
        yield f"{explained}\n"
    if not message.field:
        yield "No fields.\n"
        return
    yield "| number | field | type | meaning |\n| --- | --- | --- | --- |"
    for at, field in enumerate(message.field):
        text = _cell(comments.at(f"{message.name}.{field.name}", number, index, 2, at))
        yield f"| {field.number} | {field.name} | {_type(message, field)} | {text} |"
    yield ""


def _enum(enum: EnumDescriptorProto, comments: _Comments, index: int) -> Iterator[str]:
    number = FileDescriptorProto.ENUM_TYPE_FIELD_NUMBER
    yield f"### {enum.name}\n\n{comments.at(enum.name, number, index)}\n"
    yield "| number | name | meaning |\n| --- | --- | --- |"
    for at, value in enumerate(enum.value):
        yield f"| {value.number} | {value.name} | {_cell(comments.at(value.name, number, index, 2, at))} |"
    yield ""


def _example() -> Iterator[str]:
    from posed.binder.interface import interface_of
    from posed.binder.parcel import encode_reply, encode_transaction
    from posed.proto import binder_pb2, sensors_pb2, service_manager_pb2

    info = interface_of(sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]).info
    manager = interface_of(service_manager_pb2.DESCRIPTOR.services_by_name["IServiceManager"])
    request = service_manager_pb2.GetServiceRequest(name="sensorservice", interface=info)
    call = encode_transaction(1, "servicemanager", manager.methods_by_name["getService"].code, _bytes(request))
    answer = service_manager_pb2.ServiceInfo(interface=info, boot_id=bytes(range(16)))
    yield "## A worked example\n"
    yield (
        'Ask for the sensor service: a Parcel with a Transaction, call_id 1, target "servicemanager", code 1 '
        f"(getService), whose payload is a GetServiceRequest. Its {len(call)} bytes are the one frame sent:\n"
    )
    yield _dump(call)
    yield "Field by field, the bytes in front of `=` being tag and, where there is one, length:\n"
    yield "```text"
    yield from _explain(binder_pb2.Parcel, call, {"Transaction.payload": service_manager_pb2.GetServiceRequest})
    yield "```\n"
    reply = encode_reply(1, binder_pb2.Status(), _bytes(answer))
    yield f"The reply of a daemon whose boot id is 00 01 .. 0f, {len(reply)} bytes, its status empty for success:\n"
    yield _dump(reply)
    yield "```text"
    yield from _explain(binder_pb2.Parcel, reply, {"Reply.payload": service_manager_pb2.ServiceInfo})
    yield "```"


def _explain(kind: Any, data: bytes, payloads: dict[str, Any], depth: int = 0) -> Iterator[str]:
    """Yield a line a field of a serialised message whose tags and lengths are small."""
    at = 0
    while at < len(data):
        field = kind.DESCRIPTOR.fields_by_number[data[at] >> 3]
        start, (size, at) = at, _varint(data, at + 1)
        head = f"{'  ' * depth}{data[start:at].hex(' ')} = {kind.DESCRIPTOR.name}.{field.name}"
        if data[start] & 7 == 0:
            yield f"{head}: {size}"
            continue
        content, at = data[at : at + size], at + size
        inner = payloads.get(f"{kind.DESCRIPTOR.name}.{field.name}")
        if inner is None and field.message_type is not None:
            inner = field.message_type._concrete_class
        if inner is not None:
            yield f"{head}, {size} bytes"
            yield from _explain(inner, content, payloads, depth + 1)
        else:
            yield f'{head}: "{content.decode()}"' if field.type == field.TYPE_STRING else f"{head}: {content.hex(' ')}"


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 0x7F) << shift
        shift += 7
        at += 1
        if data[at - 1] < 0x80:
            return value, at


def _bytes(message: Any) -> bytes:
    return bytes(message.SerializeToString(deterministic=True))


def _dump(data: bytes) -> str:
    return "```text\n" + "\n".join(data[at : at + 32].hex(" ") for at in range(0, len(data), 32)) + "\n```\n"


def _type(message: DescriptorProto, field: FieldDescriptorProto) -> str:
    name = _link(field.type_name) or FieldDescriptorProto.Type.Name(field.type).removeprefix("TYPE_").lower()
    if field.label == FieldDescriptorProto.LABEL_REPEATED:
        return f"repeated {name}"
    if field.proto3_optional:
        return f"optional {name}"
    if field.HasField("oneof_index"):
        return f"{name} (oneof {message.oneof_decl[field.oneof_index].name})"
    return name


def _link(type_name: str) -> str:
    name = type_name.rpartition(".")[2]
    return f"[{name}](#{name.lower()})" if name else ""


def _one_line(comment: str) -> str:
    return re.sub(r"\s+", " ", comment).strip()


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


_READING_ORDER = ("binder", "service_manager", "sensors", "events", "pose")

_INTRODUCTION = """\
# The wire

Everything that crosses between the daemon and its clients, enough to write a client in any language that has ZeroMQ \
and protobuf. Made by `python proto/generate.py` from the comments in `proto/posed/proto/*.proto`; edit those.

## Sockets and framing

Both sockets are Unix sockets in `$XDG_RUNTIME_DIR/posed`, or in `posed-UID` under the temporary directory where that \
variable is not set. The directory has mode 0700; a client refuses one that is a symbolic link, belongs to \
another user or can be entered by others. There is no network port.

| socket | address | daemon | client | carries |
| --- | --- | --- | --- | --- |
| control | `ipc://DIRECTORY/control.sock` | ROUTER | DEALER | calls, replies, callbacks |
| pose | `ipc://DIRECTORY/pose.sock` | XPUB | SUB | poses and truth, published |

- ZMTP 3, mechanism NULL, same user: a connection of another user is closed. Who calls (uid, pid) is what the kernel \
says of the connection, never what the client says.
- Leave the DEALER its default routing id. What comes from a chosen one is dropped.
- **Control**: one message is one frame is one serialised [Parcel](#parcel) of at most 65,536 bytes. Above 131,072 \
bytes libzmq closes the connection without a word. A message of several frames (a REQ socket sends such) is dropped.
- **Pose**: one message is one frame: the topic in ASCII, one zero byte, then a serialised message. \
`pose/PERIOD_US/FILTER` carries [PoseMessage](#posemessage), `truth/PERIOD_US/FILTER` carries \
[TruthMessage](#truthmessage). Subscribe with topic and \
zero byte exactly as [PoseRegistration](#poseregistration) gives them. The daemon's queue for a subscriber holds 10 \
messages; what finds it full is dropped, and the sequence numbers show it.
- Heartbeats: the daemon sends ZMTP pings every 900 ms on the control socket and every 3,000 ms on the pose socket, a \
client every 3,000 ms on the control socket; who does not answer for 1,000 ms is cut off. libzmq answers by itself \
unless its receive queue is full: a client that stops reading is cut off too. Set HEARTBEAT_IVL and \
HEARTBEAT_TIMEOUT, a receive high-water mark of 1,000 (never 0) and RECONNECT_IVL 100, RECONNECT_IVL_MAX 500. A \
connection must finish its handshake within 500 ms.
- Whatever the daemon knows of a client (services it got, bindings, listeners) ends with its connection. After a \
reconnect begin again with getService.

## Calls

A call is a Parcel with a [Transaction](#transaction); the answer is a Parcel with a [Reply](#reply) that repeats its \
call_id. Calls of one connection are carried out in the order sent. A oneway call has call_id 0 and no answer; \
callbacks, which the daemon sends to the object name that the client gave, are always oneway. Integers in a request \
have the units that their field states; a field that is absent has its default (0, empty).

Every object takes three calls besides its methods, before getService too:

| code | call | payload of the reply |
| --- | --- | --- |
| 0x00ffffff | version of the interface | [InterfaceInfo](#interfaceinfo) |
| 0x00fffffe | hash of the interface | [InterfaceInfo](#interfaceinfo) |
| 0x5f504e47 (`_PNG`) | ping | empty |

Before any method of another object, call [IServiceManager](#iservicemanager).getService on "servicemanager" with the \
version and hash of the interface the client was made with, as stated below. An older version is accepted; a newer \
one, and an equal version with another hash, is refused.

The daemon refuses a call by itself with these exceptions; the ones that a method raises are stated with it:

| exception_code | why |
| --- | --- |
| -2 bad parcelable | the payload is not the request message of the method; a oneway method called with a call_id |
| -3 illegal argument | no object of that name |
| -5 illegal state | a method called before getService for its object |
| -7 unsupported operation | the interface has no method with that code |
| -129 transaction failed | call or reply above 65,536 bytes; an error inside the daemon ("internal error") |

What is not a Parcel, and what would be refused but has call_id 0, is dropped and counted \
([Statistics](#statistics).parcels_refused). While replies to a client that does not read them exceed 4 MiB, further \
ones are dropped.
"""

_INTERFACES = """\
A method's code is 1 + its place in the service. The hash is the SHA-256, in lower-case hexadecimal, of the serialised \
FileDescriptorProtos, without source info and json_name, of the file that defines the service and of all posed files \
it imports, directly or not, one after the other in order of their names. A client made from the same .proto files \
states the hash printed here.
"""

if __name__ == "__main__":
    main()
