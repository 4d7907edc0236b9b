"""VTK's XML files: unstructured grids (.vtu) and polygons (.vtp), in all encodings and with all compressors of VTK.

Format: https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

from __future__ import annotations

import base64
import binascii
import lzma
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.record import Reading, Record
from tmc_vem.mesh.files.vtk_cells import POLY_LINE, POLY_VERTEX, POLYGON, STRIP, VtkCells, to_record
from tmc_vem.support.errors import InputError

Array = NDArray[np.generic]

TYPES = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4", "Int64": "i8",
    "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
# cells of polygonal data by the element that holds them
POLYDATA = {"Verts": POLY_VERTEX, "Lines": POLY_LINE, "Polys": POLYGON, "Strips": STRIP}


def read(path: Path, reading: Reading) -> Record:
    """Read a .vtu or .vtp file.

    Raises:
        InputError: it is not one, is damaged, or has cells that are not plane.
    """
    root, appended = _parse(path.read_bytes())
    kind = root.get("type", "")
    grid = root.find(kind)
    if root.tag != "VTKFile" or kind not in ("UnstructuredGrid", "PolyData") or grid is None:
        raise InputError(f"it holds {kind or root.tag}, not UnstructuredGrid or PolyData")
    arrays = _Arrays(root, appended)
    pieces = [_piece(piece, arrays, kind == "PolyData") for piece in grid.findall("Piece")]
    if not pieces:
        raise InputError("it has no piece")
    return to_record(_joined(pieces), reading)


def _parse(content: bytes) -> tuple[ElementTree.Element, bytes]:
    """The XML tree, and the appended data, which need not be XML."""
    start = content.find(b"<AppendedData")
    appended = b""
    if start >= 0:
        opened, ended = content.find(b">", start) + 1, content.rfind(b"</AppendedData>")
        if not opened or ended < 0:
            raise InputError("its AppendedData has no end: the file is cut off")
        appended = content[opened:ended].lstrip()[1:]  # after the underscore
        content = content[:opened] + content[ended:]
    try:
        return ElementTree.fromstring(content), appended
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"it is no XML: {error}") from None


@dataclass
class _Arrays:
    """Decodes data arrays."""

    root: ElementTree.Element
    appended: bytes

    def __post_init__(self) -> None:
        self.order = ">" if self.root.get("byte_order") == "BigEndian" else "<"
        header = self.root.get("header_type", "UInt32")
        if header not in ("UInt32", "UInt64"):
            raise InputError(f"header_type '{header}' is neither UInt32 nor UInt64")
        self.header = np.dtype(self.order + TYPES[header])
        self.decompress = _decompressor(self.root.get("compressor"))
        element = self.root.find("AppendedData")
        self.raw = element is not None and element.get("encoding") == "raw"

    def values(self, element: ElementTree.Element) -> Array:
        """Values of a DataArray, (n,) or (n, components).

        Raises:
            InputError: they cannot be decoded.
        """
        name, kind, how = element.get("Name", "Points"), element.get("type", ""), element.get("format", "ascii")
        if kind not in TYPES:
            raise InputError(f"array '{name}' has the type '{kind}'")
        dtype = np.dtype(self.order + TYPES[kind])
        try:
            if how == "ascii":
                words = (element.text or "").split()
                flat = np.array(words).astype(dtype) if words else np.empty(0, dtype)
            elif how == "binary":
                flat = np.frombuffer(self._decoded((element.text or "").strip().encode(), raw=False), dtype)
            elif how == "appended":
                block = self.appended[int(element.get("offset", "-1")) :]
                flat = np.frombuffer(self._decoded(block, raw=self.raw), dtype)
            else:
                raise InputError(f"array '{name}' has the format '{how}'")
            components = int(element.get("NumberOfComponents") or 1)
            shaped = flat.reshape(-1, components) if components > 1 else flat
        except (ValueError, IndexError, OverflowError, binascii.Error, zlib.error, lzma.LZMAError) as error:
            raise InputError(f"array '{name}' cannot be decoded: {error}") from None
        return shaped.astype(dtype.newbyteorder("="))

    def _decoded(self, block: bytes, *, raw: bool) -> bytes:
        """Bytes of an array: after a header, and in blocks if they are compressed."""
        size = self.header.itemsize
        if self.decompress is None:
            if raw:
                n = self._header(block[:size], 1)[0]
                data = block[size : size + n]
            else:
                n = self._header(_base64(block, 0, size), 1)[0]
                data = _base64(block, 0, size + n)[size:]
            return _all_of(data, n)
        n_blocks = self._header(block[:size] if raw else _base64(block, 0, size), 1)[0]
        if n_blocks == 0:
            return b""
        if n_blocks * size > len(block):
            raise InputError(f"{n_blocks} compressed blocks are more than there are")
        length = size * (3 + n_blocks)
        _, block_size, last, *sizes = self._header(block[:length] if raw else _base64(block, 0, length), 3 + n_blocks)
        start = length if raw else 4 * -(-length // 3)
        packed = block[start:] if raw else _base64(block[start:], 0, sum(sizes))
        parts, at = [], 0
        for n, packed_size in enumerate(sizes):
            full = last if n == n_blocks - 1 and last else block_size
            parts.append(_all_of(self.decompress(_all_of(packed[at : at + packed_size], packed_size), full), full))
            at += packed_size
        return b"".join(parts)

    def _header(self, block: bytes, n: int) -> list[int]:
        values: list[int] = np.frombuffer(_all_of(block[: n * self.header.itemsize], n * self.header.itemsize),
                                          self.header).tolist()  # fmt: skip
        return values


def _base64(text: bytes, start: int, n: int) -> bytes:
    """The first ``n`` bytes of what is encoded from ``start`` on."""
    return base64.b64decode(text[start : start + 4 * -(-n // 3)])[:n]


def _all_of(data: bytes, n: int) -> bytes:
    if len(data) != n:
        raise InputError(
            f"{n} bytes are announced and {len(data)} are there: it is cut off, or not as VTK writes it; open it in "
            "ParaView or PyVista and save it anew"
        )
    return data


def _decompressor(name: str | None) -> Callable[[bytes, int], bytes] | None:
    if not name:
        return None
    if name == "vtkZLibDataCompressor":
        return lambda data, n: zlib.decompressobj().decompress(data, n)
    if name == "vtkLZMADataCompressor":
        return lambda data, n: lzma.LZMADecompressor().decompress(data, n)
    if name == "vtkLZ4DataCompressor":
        try:
            from lz4 import block
        except ImportError:
            raise InputError(
                "it is compressed with LZ4: pip install lz4, or write it with ZLib, LZMA or no compression"
            ) from None

        def decompress(data: bytes, n: int) -> bytes:
            try:
                return bytes(block.decompress(data, uncompressed_size=n))
            except block.LZ4BlockError as error:
                raise InputError(f"a block of LZ4 cannot be decompressed: {error}") from None

        return decompress
    raise InputError(f"its compressor '{name}' is not known: write it with ZLib, LZMA or no compression")


def _piece(piece: ElementTree.Element, arrays: _Arrays, polydata: bool) -> VtkCells:
    points_in = piece.find("Points/DataArray")
    points = np.zeros((0, 3)) if points_in is None else np.asarray(arrays.values(points_in), dtype=float)
    if points.size == 0:
        points = np.zeros((0, 3))
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("its points have not three coordinates")
    types, connectivity, ends = [], [], []
    n_entries = 0
    for group, kind in POLYDATA.items() if polydata else [("Cells", 0)]:
        found = {e.get("Name"): e for e in piece.findall(f"{group}/DataArray")}
        if "connectivity" not in found or "offsets" not in found:
            if polydata or piece.get("NumberOfCells") in ("0", None):
                continue
            raise InputError("its cells have no connectivity or offsets")
        nodes, last = (_whole(arrays.values(found[name]), name) for name in ("connectivity", "offsets"))
        if polydata:
            kinds = np.full(len(last), kind)
        elif "types" in found:
            kinds = _whole(arrays.values(found["types"]), "types")
        else:
            raise InputError("its cells have no types")
        types.append(kinds)
        connectivity.append(nodes)
        ends.append(last + n_entries)
        n_entries += len(nodes)
    empty = [np.empty(0, dtype=np.int64)]
    cells = VtkCells(
        points, np.concatenate(types or empty), np.concatenate([np.zeros(1, dtype=np.int64), *ends]),
        np.concatenate(connectivity or empty),
        {e.get("Name", ""): arrays.values(e) for e in piece.findall("CellData/DataArray")},
    )  # fmt: skip
    for what, n in (("NumberOfPoints", len(cells.points)), ("NumberOfCells", len(cells.types))):
        if not polydata and piece.get(what) is not None and piece.get(what, "").strip() != str(n):
            raise InputError(f"{what} is {piece.get(what)}, and {n} are there")
    cells.check()
    return cells


def _whole(values: Array, name: str) -> NDArray[np.int64]:
    if values.dtype.kind not in "iu":
        raise InputError(f"array '{name}' has no whole numbers")
    return np.asarray(values, dtype=np.int64).ravel()


def _joined(pieces: list[VtkCells]) -> VtkCells:
    """Pieces as one; points that several have stay apart."""
    first = pieces[0]
    starts = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    entries = np.cumsum([0, *(len(piece.connectivity) for piece in pieces)])
    common = [name for name in first.data if all(name in piece.data for piece in pieces)]
    return VtkCells(
        np.concatenate([piece.points for piece in pieces]),
        np.concatenate([piece.types for piece in pieces]),
        np.concatenate([first.offsets[:1], *(p.offsets[1:] + s for p, s in zip(pieces, entries, strict=False))]),
        np.concatenate([p.connectivity + s for p, s in zip(pieces, starts, strict=False)]),
        {name: np.concatenate([piece.data[name] for piece in pieces]) for name in common},
    )  # fmt: skip
