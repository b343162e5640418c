"""GL drivers to run passes on: Mesa's two software ones, and the machine's own where it has a GPU."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from renderer.context import is_software

ROOT: Final = Path(__file__).parents[2]
"""Where the packages are."""


@dataclass(frozen=True, slots=True)
class Driver:
    """A GL driver.

    Attributes:
        name: In paths of the table.
        variables: Of the environment of a process that shall have it; a process has one.
        begins: What `renderer.context.describe` begins with, in lower case; empty: anything but a software driver.
        packages: Debian's, without which it is not there.
    """

    name: str
    variables: Mapping[str, str]
    begins: str
    packages: str

    def is_it(self, description: str) -> bool:
        """Whether a context is this driver's."""
        if self.begins:
            return description.lower().startswith(self.begins)
        return not is_software(description)


LLVMPIPE: Final = Driver(
    "llvmpipe",
    {"GALLIUM_DRIVER": "llvmpipe", "LIBGL_ALWAYS_SOFTWARE": "1"},
    "llvmpipe",
    "libegl1 libgl1 libgl1-mesa-dri libegl-mesa0",
)
ZINK: Final = Driver(
    "zink",
    {"GALLIUM_DRIVER": "zink", "MESA_LOADER_DRIVER_OVERRIDE": "zink", "LIBGL_ALWAYS_SOFTWARE": "1"},
    "zink",
    "mesa-vulkan-drivers libvulkan1",
)
GPU: Final = Driver("gpu", {}, "", "the GPU's own driver with EGL")
DRIVERS: Final = {driver.name: driver for driver in (LLVMPIPE, ZINK, GPU)}


def gpu_here() -> bool:
    """Whether the machine shows a GPU to this process."""
    return Path("/dev/nvidiactl").exists() or any(Path("/dev/dri").glob("renderD*"))


def environment(driver: Driver, runtime: Path, threads: int | None = None) -> dict[str, str]:
    """The environment of a process with a driver.

    Args:
        driver: Which.
        runtime: An empty folder of mode 700, which zink's Vulkan loader asks for.
        threads: Of the software rasteriser and of compiled loops; None: all cores.
    """
    count = {} if threads is None else {"LP_NUM_THREADS": str(threads), "NUMBA_NUM_THREADS": str(threads)}
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, **count, **driver.variables, "XDG_RUNTIME_DIR": str(runtime), "PYTHONPATH": path}
