"""Libraries of the operating system that a package from pip loads: where one is missing, the command that installs it.

pip cannot install them, and what the package says of it is a traceback that ends in the name of a file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from tracker.errors import MissingLibraryError

MISSING = re.compile(r"(lib[^\s:/]+\.so[.\d]*): cannot open shared object file")
DEBIAN = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libgomp.so.1": "libgomp1",
    "libudev.so.1": "libudev1",
    "libusb-1.0.so.0": "libusb-1.0-0",
}


@contextmanager
def system_libraries_of(package: str) -> Iterator[None]:
    """Around the import of a package. Raises MissingLibraryError where it is there but a library that it loads is not;
    any other ImportError goes on as it is."""
    try:
        yield
    except ImportError as error:
        found = MISSING.search(str(error))
        if found is None:
            raise
        library = found[1]
        cure = (
            f"sudo apt-get install -y {DEBIAN[library]} (Debian and Ubuntu; elsewhere whatever package has it)"
            if library in DEBIAN
            else "install the package of your system that has it"
        )
        raise MissingLibraryError(
            f"{package} needs the system library {library}, which pip cannot install: {cure}"
        ) from error
