"""``tmc-vem info``: versions, what is available, what is missing and which command brings it."""

from __future__ import annotations

import click


@click.command("info")
def info() -> None:
    """Print versions, what is available on this machine, and which command brings what is missing."""
    from tmc_vem.support.petsc_start import start

    start(["tmc-vem"])
    from mpi4py import MPI

    from codegen.build import cache_directory, compiler
    from codegen.errors import CodegenError
    from tmc_vem.simulation.provenance import versions
    from tmc_vem.solve.packages import described
    from tmc_vem.support.optional import PACKAGES, python_headers, state

    if MPI.COMM_WORLD.rank:
        return
    rows = {name: str(value) for name, value in versions(MPI.COMM_WORLD.size).items() if name != "command"}
    rows["MPI"] = MPI.Get_library_version().split(",")[0].splitlines()[0].strip()
    rows["PETSc's solvers"] = described()
    try:
        rows["C compiler"] = " ".join(compiler())
        rows["kernel cache"] = str(cache_directory())
    except CodegenError as error:
        rows["C compiler"] = str(error)
    rows["Python.h"] = python_headers()
    rows |= {name: state(name) for name in PACKAGES}
    width = max(map(len, rows))
    for name, value in rows.items():
        click.echo(f"{name:<{width}}  {value}")
