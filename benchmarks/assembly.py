"""Tangent and residual per degree of freedom, against dolfinx's assembly of the same energy on P2 triangles.

    python benchmarks/assembly.py [--sizes 16000 64000]

Both assemble the whole tangent into a PETSc matrix, boundary conditions aside, in one process and in turn.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from harness import interleaved, report
from meshes import DOFS_PER_CELL, ENERGIES, VALUES, bend, region, square
from mpi4py import MPI

from tmc_vem.energy import DENSITIES
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.support.memory import reuse_freed
from tmc_vem.vem.system import VemSystem

Work = dict[str, Callable[[], object]]


def vem(kind: str, name: str, n_dofs: float) -> tuple[VemSystem, Work]:
    """System of virtual elements, its tangent and its residual."""
    reuse_freed()  # as every run does
    system = VemSystem(distribute(MPI.COMM_WORLD, lambda: square(kind, n_dofs)), {"body": region(name)})
    u, matrix, out = system.create_vector(), system.create_matrix(), system.create_vector()
    labels = system.node_labels()
    u.getArray()[:] = bend(labels[:, :2]).ravel()
    return system, {"tangent": lambda: system.jacobian(u, matrix), "residual": lambda: system.residual(u, out)}


def fem(name: str, n_dofs: float, triangles: bool) -> tuple[Any, Work]:
    """dolfinx's own assembly of the compiled forms, without the energies and checks of this project."""
    from tmc_vem.fem import compat
    from tmc_vem.fem.system import FemSystem
    from tmc_vem.system.fem_settings import FemSettings

    energy = DENSITIES[ENERGIES[name]]
    values = {key: VALUES[key] for key in energy.parameters}
    density = RegionEnergy(energy, values, is_medium=True)
    system = FemSystem(
        MPI.COMM_WORLD,
        lambda: square("quadrilaterals", n_dofs),
        {"body": density},
        (),
        FemSettings(triangles=triangles),
    )
    u, matrix = system.create_vector(), system.create_matrix()
    u.getArray()[:] = bend(system.node_labels()[:, :2]).ravel()
    system._local_values(u)
    return system, {
        "tangent": lambda: compat.assemble_matrix(matrix, system._compiled.tangent),
        "residual": lambda: compat.assemble_vector(system._gradient, system._compiled.residual),
    }


def measure(name: str, n_dofs: float, repetitions: int) -> dict[str, Any]:
    """Microseconds a degree of freedom of every discretisation."""
    systems = {kind: vem(kind, name, n_dofs) for kind in DOFS_PER_CELL}
    systems["dolfinx P2"] = fem(name, n_dofs, triangles=True)
    systems["dolfinx Q2"] = fem(name, n_dofs, triangles=False)
    work = {f"{label}/{part}": run for label, (_, parts) in systems.items() for part, run in parts.items()}
    samples = interleaved(work, repetitions)
    result: dict[str, Any] = {"energy": name, "n_dofs_wanted": n_dofs}
    for label, (system, parts) in systems.items():
        result[label] = {"n_dofs": system.n_dofs, "n_cells": system.n_cells_global}
        for part in parts:
            sample = samples[f"{label}/{part}"]
            result[label][part] = {"best": sample.best / system.n_dofs, "median": sample.median / system.n_dofs}
    return result


def main() -> None:
    """Print ratios and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=[16000.0, 64000.0])
    parser.add_argument("--energies", nargs="+", default=["huhu_lulu", "angle"])
    parser.add_argument("--repetitions", type=int, default=7)
    arguments = parser.parse_args()
    results = [measure(name, n, arguments.repetitions) for name in arguments.energies for n in arguments.sizes]
    rows = []
    for r in results:
        reference = {part: r["dolfinx P2"][part]["best"] for part in ("tangent", "residual")}
        for label in (*DOFS_PER_CELL, "dolfinx P2", "dolfinx Q2"):
            tangent, residual = r[label]["tangent"]["best"], r[label]["residual"]["best"]
            rows.append((
                f"{r['energy']}, {label}", str(r[label]["n_dofs"]), f"{tangent * 1e6:.3f}",
                f"{tangent / reference['tangent']:.2f}", f"{residual * 1e6:.3f}",
                f"{residual / reference['residual']:.2f}", f"{residual / tangent:.3f}",
            ))  # fmt: skip
    columns = ("energy, cells", "dofs", "tangent us/dof", "to P2", "residual us/dof", "to P2", "residual/tangent")
    report("assembly", "Assembly on one core, best of interleaved repetitions", columns, rows, {"results": results})


if __name__ == "__main__":
    main()
