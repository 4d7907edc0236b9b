"""VTK's legacy files (.vtk), versions up to 5.1, as text or binary: unstructured grids and polygons.

Format: https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.record import Reading, Record
from tmc_vem.mesh.files.vtk_cells import POLY_LINE, POLY_VERTEX, POLYGON, STRIP, VtkCells, to_record
from tmc_vem.support.errors import InputError

Array = NDArray[np.generic]
Int = NDArray[np.int64]

TYPES = {
    "bit": "u1", "unsigned_char": "u1", "char": "i1", "unsigned_short": "u2", "short": "i2", "unsigned_int": "u4",
    "int": "i4", "unsigned_long": "u8", "long": "i8", "float": "f4", "double": "f8", "vtkidtype": "i4",
    "vtktypeint64": "i8", "vtktypeint32": "i4", "vtktypeuint64": "u8", "vtktypeuint32": "u4", "vtktypeint16": "i2",
    "vtktypeint8": "i1", "vtktypeuint8": "u1", "vtktypeuint16": "u2",
}  # fmt: skip
POLYDATA = {"VERTICES": POLY_VERTEX, "LINES": POLY_LINE, "POLYGONS": POLYGON, "TRIANGLE_STRIPS": STRIP}
COMPONENTS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}


def read(path: Path, reading: Reading) -> Record:
    """Read a .vtk file.

    Raises:
        InputError: it is not one, is damaged, or has cells that are not plane.
    """
    return to_record(_Parser(path.read_bytes()).parse(), reading)


class _Parser:
    """Reads a file from its start: words, lines, and arrays of numbers in the file's encoding."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.at = 0
        if not self._line().startswith("# vtk DataFile"):
            raise InputError("it does not start with '# vtk DataFile Version'")
        self._line()  # title
        encoding = self._line().strip().upper()
        if encoding not in ("ASCII", "BINARY"):
            raise InputError(f"it is neither ASCII nor BINARY but '{encoding[:20]}'")
        self.binary = encoding == "BINARY"
        self.points: NDArray[np.float64] = np.zeros((0, 3))
        self.parts: list[tuple[Int, Int, int | None]] = []  # offsets, connectivity, type unless given for each cell
        self.types: Int | None = None
        self.data: dict[str, Array] = {}
        self.where, self.n_values = "", 0

    def parse(self) -> VtkCells:
        dataset = self._words()
        while dataset and dataset[0].upper() in ("FIELD", "METADATA"):
            self._skip(dataset)
            dataset = self._words()
        kind = dataset[1].upper() if len(dataset) > 1 and dataset[0].upper() == "DATASET" else ""
        if kind not in ("UNSTRUCTURED_GRID", "POLYDATA"):
            raise InputError(f"its DATASET is {kind or 'missing'}: UNSTRUCTURED_GRID and POLYDATA can be read")
        while words := self._words():
            self._section(words)
        starts = np.cumsum([0, *(len(nodes) for _, nodes, _ in self.parts)])
        offsets = [o[1:] + s for (o, _, _), s in zip(self.parts, starts, strict=False)]
        types = [np.full(len(o) - 1, t) for o, _, t in self.parts if t is not None]
        if kind == "UNSTRUCTURED_GRID":
            types = [] if self.types is None else [self.types]
        none = np.empty(0, dtype=np.int64)
        return VtkCells(
            self.points, np.concatenate([none, *types]), np.concatenate([np.zeros(1, dtype=np.int64), *offsets]),
            np.concatenate([none, *(nodes for _, nodes, _ in self.parts)]), self.data,
        )  # fmt: skip

    def _section(self, words: list[str]) -> None:
        word = words[0].upper()
        if word == "POINTS":
            n = self._count(words, 1)
            self.points = np.asarray(self._array(3 * n, words[2] if len(words) > 2 else ""), dtype=float).reshape(-1, 3)
        elif word == "CELLS" or word in POLYDATA:
            self._cells(words, POLYDATA.get(word))
        elif word == "CELL_TYPES":
            self.types = np.asarray(self._array(self._count(words, 1), "int"), dtype=np.int64)
        elif word in ("CELL_DATA", "POINT_DATA"):
            self.where, self.n_values = word, self._count(words, 1)
        else:
            self._skip(words)

    def _cells(self, words: list[str], kind: int | None) -> None:
        """Connectivity: in 5.1 as offsets and nodes, before as the number of nodes and the nodes of every cell."""
        n, total = self._count(words, 1), self._count(words, 2)
        here = self.at
        following = self._words()
        if following and following[0].upper() == "OFFSETS":
            offsets = self._array(n, following[1]) if n else np.zeros(1)
            named = self._words()
            if not named or named[0].upper() != "CONNECTIVITY":
                raise InputError(f"CONNECTIVITY is missing after the OFFSETS of {words[0]}")
            nodes = self._array(total, named[1])
            self.parts.append((np.asarray(offsets, dtype=np.int64), np.asarray(nodes, dtype=np.int64), kind))
            return
        self.at = here
        entries = np.asarray(self._array(total, "int"), dtype=np.int64)
        starts, at = [], 0
        for _ in range(n):
            if at >= total or entries[at] < 0:
                raise InputError(f"{words[0]}: {total} entries do not hold {n} cells")
            starts.append(at)
            at += int(entries[at]) + 1
        if at != total:
            raise InputError(f"{words[0]}: {n} cells take {at} of {total} entries")
        sizes = entries[starts] if n else np.empty(0, dtype=np.int64)
        self.parts.append((np.concatenate([[0], np.cumsum(sizes)]), np.delete(entries, starts), kind))

    def _skip(self, words: list[str]) -> None:
        """Attributes; those of cells are kept."""
        word = words[0].upper()
        if word == "METADATA":
            while self._line().strip() and self.at < len(self.content):
                pass
        elif word == "FIELD":
            for _ in range(self._count(words, 2)):
                head = self._words()
                if head and head[0].upper() == "METADATA":
                    self._skip(head)
                    head = self._words()
                if len(head) < 4:
                    raise InputError(f"a field lacks its name, size or type: '{' '.join(head)[:40]}'")
                components, tuples = self._count(head, 1), self._count(head, 2)
                self._keep(head[0], self._array(components * tuples, head[3]), components)
        elif word == "SCALARS":
            components = self._count(words, 3) if len(words) > 3 else 1
            here = self.at
            table = self._words()
            if not table or table[0].upper() != "LOOKUP_TABLE":
                self.at = here
            self._keep(words[1], self._array(components * self.n_values, words[2]), components)
        elif word in COMPONENTS and len(words) > 2:
            self._keep(words[1], self._array(COMPONENTS[word] * self.n_values, words[2]), COMPONENTS[word])
        elif word == "TEXTURE_COORDINATES" and len(words) > 3:
            self._array(self._count(words, 2) * self.n_values, words[3])
        elif word == "COLOR_SCALARS" and len(words) > 2:
            self._array(self._count(words, 2) * self.n_values, "unsigned_char" if self.binary else "float")
        elif word == "LOOKUP_TABLE" and len(words) > 2:
            self._array(4 * self._count(words, 2), "unsigned_char" if self.binary else "float")
        elif word in ("GLOBAL_IDS", "PEDIGREE_IDS") and len(words) > 2:
            self._keep(words[1], self._array(self.n_values, words[2]), 1)
        else:
            raise InputError(f"'{' '.join(words)[:40]}' is not understood at byte {self.at}")

    def _keep(self, name: str, values: Array, components: int) -> None:
        if self.where == "CELL_DATA":
            self.data[name] = values if components == 1 else values.reshape(-1, components)

    # -- words and numbers -------------------------------------------------------------------------------------------

    def _line(self) -> str:
        end = self.content.find(b"\n", self.at)
        end = len(self.content) if end < 0 else end
        line = self.content[self.at : end]
        self.at = end + 1
        return line.decode(errors="replace")

    def _words(self) -> list[str]:
        """Words of the next line that has any; none at the end."""
        while self.at < len(self.content):
            if words := self._line().split():
                return words
        return []

    def _count(self, words: list[str], at: int) -> int:
        try:
            n = int(words[at])
        except (ValueError, IndexError):
            n = -1
        if not 0 <= n <= len(self.content):
            raise InputError(f"'{' '.join(words)[:60]}' lacks a number, or has more than the file can hold")
        return n

    def _pass_text(self) -> None:
        """Pass over a text: a line, or bytes after their number, whose first two bits tell how long it is itself."""
        if not self.binary:
            self._line()
            return
        first = self.content[self.at : self.at + 1]
        width = {3: 1, 2: 2, 1: 4, 0: 8}[first[0] >> 6] if first else 1
        number = int.from_bytes(self.content[self.at : self.at + width], "big") & ((1 << (8 * width - 2)) - 1)
        self.at += width + number

    def _array(self, n: int, kind: str) -> Array:
        """The next ``n`` numbers.

        Raises:
            InputError: there are fewer, or one is no number.
        """
        name = TYPES.get(kind.lower())
        if kind.lower() in ("string", "variant"):
            for _ in range(n):
                self._pass_text()
            return np.zeros(n)
        if name is None:
            raise InputError(f"the type '{kind}' of an array is not known")
        if self.binary:
            if kind.lower() == "bit":
                self.at += -(-n // 8) + 1
                return np.zeros(n)
            dtype = np.dtype(">" + name)
            data = self.content[self.at : self.at + n * dtype.itemsize]
            if len(data) != n * dtype.itemsize:
                raise InputError(
                    f"{n} numbers are announced and {len(data) // dtype.itemsize} are there: it is cut off"
                )
            self.at += len(data)  # words follow, on a line of their own
            return np.frombuffer(data, dtype).astype(dtype.newbyteorder("="))
        words: list[str] = []
        while len(words) < n and self.at < len(self.content):
            words += self._line().split()
        if len(words) != n:
            raise InputError(f"{n} numbers are announced and {len(words)} are there")
        try:
            return np.array(words).astype(name) if n else np.empty(0, name)
        except (ValueError, OverflowError) as error:
            raise InputError(f"a number cannot be read: {error}") from None
