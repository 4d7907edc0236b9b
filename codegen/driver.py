"""What else a kernel may have: C text that calls the functions of a point, such as a loop over the cells of a mesh."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path


@dataclass(frozen=True)
class Driver:
    """C files that a kernel contains besides its functions of a point.

    Attributes:
        header: what they export; it stands before the functions of a point, and in the header that goes with a kernel.
        files: the C text after these functions, in the order in which the files build on each other.
        shared_headers: of other drivers, with types that this one uses.
    """

    header: Path
    files: tuple[Path, ...]
    shared_headers: tuple[Path, ...] = ()

    @property
    def declarations(self) -> str:
        """Text of the headers."""
        return "\n".join(header.read_text() for header in (*self.shared_headers, self.header))

    @property
    def source(self) -> str:
        """Text of the C files."""
        return "\n".join(file.read_text() for file in self.files)

    @cached_property
    def key(self) -> str:
        """Hash of all files, a part of the key of compiled kernels."""
        digest = hashlib.sha256()
        for file in (*self.shared_headers, self.header, *self.files):
            digest.update(file.name.encode() + file.read_bytes())
        return digest.hexdigest()
