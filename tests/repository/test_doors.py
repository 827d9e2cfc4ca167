"""Who may import whom, and what the SDK may pull in."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[2]
_LEAVES = {"events", "clock", "errors", "version"}

# Room -> the rooms of posed it may import besides itself.
_ALLOWED = {
    "errors": set(),
    "version": set(),
    "proto": set(),
    "binder": {"errors", "proto"},
    "events": {"errors"},
    "clock": {"errors"},
    "hal": _LEAVES,
    "fusion": _LEAVES,
    "sensors": _LEAVES | {"hal", "fusion"},
    "evaluation": _LEAVES | {"hal", "sensors", "fusion"},
    "daemon": _LEAVES | {"hal", "sensors", "fusion", "binder", "proto"},
    "client": {"errors", "binder", "proto"},
    "web": {"errors"},
    "ar": {"errors", "client", "web"},
    "verify": {"errors", "client"},
    "cli": _LEAVES
    | {"hal", "sensors", "fusion", "evaluation", "daemon", "client", "binder", "proto", "web", "ar", "verify"},
}
_WITHOUT_ZMQ = {"errors", "version", "proto", "events", "clock", "hal", "fusion", "sensors", "evaluation"}


def _modules() -> list[Path]:
    files = [file for root in ("service", "client", "proto") for file in (_ROOT / root / "posed").rglob("*.py")]
    return [file for file in files if not file.name.endswith("_pb2.py")]


def _room(file: Path) -> str:
    return file.relative_to(_ROOT).with_suffix("").parts[2]


def _imports(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{file}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("file", _modules(), ids=lambda file: str(file.relative_to(_ROOT)))
def test_a_module_imports_only_through_its_doors(file: Path) -> None:
    room = _room(file)
    for name in _imports(file):
        parts = name.split(".")
        if parts[0] == "posed" and parts[1] != room:
            assert parts[1] in _ALLOWED[room], f"{room} must not import {name}"
        if parts[0] == "zmq":
            assert room not in _WITHOUT_ZMQ, f"{room} must not import zmq"


def test_there_is_no_package_file_in_the_namespace() -> None:
    assert [root for root in ("service", "client", "proto") if (_ROOT / root / "posed" / "__init__.py").exists()] == []


def test_the_sdk_loads_neither_numpy_nor_a_service_room() -> None:
    script = "import sys, posed.client; print(*sorted(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    service_rooms = {"events", "clock", "hal", "fusion", "sensors", "daemon", "evaluation", "navigation"}
    assert "posed.client.pose_client" in loaded
    assert [name for name in loaded if name.split(".")[0] in {"numpy", "rich", "asyncio"}] == []
    assert [name for name in loaded if name.startswith("posed.") and name.split(".")[1] in service_rooms] == []
