"""The generated modules and the wire document are those of the .proto files, and the document is true."""

import importlib.util
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from binder_harness import RawClient, ServerThread

from posed.binder.interface import interface_of
from posed.proto import binder_pb2, events_pb2, pose_pb2, sensors_pb2, service_manager_pb2

PROTO = Path(__file__).parents[2] / "proto"
FILES = [module.DESCRIPTOR for module in (binder_pb2, service_manager_pb2, sensors_pb2, events_pb2, pose_pb2)]
WIRE = (PROTO / "WIRE.md").read_text(encoding="utf-8")

needs_compiler = pytest.mark.skipif(
    importlib.util.find_spec("grpc_tools") is None, reason="grpcio-tools makes the modules; install posed[test]"
)


def generate(proto: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(proto / "generate.py")]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def generated(proto: Path) -> dict[str, bytes]:
    made = proto / "posed" / "proto"
    files = [*made.glob("*_pb2.py*"), made / "interfaces.py", proto / "WIRE.md"]
    return {file.name: file.read_bytes() for file in files}


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The proto directory without what is generated."""
    ignore = shutil.ignore_patterns("__pycache__", "*_pb2.py*", "interfaces.py", "WIRE.md")
    return Path(shutil.copytree(PROTO, tmp_path / "proto", ignore=ignore))


@needs_compiler
def test_committed_files_are_a_fresh_generation(copy: Path) -> None:
    run = generate(copy)
    assert (run.returncode, run.stderr) == (0, "")
    assert generated(copy) == generated(PROTO)
    assert generate(copy).returncode == 0
    assert generated(copy) == generated(PROTO)


@needs_compiler
def test_the_hash_of_an_interface_follows_every_file_behind_it_and_no_other(copy: Path) -> None:
    path = copy / "posed" / "proto" / "events.proto"
    path.write_text(path.read_text() + "\n// More.\nmessage More {}\n")
    assert generate(copy).returncode == 0
    before, after = (runpy.run_path(str(each / "posed/proto/interfaces.py"))["HASHES"] for each in (PROTO, copy))
    # The service manager's file does not import events.proto.
    assert {name for name in before if before[name] == after[name]} == {
        "posed.IServiceManager",
        "posed.IServiceConnection",
    }


@needs_compiler
def test_modules_without_a_proto_are_removed(copy: Path) -> None:
    (copy / "posed" / "proto" / "gone_pb2.py").write_text("")
    generate(copy)
    assert "gone_pb2.py" not in generated(copy)


@needs_compiler
def test_field_without_a_comment_is_refused(copy: Path) -> None:
    path = copy / "posed" / "proto" / "pose.proto"
    path.write_text(path.read_text().replace("  // Where the phone is; absent if nobody said.\n", ""))
    run = generate(copy)
    assert run.returncode != 0
    assert "Pose.position has no comment" in run.stderr


@needs_compiler
def test_broken_proto_is_reported(copy: Path) -> None:
    (copy / "posed" / "proto" / "pose.proto").write_text("syntax = oops")
    run = generate(copy)
    assert run.returncode != 0
    assert "pose.proto:1" in run.stderr


def test_another_compiler_is_refused(copy: Path) -> None:
    script = copy / "generate.py"
    script.write_text(re.sub(r'COMPILER = ".*"', 'COMPILER = "0.1"', script.read_text()))
    run = generate(copy)
    assert run.returncode != 0
    assert "it must be 0.1: pip install grpcio-tools==0.1" in run.stderr
    assert not (copy / "WIRE.md").exists()


@pytest.mark.parametrize("file", FILES, ids=lambda file: Path(file.name).stem)
def test_document_has_every_field_and_method(file: Any) -> None:
    for message in file.message_types_by_name.values():
        assert f"#### {message.name}\n" in WIRE
        for field in message.fields:
            row = re.compile(rf"^\| {field.number} \| {field.name} \| (.+?) \| .+ \|$", re.MULTILINE)
            of_message = WIRE.split(f"#### {message.name}\n")[1].split("\n#")[0]
            found = row.search(of_message)
            assert found is not None, field.full_name
            assert found[1].startswith("repeated ") == field.is_repeated
    for service in file.services_by_name.values():
        interface = interface_of(service)
        section = WIRE.split(f"### {service.name}\n")[1].split("\n#")[0]
        assert f"Version {interface.version}, hash `{interface.hash}`." in section
        for method in interface.methods_by_code.values():
            assert f"| {method.code} | {method.name} |" in section
    for enum in file.enum_types_by_name.values():
        for value in enum.values:
            assert f"| {value.number} | {value.name} |" in WIRE


def test_links_lead_somewhere() -> None:
    headings = {line.lstrip("# ").lower() for line in WIRE.splitlines() if line.startswith("#")}
    links = set(re.findall(r"\(#([^)]+)\)", WIRE))
    assert len(links) > 20
    assert links <= headings


def test_worked_example_works(server: ServerThread) -> None:
    call, reply = (bytes.fromhex(dump) for dump in re.findall(r"```text\n((?:[0-9a-f]{2}[ \n])+)```", WIRE))
    client = RawClient(server.path)
    client.send(call)
    answer = binder_pb2.Parcel.FromString(client.receive_frame()[1]).reply
    client.close()
    documented = binder_pb2.Parcel.FromString(reply).reply
    assert (answer.call_id, answer.status) == (documented.call_id, documented.status) == (1, binder_pb2.Status())
    info = interface_of(sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]).info
    assert service_manager_pb2.ServiceInfo.FromString(documented.payload).interface == info
