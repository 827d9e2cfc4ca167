"""Compile the filters where Cython and a C compiler are there; without them the same files run interpreted.

Run as a script it compiles what changed, in place: what one does after editing a filter in an editable install.
"""

import binascii
import contextlib
import json
import os
import shutil
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# The modules that are compiled, each NAME.py with a NAME.pxd beside it that gives the C types. To add one: write its
# .pxd, add its name here and build again. posed.fusion.kernel, the packaging test and the test that compares the bits
# follow this list through the record that the build leaves.
PACKAGE = "posed.fusion"
MODULES = [
    *("direction_cosines", "event_arrays", "rest", "gate", "dcm_state", "dcm", "three_state"),
    *("adaptive_interval", "adaptive_tilt", "adaptive_bias", "adaptive_field", "adaptive_iron", "adaptive_heading"),
    *("adaptive_repeats", "adaptive_state", "adaptive_corrections", "adaptive"),
]

_FOLDER = Path("service", *PACKAGE.split("."))
_SUFFIX: str = sysconfig.get_config_var("EXT_SUFFIX")
_RECORD = f"kernel{_SUFFIX}.json"
"""Names what was compiled from which sources, for one version of Python: each has compiled files of its own."""

_DIRECTIVES = {
    "language_level": 3,
    "annotation_typing": False,
    "auto_pickle": False,
    "binding": False,
    "boundscheck": False,
    "wraparound": False,
    "initializedcheck": False,
    "cdivision": True,
}
# Same bits as the interpreter: nothing reassociated, no product and sum contracted into one rounding, no sin and cos
# merged into a sincos that might round otherwise. Optimised for size: a daemon that wakes ten times a second finds its
# code in no cache, and a third of a megabyte less is resident.
_C_FLAGS = ["-Os", "-g0", "-w", "-fno-fast-math", "-ffp-contract=off", "-fno-builtin-sin", "-fno-builtin-cos"]
_C_FLAGS += ["-fno-asynchronous-unwind-tables"]

# Each compiled module is mapped into the daemon: nothing in it that is not needed, and no page begun for a few bytes.
_LINK_FLAGS = ["-Wl,-z,noseparate-code", "-Wl,--gc-sections", "-s"]


class KernelBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the compiled filters to a wheel, or puts them beside the sources for an editable install."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        root = Path(self.root)
        if version == "editable":
            self._build(root, root / "build", root / "service")
            return
        self._scratch = Path(tempfile.mkdtemp(prefix="posed-kernel-"))
        if self._build(root, self._scratch / "build", self._scratch / "service"):
            build_data["pure_python"] = False
            build_data["infer_tag"] = True
            for file in (self._scratch / _FOLDER).iterdir():
                build_data["force_include"][str(file)] = str(_FOLDER.relative_to("service") / file.name)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            shutil.rmtree(self._scratch)

    def _build(self, root: Path, objects: Path, target: Path) -> bool:
        if os.environ.get("POSED_PURE"):
            reason: str | None = "POSED_PURE is set"
            _remove(target, keep=())
        else:
            reason = build(root, objects, target, force=True)
        if reason is not None:
            self.app.display_warning(f"the filters stay interpreted, slower and with the same results: {reason}")
        return reason is None


def build(root: Path, objects: Path, target: Path, *, force: bool) -> str | None:
    """Compile MODULES of the tree `root` into `target`, a source root; return None, or why nothing is compiled.

    Intermediate files go to `objects`; unless `force` is set, what is newer than its sources is taken as it is. A
    source that Cython cannot translate is an error of ours and raises.
    """
    try:
        from Cython.Build import cythonize
        from setuptools import Distribution, Extension
        from setuptools.errors import BaseError, CCompilerError
    except ImportError as error:
        _remove(target, keep=())
        return str(error)
    with contextlib.chdir(root):
        extensions = [
            Extension(
                f"{PACKAGE}.{name}",
                [str(_FOLDER / f"{name}.py")],
                extra_compile_args=_C_FLAGS,
                extra_link_args=_LINK_FLAGS,
            )
            for name in MODULES
        ]
        compiled = cythonize(
            extensions,
            # Cython finds no .pxd by itself in a namespace without __init__.py and would compile untyped code.
            include_path=["service"],
            build_dir=str(objects),
            compiler_directives=_DIRECTIVES,
            force=force,
            quiet=True,
        )
        command: Any = Distribution({"ext_modules": compiled}).get_command_obj("build_ext")
        command.build_lib = str(target)
        command.build_temp = str(objects)
        command.force = force
        command.parallel = os.cpu_count()
        try:
            command.ensure_finalized()
            command.run()
        except (BaseError, CCompilerError, OSError) as error:
            _remove(target, keep=())
            return str(error)
    _remove(target, keep=MODULES)
    sources = [f"{name}{ending}" for name in MODULES for ending in (".py", ".pxd")]
    record = {name: binascii.crc32((root / _FOLDER / name).read_bytes()) for name in sources}
    _inside(target, _RECORD).write_text(json.dumps({"modules": MODULES, "crc32": record}, indent=1) + "\n")
    return None


def _remove(target: Path, keep: Sequence[str]) -> None:
    """Remove what an earlier build for this Python left in `target`, but for the modules in `keep`."""
    for file in _inside(target).glob(f"*{_SUFFIX}"):
        if file.name.removesuffix(_SUFFIX) not in keep:
            file.unlink()
    _inside(target, _RECORD).unlink(missing_ok=True)


def _inside(target: Path, name: str = "") -> Path:
    return target / _FOLDER.relative_to("service") / name


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    sys.exit(build(here, here / "build", here / "service", force=False))
