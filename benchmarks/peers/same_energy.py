"""Whether the C-box is the same problem in FElupe and in tmc-vem: energies, forces and stresses of the same states.

    .venv/bin/python benchmarks/peers/same_energy.py STATES.npz [--cells 12 6]

``STATES.npz`` is what ``with_felupe.py --states`` has written. Whole energies and nodal forces are compared with those
of finite elements on the same mesh; energies and stresses of single F with those of the density file.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from clock import say
from mpi4py import MPI
from numpy.typing import NDArray
from peer_problems import CBox
from with_tmc_vem import ENERGIES, cbox

from codegen.kernel import compile_energy
from codegen.tensors import stress_and_moduli
from codegen.userfile import load_density
from tmc_vem.simulation import RunOptions, discretise

Float = NDArray[np.float64]


def whole(problem: CBox, cells: tuple[int, int], u_sni: Float, points_nx: Float) -> tuple[Float, Float]:
    """Energies (s,) and forces (s, n, 2) of displacements at points, in finite elements of ours."""
    with tempfile.TemporaryDirectory() as directory:
        system = discretise(cbox(problem, cells, Path(directory)), RunOptions(method="fem"), MPI.COMM_WORLD)
    mine = order(system.node_labels()[:, :2])
    theirs = order(points_nx)
    u, residual = system.create_vector(), system.create_vector()
    energies, forces = [], []
    for u_ni in u_sni:
        ours = np.empty_like(u_ni)
        ours[mine] = u_ni[theirs]
        u.getArray()[:] = ours.ravel()
        energies.append(system.residual(u, residual).energy)
        back = np.empty_like(u_ni)
        back[theirs] = residual.getArray().reshape(-1, 2)[mine]
        forces.append(back)
    return np.array(energies), np.array(forces)


def order(points_nx: Float) -> NDArray[np.int64]:
    """Places in lexicographic order of coordinates."""
    rounded = np.round(points_nx, 7)
    return np.lexsort((rounded[:, 1], rounded[:, 0]))


def at_points(problem: CBox, F_nij: Float) -> tuple[Float, Float]:
    """Energies (n,) and stresses (n, 2, 2) of the solid's compiled kernel."""
    solid, values = load_density(f"{ENERGIES}:solid"), {"mu": problem.mu, "lmbda": problem.lmbda}
    kernel = compile_energy(solid.function, solid.name, tuple(values))
    at = stress_and_moduli(kernel, F_nij, parameters=values)
    return at.psi_n, at.P_n4.reshape(-1, 2, 2).transpose(0, 2, 1)


def difference(found: Float, wanted: Float) -> float:
    """Largest difference relative to the largest value."""
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


def main() -> None:
    """Say how large the differences are."""
    parser = argparse.ArgumentParser()
    parser.add_argument("states", type=Path)
    parser.add_argument("--cells", type=int, nargs=2, default=(12, 6))
    arguments = parser.parse_args()
    problem, theirs = CBox(), np.load(arguments.states)
    energies, forces = whole(problem, tuple(arguments.cells), theirs["u"], theirs["points"])
    W_n, P_nij = at_points(problem, theirs["F"])
    say({
        "energy": difference(energies, theirs["energy"]),
        "forces": difference(forces, theirs["forces"]),
        "density": difference(W_n, theirs["W"]),
        "stress": difference(P_nij, theirs["P"]),
    })  # fmt: skip


if __name__ == "__main__":
    main()
