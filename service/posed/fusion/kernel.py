"""Whether the filters run compiled or interpreted, and that what was compiled is what the sources say.

The build leaves a record beside the compiled files. With POSED_PURE set the sources are loaded in spite of them.
"""

import binascii
import json
import os
import sys
from collections.abc import Sequence
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec
from importlib.util import find_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from posed.errors import StaleKernelError

_FOLDER = Path(__file__).parent
_PACKAGE = __name__.rpartition(".")[0]
_RECORD = _FOLDER / f"kernel{EXTENSION_SUFFIXES[0]}.json"


def prepare() -> None:
    """Make the imports of filters that follow safe; raises StaleKernelError if a source changed since it was compiled.

    A compiled file hides the .py beside it: without the check an edit would have no effect and nobody would know.
    """
    compiled = {file.name.removesuffix(EXTENSION_SUFFIXES[0]) for file in _FOLDER.glob(f"*{EXTENSION_SUFFIXES[0]}")}
    if not compiled:
        return
    if os.environ.get("POSED_PURE"):
        sys.meta_path.insert(0, _Sources())
        return
    # A checksum does against mistakes, and hashlib would load OpenSSL into the daemon.
    checksums: dict[str, int] = json.loads(_RECORD.read_text())["crc32"] if _RECORD.exists() else {}
    for name in sorted(checksums.keys() | {f"{module}.py" for module in compiled}):
        source = _FOLDER / name
        if not source.exists() or binascii.crc32(source.read_bytes()) != checksums.get(name):
            raise StaleKernelError(
                f"{source} is not what the compiled filters were made from; install posed again"
                " (in a source tree: pip install -e .), or set POSED_PURE=1 to run the source interpreted"
            )


def kernel() -> str:
    """Return how the filters of this process run: "compiled" or "interpreted"."""
    found = find_spec(f"{_PACKAGE}.dcm")
    return "compiled" if found is not None and str(found.origin).endswith(EXTENSION_SUFFIXES[0]) else "interpreted"


class _Sources:
    """Finds the .py of every module of this package, whatever was compiled beside it."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        package, _, module = name.rpartition(".")
        source = _FOLDER / f"{module}.py"
        return spec_from_file_location(name, source) if package == _PACKAGE and source.exists() else None
