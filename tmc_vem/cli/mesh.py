"""``tmc-vem mesh``: generate, describe, check and draw meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tmc_vem.support.errors import InputError

FILE = click.Path(path_type=Path)


@click.group("mesh")
def mesh_group() -> None:
    """Generate, describe, check and draw polygon meshes.

    Formats by suffix: .vtu, .vtk, .obj, .off, .mat and .nc for any polygons, .msh and .inp for triangles and
    quadrilaterals. Besides these, .vtp, .med and gmsh's geometries .geo can be read.
    """


@mesh_group.group("generate")
def generate() -> None:
    """Generate a mesh and write it to --out."""


out_option = click.option(
    "--out", type=FILE, required=True, help="File to write: .vtu, .vtk, .obj, .mat, .nc, .msh, ..."
)


@generate.command("rectangle")
@click.option("--width", type=float, default=1.0, show_default=True)
@click.option("--height", type=float, default=1.0, show_default=True)
@click.option("--size", type=float, default=0.1, show_default=True, help="Size of cells.")
@click.option(
    "--kind", type=click.Choice(["voronoi", "quadrilaterals", "triangles"]), default="voronoi", show_default=True
)
@click.option("--relaxation", default=10, show_default=True, help="Steps of Lloyd's method (voronoi).")
@click.option("--shortest", default=0.15, show_default=True, help="Collapse edges below this fraction of --size.")
@click.option("--seed", default=0, show_default=True, help="Of the random numbers (voronoi).")
@out_option
def rectangle(
    width: float, height: float, size: float, kind: str, relaxation: int, shortest: float, seed: int, out: Path
) -> None:
    """A rectangle with named edges bottom, right, top and left.

    \b
      tmc-vem mesh generate rectangle --size 0.02 --out square.vtu
    """
    import numpy as np

    from tmc_vem.mesh.cell_count import QUADRILATERALS
    from tmc_vem.mesh.make.estimate import check_size
    from tmc_vem.mesh.make.outline import Region
    from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
    from tmc_vem.mesh.parts import with_names
    from tmc_vem.support.environment import cells_allowed
    from tmc_vem.support.validation import require_positive

    for name, value in (("--width", width), ("--height", height), ("--size", size)):
        require_positive(name, value, "a length")
    a, b, c, d = (0.0, 0.0), (width, 0.0), (width, height), (0.0, height)
    if kind == "quadrilaterals":
        check_size([Region("domain", [a, b, c, d])], size, QUADRILATERALS, cells_allowed())
        x, y = (np.linspace(0.0, extent, max(1, round(extent / size)) + 1) for extent in (width, height))
        mesh = structured_quadrilaterals(x, y, [Rectangle("domain", 0.0, width, 0.0, height)])
    elif kind == "triangles":
        from tmc_vem.mesh.make.triangles import triangle_mesh

        mesh = triangle_mesh([Region("domain", [a, b, c, d])], size)
    else:
        from tmc_vem.mesh.make.voronoi import voronoi_mesh

        region = Region("domain", [a, b, c, d])
        mesh = voronoi_mesh([region], size, relaxation=relaxation, shortest=shortest, seed=seed)
    _write(with_names(mesh, lines={"bottom": (a, b), "right": (b, c), "top": (c, d), "left": (d, a)}), out)


@generate.command("box")
@click.option("--cells", type=int, nargs=2, default=(40, 10), show_default=True)
@click.option("--refine-medium", default=1, show_default=True)
@out_option
def box(cells: tuple[int, int], refine_medium: int, out: Path) -> None:
    """The box of section 5.1."""
    from tmc_vem.problems import Box

    _write(Box(cells=cells, medium_refinement=refine_medium).make_mesh(), out)


@generate.command("cbox")
@click.option("--cells", type=int, nargs=2, default=(20, 10), show_default=True)
@click.option("--mesh", "solid_cells", type=click.Choice(["polygons", "quadrilaterals"]), default="polygons")
@click.option("--refine-medium", default=1, show_default=True)
@out_option
def cbox(cells: tuple[int, int], solid_cells: str, refine_medium: int, out: Path) -> None:
    """The C-box of section 5.2."""
    from tmc_vem.problems import CBox

    _write(CBox(cells, refine_medium, solid_cells).make_mesh(), out)


@generate.command("punch")
@click.option("--size", type=float, default=0.1, show_default=True)
@click.option("--gap0", type=float, default=0.6, show_default=True)
@out_option
def punch(size: float, gap0: float, out: Path) -> None:
    """The punch problem of section 5.3."""
    from tmc_vem.problems import Punch

    _write(Punch(size=size, gap0=gap0).make_mesh(), out)


@generate.command("bodies")
@click.option("--size", type=float, default=0.1, show_default=True)
@click.option("--discs", type=int, default=7, show_default=True)
@click.option("--gap0", type=float, default=0.1, show_default=True)
@out_option
def bodies(size: float, discs: int, gap0: float, out: Path) -> None:
    """The several bodies of section 5.4."""
    from tmc_vem.problems import Bodies

    _write(Bodies(size=size, discs=discs, gap0=gap0).make_mesh(), out)


def _reading(function: Any) -> Any:
    """Options of how a file is read."""
    region_data = click.option(
        "--region-data", metavar="NAME", help="Cell data whose values are regions (default: region, MaterialIds, ...)."
    )
    cracks = click.option(
        "--cracks", type=click.Choice(["join", "keep"]), default="join", show_default=True,
        help="Vertices at the same place are a fault (join), or cracks that are meant (keep).",
    )  # fmt: skip
    return region_data(cracks(function))


@mesh_group.command("info")
@click.argument("file", type=FILE)
@click.option("--order", default=2, show_default=True, help="Order k of the elements, for l and memory.")
@_reading
def info(file: Path, order: int, region_data: str | None, cracks: str) -> None:
    """Print counts, kinds of polygons, quality, chosen degrees l and memory."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from tmc_vem.mesh.files.io import read_mesh

    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold")
    table.add_column()
    for name, value in describe(read_mesh(file, region_data=region_data, cracks=cracks), order):
        table.add_row(Text(name), Text(value))  # names may hold what rich takes for markup
    Console().print(table, highlight=False)


@mesh_group.command("check")
@click.argument("file", type=FILE)
@click.option("--fix", type=FILE, metavar="OUT", help="Write a repaired mesh there: turned, merged, welded.")
@click.option(
    "--tolerance", type=float, metavar="FRACTION",
    help="With --fix: merge vertices closer than this fraction of the sides there, collapse edges shorter than this "
    "fraction of the width of their cells. By default slits up to 0.001 are joined, edges up to 0.0001 collapsed.",
)  # fmt: skip
@_reading
def check(file: Path, fix: Path | None, tolerance: float | None, region_data: str | None, cracks: str) -> int:
    """Name everything that is wrong with a mesh; exit code 1 if anything is (and --fix cannot repair it)."""
    from tmc_vem.mesh.check import find_faults, summaries
    from tmc_vem.mesh.files.io import read_mesh, write_mesh
    from tmc_vem.mesh.make.repair import repair

    if tolerance is not None:
        from tmc_vem.support.validation import require_within

        if fix is None:
            raise InputError(f"--tolerance {tolerance:g} is for --fix: give a file to write")
        require_within("--tolerance", tolerance, 0.0, 0.5, "a fraction of the sides; try 0.001")
    notes: list[str] = []
    mesh = read_mesh(file, validate=False, region_data=region_data, cracks=cracks, notes=notes)
    for note in notes:
        click.echo(f"note: {_printable(note)}")
    faults = find_faults(mesh, cracks=cracks == "keep")
    kinds = dict.fromkeys(fault.kind for fault in faults)
    for kind, line in zip(kinds, summaries(faults), strict=True):
        fixable = all(fault.fixable for fault in faults if fault.kind == kind) and not fix
        click.echo(f"{kind}: {_printable(line)}{' [--fix repairs this]' if fixable else ''}")
    if fix is not None:
        write_mesh(repair(mesh, tolerance), fix)
        click.echo(f"{len(faults)} fault{'' if len(faults) == 1 else 's'} repaired, written to {fix}")
        return 0
    count = f"{len(faults)} fault{'' if len(faults) == 1 else 's'}" if faults else "no faults"
    click.echo(f"{mesh.n_cells} cells, {mesh.n_vertices} vertices: {count}")
    return 1 if faults else 0


def _printable(line: str) -> str:
    return "".join(ch if ch.isprintable() else repr(ch)[1:-1] for ch in line)


@mesh_group.command("plot")
@click.argument("file", type=FILE)
@click.option("--out", type=FILE, required=True, help="Picture to write: .png, .pdf or .svg.")
@click.option("--numbers", is_flag=True, help="Write the number of each cell into it.")
@_reading
def plot(file: Path, out: Path, numbers: bool, region_data: str | None, cracks: str) -> None:
    """Draw a mesh, coloured by region, with named points and edges."""
    from tmc_vem.mesh.files.io import read_mesh
    from tmc_vem.report.mesh_figure import draw_mesh

    if out.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise InputError(f"--out {out}: use .png, .pdf or .svg")
    draw_mesh(read_mesh(file, region_data=region_data, cracks=cracks), out, numbers=numbers)
    click.echo(f"written to {out}")


def describe(mesh: Any, order: int) -> list[tuple[str, str]]:
    """Names and values for ``info``."""
    import numpy as np

    from tmc_vem.mesh.quality import measure
    from tmc_vem.vem.spaces.element import build_elements
    from tmc_vem.vem.spaces.element_settings import ElementSettings

    quality = measure(mesh)
    settings = ElementSettings(order=order)
    n_edges = len(mesh.edges)
    n_dofs = 2 * (mesh.n_vertices + n_edges * (order - 1) + mesh.n_cells * order * (order - 1) // 2)
    counts = np.bincount(mesh.n_sides_c)
    rows = [
        ("cells", f"{mesh.n_cells}, {mesh.n_vertices} vertices, {n_edges} edges"),
        ("degrees of freedom", f"{n_dofs} for k = {order}"),
        ("polygons", ", ".join(f"{counts[n]} with {n} sides" for n in np.flatnonzero(counts))),
    ]
    for r, name in enumerate(mesh.region_names):
        chosen = mesh.region_c == r
        rows.append((f"region {name}", f"{chosen.sum()} cells, area {quality.area_c[chosen].sum():.6g}"))
    if mesh.named_points:
        points = (f"{n} ({mesh.points_vx[v, 0]:.4g}, {mesh.points_vx[v, 1]:.4g})" for n, v in mesh.named_points.items())
        rows.append(("named points", ", ".join(points)))
    if mesh.named_edges:
        rows.append(("named edges", ", ".join(f"{n} ({len(e)})" for n, e in mesh.named_edges.items())))
    relative = quality.shortest_edge_c / quality.diameter_c
    worst, flat = int(relative.argmin()), int(quality.aspect_c.argmax())
    rows += [
        ("cell diameter", f"{quality.diameter_c.min():.4g} to {quality.diameter_c.max():.4g}"),
        ("shortest edge", f"{quality.shortest_edge_c.min():.4g}; {relative[worst]:.3g} of cell {worst}'s diameter"),
        ("aspect", f"up to {quality.aspect_c[flat]:.3g}, cell {flat}"),
        ("not convex", f"{(~quality.convex_c).sum()} cells; not star-shaped about the centroid: "
                       f"{(~quality.star_shaped_c).sum()}"),
    ]  # fmt: skip
    try:
        groups = build_elements(mesh, settings)
    except InputError as error:
        rows.append(("projection", str(error)))
        return rows
    cells: dict[tuple[str, int], int] = {}
    for group in groups:
        cells[group.projection, group.n_sides] = cells.get((group.projection, group.n_sides), 0) + len(group.cells)
    for name in sorted({name for name, _ in cells}):
        parts = ", ".join(f"{n} with {sides} sides" for (other, sides), n in sorted(cells.items()) if other == name)
        rows.append((f"l = {name}" if name.isdigit() else name, parts))
    tables, shapes = sum(g.tables.nbytes for g in groups), sum(len(g.tables.h_s) for g in groups)
    n_points = sum(len(g.cells) * len(g.tables.piece_q) for g in groups)
    rows.append(("elements", f"{shapes} shapes in {tables / 1e6:.1f} MB, {n_points} quadrature points"))
    return rows


def _write(mesh: Any, out: Path) -> None:
    from tmc_vem.mesh.files.io import write_mesh

    write_mesh(mesh, out)
    click.echo(f"{mesh.n_cells} cells, {mesh.n_vertices} vertices written to {out}")
