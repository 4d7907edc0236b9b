"""Device source of energies and NVIDIA's run-time compiler, where that is installed: it needs no GPU."""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib.util
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

from codegen.compiler import generate
from codegen.driver import Driver
from codegen.integrand import Integrand, second_gradient_energy
from codegen.trace import trace
from tmc_vem.energy import DENSITIES, SOLIDS
from tmc_vem.vem.kernel.driver import DEVICE_CELLS

ENERGIES = {**DENSITIES, **SOLIDS}
POINTS = ("energy", "gradient", "tangent", "jacobian")
CELLS = ("rows", "states", "forces", "stiffness")
OPTIONS = (b"--gpu-architecture=compute_75",)


@cache
def nvrtc() -> ctypes.CDLL | None:
    """The compiler of the system, or that of ``pip install nvidia-cuda-nvrtc-cu12``."""
    spec = importlib.util.find_spec("nvidia")
    folders = [Path(folder) for folder in (spec.submodule_search_locations or ())] if spec else []
    for path in (path for folder in folders for path in sorted(folder.rglob("libnvrtc-builtins.so*"))):
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    found = [str(path) for folder in folders for path in sorted(folder.rglob("libnvrtc.so*"))]
    name = next(iter(found), ctypes.util.find_library("nvrtc"))
    return ctypes.CDLL(name) if name else None


def compiled(text: str) -> tuple[bool, str, str]:
    """Whether it compiles, what the compiler says, and its code for a virtual machine."""
    library, program = nvrtc(), ctypes.c_void_p()
    assert library.nvrtcCreateProgram(ctypes.byref(program), text.encode(), b"energy.cu", 0, None, None) == 0
    failed = library.nvrtcCompileProgram(program, len(OPTIONS), (ctypes.c_char_p * len(OPTIONS))(*OPTIONS))
    said = []
    for what in ("ProgramLog", "PTX"):
        size = ctypes.c_size_t()
        getattr(library, f"nvrtcGet{what}Size")(program, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(max(size.value, 1))
        getattr(library, f"nvrtcGet{what}")(program, buffer)
        said.append(buffer.value.decode())
    library.nvrtcDestroyProgram(ctypes.byref(program))
    return not failed, said[0], said[1]


pytestmark = pytest.mark.skipif(nvrtc() is None, reason="NVRTC is not installed")


def assert_compiles(integrand: Integrand, kernels: Sequence[str], driver: Driver | None = None) -> None:
    worked, log, code = compiled(generate(trace(integrand), driver=driver, target="cuda").files[".cu"])
    assert (worked, log) == (True, "")
    for kernel in kernels:
        assert f".visible .entry tmc_{integrand.name}_{kernel}(" in code
    assert code.count(".visible .entry") == len(kernels)
    assert "atom." not in code


@pytest.mark.parametrize("name", ENERGIES)
def test_every_energy_compiles(name):
    energy = ENERGIES[name]
    integrand = second_gradient_energy(energy.density, energy.name, energy.parameters)
    assert_compiles(integrand, POINTS)
    assert_compiles(integrand.varying(integrand.parameter_names[-1:]), POINTS)


@pytest.mark.parametrize("name", ["solid", "medium_angle_damped"])
def test_cells_compile(name):
    energy = ENERGIES[name]
    integrand = second_gradient_energy(energy.density, energy.name, energy.parameters)
    assert_compiles(integrand, (*POINTS, *CELLS), DEVICE_CELLS)
