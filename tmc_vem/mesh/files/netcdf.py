"""Variables of netCDF files with their attributes: scipy reads the classic format, netCDF4 or h5py the one of HDF5."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError


@dataclass(frozen=True)
class Variable:
    """Values as they are stored, names of the dimensions, and attributes."""

    values: NDArray[Any]
    dimensions: tuple[str, ...]
    attributes: dict[str, Any]

    def text(self, name: str) -> str:
        """An attribute as text; empty without it."""
        value = self.attributes.get(name, "")
        if isinstance(value, np.ndarray) and value.size == 1:
            value = value.ravel()[0]
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)

    def number(self, name: str) -> float | None:
        """An attribute as a number, or None."""
        value = self.attributes.get(name)
        return None if value is None else float(np.ravel(value)[0])


def variables_of(path: Path) -> dict[str, Variable]:
    """All variables by name.

    Raises:
        InputError: it is no netCDF file, is damaged, or needs a package that is not installed.
    """
    with path.open("rb") as file:
        start = file.read(4)
    if start[:3] == b"CDF" and start[3:] in (b"\1", b"\2"):
        return _classic(path)
    if start[:3] != b"CDF" and start != b"\x89HDF":
        raise InputError("it is no netCDF file")
    try:
        import netCDF4
    except ImportError:
        if start == b"\x89HDF":
            return _by_h5py(path)
        raise InputError("it is of netCDF's format 5: pip install netCDF4") from None
    try:
        with netCDF4.Dataset(path) as data:
            data.set_auto_maskandscale(False)
            return {
                name: Variable(np.asarray(v[...]), tuple(v.dimensions), {key: v.getncattr(key) for key in v.ncattrs()})
                for name, v in data.variables.items()
            }
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"netCDF4 cannot read it: {error}") from None


def _classic(path: Path) -> dict[str, Variable]:
    from scipy.io import netcdf_file

    try:
        with netcdf_file(path, mmap=False, maskandscale=False) as data:
            return {
                name: Variable(np.array(v.data), tuple(v.dimensions), dict(v._attributes))
                for name, v in data.variables.items()
            }
    except Exception as error:  # scipy fails with whatever a bad file leads it to
        raise InputError(f"scipy cannot read it: {error or type(error).__name__}") from None


def _by_h5py(path: Path) -> dict[str, Variable]:
    try:
        import h5py
    except ImportError:
        raise InputError("it is netCDF 4: pip install netCDF4 (or h5py)") from None
    try:
        with h5py.File(path, "r") as file:
            found = {}
            for name, entry in file.items():
                if isinstance(entry, h5py.Dataset):
                    scales = [entry.dims[k][0].name if len(entry.dims[k]) else "" for k in range(entry.ndim)]
                    names = tuple(scale.rsplit("/", 1)[-1] for scale in scales)
                    known = {key: value for key, value in entry.attrs.items() if key not in ("DIMENSION_LIST",)}
                    found[name] = Variable(np.asarray(entry[...]), names, known)
            return found
    except (OSError, KeyError, ValueError, RuntimeError, TypeError) as error:
        raise InputError(f"h5py cannot read it: {error}") from None
