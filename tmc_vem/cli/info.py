"""``tmc-vem info``: versions and what is available."""

from __future__ import annotations

import importlib.util

import click

# what: (module, what for)
OPTIONAL = {
    "dolfinx": ("dolfinx", "--method fem"),
    "gmsh": ("gmsh", "triangles, .geo files"),
    "pandas": ("pandas", "RunResult.to_pandas"),
    "pyvista": ("pyvista", "RunResult.to_pyvista"),
    "sphinx": ("sphinx", "make docs"),
}


@click.command("info")
def info() -> None:
    """Print versions and what is available on this machine."""
    from tmc_vem.support.petsc_start import start

    start(["tmc-vem"])
    from mpi4py import MPI

    from codegen.build import cache_directory, compiler
    from codegen.errors import CodegenError
    from tmc_vem.simulation.provenance import versions

    if MPI.COMM_WORLD.rank:
        return
    rows = {name: str(value) for name, value in versions(MPI.COMM_WORLD.size).items() if name != "command"}
    try:
        rows["C compiler"] = " ".join(compiler())
        rows["kernel cache"] = str(cache_directory())
    except CodegenError as error:
        rows["C compiler"] = str(error)
    for name, (module, purpose) in OPTIONAL.items():
        found = importlib.util.find_spec(module)
        rows[name] = f"{'available' if found else 'not installed'}: {purpose}"
    width = max(map(len, rows))
    for name, value in rows.items():
        click.echo(f"{name:<{width}}  {value}")
