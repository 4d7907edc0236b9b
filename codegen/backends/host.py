"""Device source of an energy, compiled as plain C++ and run on the host: what can be checked of it without a GPU."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from codegen.backends.cuda import device_name
from codegen.errors import CodegenError
from codegen.ir import KernelSource
from codegen.kernel import GRADIENT, TANGENT, Kernel, unpacked
from codegen.library import ARRAY, INT, INT64, Signatures, address, load_library

Array = NDArray[np.float64]

HERE = Path(__file__).parent
FLAGS = ("-std=c++17", "-O2", "-fno-math-errno", "-fPIC", "-shared")

# Arguments in the order of host_points.hpp and host_jacobian.hpp.
HOST: Signatures = {"device_points": (None, (INT, INT, INT, INT64, *(ARRAY,) * 3, INT64, *(ARRAY,) * 4))}
JACOBIAN: Signatures = {"device_jacobian": (None, (INT, INT, INT64, ARRAY, ARRAY))}


class HostKernel(Kernel):
    """Device kernels of an energy on the host; see :class:`codegen.kernel.Kernel`."""

    signatures: ClassVar[Signatures] = HOST

    def points(self, level: int, x_nx: Array, parameters: Array) -> tuple[Array, Array | None, Array | None]:
        """Energy density, gradient and Hessian at single states, as those of :class:`codegen.kernel.Kernel`."""
        return self.launch(level, x_nx, parameters)

    def launch(
        self,
        level: int,
        x_nx: Array,
        parameters: Array,
        *,
        blocks: int = 3,
        threads: int = 32,
        factor_ck: Array | None = None,
        cell_n: NDArray[np.int32] | None = None,
    ) -> tuple[Array, Array | None, Array | None]:
        """The same with a number of blocks and of threads in each.

        Args:
            level: ENERGY, GRADIENT or TANGENT.
            x_nx: (n_states, 12) displacement gradient F - I and second gradient G in the order of Appendix C.
            parameters: from :meth:`parameter_array`.
            blocks: how many.
            threads: in a block.
            factor_ck: (n_cells, n_varying) what multiplies the parameters that vary; 1 by default.
            cell_n: (n_states,) cell of each state; by default every state has factors of its own.

        Raises:
            ValueError: an array has a wrong shape.
        """
        x_kn = np.ascontiguousarray(np.asarray(x_nx, dtype=np.float64).reshape(-1, self.layout.n_inputs).T)
        self.check_parameters(parameters)
        n = x_kn.shape[1]
        factor_ck = np.ones((n, self.n_varying)) if factor_ck is None else factor_ck
        n_cells = n if cell_n is None else len(factor_ck)
        if factor_ck.shape != (n_cells, self.n_varying) or (cell_n is not None and cell_n.shape != (n,)):
            raise ValueError(f"factors of shape {factor_ck.shape} for {n} states and {self.n_varying} parameters")
        factor_kc = np.ascontiguousarray(factor_ck.T, dtype=np.float64)
        cells = None if cell_n is None else np.ascontiguousarray(cell_n, dtype=np.int32)
        psi_n = np.empty(n)
        g_kn = np.zeros_like(x_kn) if level >= GRADIENT else None
        h_kn = np.zeros((self.layout.n_hessian, n)) if level >= TANGENT else None
        self._lib.device_points(
            level, blocks, threads, n, address(x_kn), address(parameters), address(factor_kc), n_cells, address(cells),
            address(psi_n), address(g_kn), address(h_kn),
        )  # fmt: skip
        h_nxy = None if h_kn is None else unpacked(np.ascontiguousarray(h_kn.T), self.layout)
        return psi_n, None if g_kn is None else np.ascontiguousarray(g_kn.T), h_nxy

    def jacobian(self, x_nx: Array, *, blocks: int = 3, threads: int = 32) -> Array:
        """J (n_states,) of states, if the energy reads a deformation gradient; arguments as those of :meth:`launch`.

        Raises:
            CodegenError: it does not.
        """
        x_kn = np.ascontiguousarray(np.asarray(x_nx, dtype=np.float64).reshape(-1, self.layout.n_inputs).T)
        J_n = np.empty(x_kn.shape[1])
        library = load_library(self.library, JACOBIAN)
        library.device_jacobian(blocks, threads, x_kn.shape[1], address(x_kn), address(J_n))
        return J_n


def host_text(source: KernelSource, calls: str = "") -> str:
    """The device source with what it takes to be plain C++ and functions that call it, ``calls`` those of a driver."""
    name, device = device_name(source.name), source.files[".cu"]
    files = ["host_points.hpp", *(["host_jacobian.hpp"] if f"{name}_jacobian" in device else [])]
    texts = [*(HERE.joinpath(file).read_text() for file in files), calls]
    return "".join([HERE.joinpath("host.hpp").read_text(), device, *(text.replace("NAME", name) for text in texts)])


def compile_on_host(source: KernelSource, directory: Path, flags: Sequence[str] = FLAGS, calls: str = "") -> Path:
    """Shared object of device source, for :class:`HostKernel`.

    Args:
        source: of the target ``cuda``.
        directory: where the shared object is written.
        flags: of the compiler.
        calls: C++ text of functions that call kernels of a driver; NAME is the name of the energy's namespace.

    Raises:
        CodegenError: there is no compiler, or it failed (the message has its first error).
    """
    text, library = directory / f"{source.name}.cpp", directory / f"{source.name}.so"
    text.write_text(host_text(source, calls))
    command = [*cxx_compiler(), *flags, "-o", str(library), str(text), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode != 0 or not library.is_file():
        said = done.stderr.strip().splitlines() or ["it made no library and said nothing"]
        first = next((line for line in said if "error" in line), said[0])
        raise CodegenError(f"compiling {text.name} with {shlex.join(cxx_compiler())} failed: {first}")
    return library


def cxx_compiler() -> tuple[str, ...]:
    """Command of the C++ compiler: ``$CXX``, else g++, c++ or clang++.

    Raises:
        CodegenError: there is none.
    """
    wanted = os.environ.get("CXX")
    try:
        named = [shlex.split(wanted)] if wanted else [["g++"], ["c++"], ["clang++"]]
    except ValueError as error:
        raise CodegenError(f"CXX={wanted} is no command ({error}); set CXX to g++ or clang++") from None
    for command in named:
        executable = shutil.which(command[0]) if command else None
        if executable:
            return (executable, *command[1:])
    tried = f"CXX={wanted}" if wanted else "g++, c++ and clang++"
    raise CodegenError(f"no C++ compiler found (tried {tried}): install g++ ('apt-get install g++'), or set CXX")
