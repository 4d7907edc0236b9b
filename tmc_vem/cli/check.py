"""``tmc-vem check FILE.toml``: what a run would check and what the problem consists of, in a second or two."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tmc_vem.cli.field_options import setting, with_options
from tmc_vem.cli.shared_options import change_option
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.assignments import parse_changes
from tmc_vem.support.errors import InputError, TmcError
from tmc_vem.support.validation import printable

if TYPE_CHECKING:
    from tmc_vem.design.checkup import DesignCheckup
    from tmc_vem.problems.own import OwnProblem
    from tmc_vem.simulation.checkup import Checkup

# Corners that are listed; the picture has all.
MOST_CORNERS = 8
PICTURES = (".png", ".svg", ".pdf")


@click.command("check")
@click.argument("file", metavar="FILE.toml")
@with_options([change_option(), setting(RunOptions, "method", optional=True)])
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="PICTURE",
    help="Picture to write: .png, .svg or .pdf. Default: NAME-check.png of NAME.toml, in this directory.",
)
@click.option("--no-picture", is_flag=True, help="Draw nothing.")
@click.option("--strict", is_flag=True, help="Exit code 1 if there is a caution.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON on stdout, and nothing else.")
def check_file(
    file: str, changes: tuple[str, ...], method: str | None, output: Path | None, no_picture: bool, strict: bool,
    as_json: bool,
) -> None:  # fmt: skip
    """Check a problem file before it is run, and draw it.

    Everything is checked that 'run' checks before its first load step: what passes here begins there. Printed are
    sizes, narrow gaps and the cells across them, what holds each part, materials, load, probes and sharp corners, and
    drawn are mesh, regions, supports, load, probes and sharp corners. Cautions say what may go wrong, with a remedy.
    Examples:

    \b
      tmc-vem check demos/problems/seal.toml
      tmc-vem check demos/problems/seal.toml --set mesh.size=0.1 --output coarse.svg
      tmc-vem check demos/problems/seal.toml --strict --json > seal.json
    """
    import dataclasses

    from tmc_vem.simulation.checkup import check
    from tmc_vem.simulation.problem_file import read_problem

    picture = None if no_picture else _picture(file, output)
    problem, options = read_problem(file, parse_changes(changes))
    options = dataclasses.replace(options, method=method or options.method)
    found = check(problem, options)
    design = _design(problem, options)
    if design is not None:
        found = dataclasses.replace(found, cautions=(*found.cautions, *design.cautions))
    if picture is not None:
        try:
            found.figure().savefig(picture, dpi=150)
        except OSError as error:
            raise InputError(f"--output {picture} cannot be written: {error.strerror or error}") from None
    if as_json:
        more = {} if design is None else {"design": design.as_dict()}
        drawn = {"picture": None if picture is None else str(picture)}
        click.echo(json.dumps({**found.as_dict(), **more, **drawn}, indent=2))
    else:
        click.echo("\n".join(summary(found, () if design is None else design.lines())))
        if picture is not None:
            click.echo(f"picture: {picture}")
    n = len(found.cautions)
    if strict and n:
        raise TmcError(f"{n} caution{'s' if n > 1 else ''}, and --strict allows none")


def _design(problem: OwnProblem, options: RunOptions) -> DesignCheckup | None:
    """What there is to say about the table [design], if there is one."""
    if problem.table.design is None:
        return None
    from tmc_vem.cli.execute import start_petsc
    from tmc_vem.design.checkup import check_design

    start_petsc("", clean_stdout=True)
    return check_design(problem, options)


def summary(found: Checkup, of_design: Sequence[str] = ()) -> list[str]:
    """What was found, in lines, those of a design among them."""
    unit = found.problem.units()
    length = f" {unit.length}" if unit.declared else ""
    lines = [
        f"problem '{found.name}': {found.n_cells} cells, {found.n_nodes} nodes, {found.n_dofs} degrees of freedom "
        f"({found.method}, order {found.order})",
        *_regions(found, length),
        *_gaps(found, length),
        *_parts(found, length),
        *_loads(found, length),
        *_probes(found, length),
        *_corners(found),
        *of_design,
        *([f"cautions: {len(found.cautions)}"] if found.cautions else ["cautions: none"]),
        *(f"  {text}" for text in found.cautions),
    ]
    return [printable(line) for line in lines]


def _regions(found: Checkup, length: str) -> list[str]:
    lines = ["regions:"]
    for region in found.regions:
        of = found.materials[region.name]
        moduli = {name: of[name] for name in ("E", "nu", "K", "mu") if name in of}
        more = {name: value for name, value in of["parameters"].items() if name not in moduli}
        more |= of.get("friction", {})
        values = ", ".join(f"{name} = {value:.5g}" for name, value in {**moduli, **more}.items())
        lines += [
            f"  {region.name}: {region.n_cells} cells of size {region.smallest:.3g} to {region.largest:.3g}{length}, "
            f"{2 * region.n_nodes} degrees of freedom, area {region.area:.4g}",
            f"    {_kind(of)}, energy '{of['energy']}': {values or 'no parameters'}",
        ]
    return lines


def _kind(of: Mapping[str, Any]) -> str:
    if of.get("design"):
        return "design region, a solid in third medium"
    return "third medium" if of["medium"] else "solid"


def _gaps(found: Checkup, length: str) -> list[str]:
    lines = [
        f"  {_between(gap.solids)}: {gap.width:.3g}{length} at ({gap.place[0]:.4g}, {gap.place[1]:.4g}), "
        f"{gap.n_cells} cell{'s' if gap.n_cells > 1 else ''} across"
        for gap in found.gaps
    ]
    return ["narrowest gaps:", *lines] if lines else ["narrowest gaps: no two surfaces face each other across medium"]


def _between(solids: tuple[str, str]) -> str:
    return f"within {solids[0]}" if solids[0] == solids[1] else f"{solids[0]} and {solids[1]}"


def _parts(found: Checkup, length: str) -> list[str]:
    lines = []
    for part in found.parts:
        held = ", ".join(f"{_value(what, value, length)} at {where}" for what, where, value in part.conditions)
        lines.append(
            f"  {', '.join(part.regions)} around ({part.middle[0]:.4g}, {part.middle[1]:.4g}), {part.n_cells} cells: "
            f"{held or 'only the medium, as the file says'}"
        )
    return ["what holds and moves each part:", *lines]


def _loads(found: Checkup, length: str) -> list[str]:
    lines = []
    for load in found.loads:
        at = f"{load.n_vertices} {'vertices' if load.n_vertices > 1 else 'vertex'}"
        name = f"load {load.name}" if load.name else "load"
        lines.append(f"{name}: {_value(load.what, load.value, length)} at {load.at}, {at}")
    steps = "automatic steps" if found.steps is None else f"{found.steps} equal steps"
    return [*lines, f"path: {' '.join(f'{factor:g}' for factor in found.path)} in {steps}"]


def _value(what: str, value: float | tuple[float, float], length: str) -> str:
    """A condition or load in words; only displacements have a unit of their own here."""
    shown = f"({value[0]:g}, {value[1]:g})" if isinstance(value, tuple) else f"{value:g}"
    unit = {"rotation": " degrees", **dict.fromkeys(("ux", "uy", "normal", "tangential"), length)}
    return f"{what} = {shown}{unit.get(what, '')}"


def _probes(found: Checkup, length: str) -> list[str]:
    lines = []
    for name, probe in found.probes.items():
        initially = f", {probe['initially']:.4g}{length} before loading" if "initially" in probe else ""
        lines.append(f"  {name}: {probe['what']}{initially}")
    return ["probes:", *lines] if lines else ["probes: none"]


def _corners(found: Checkup) -> list[str]:
    if not found.corners:
        return ["sharp corners in the medium: none"]
    shown = found.corners[:MOST_CORNERS]
    more = len(found.corners) - len(shown)
    lines = [f"  {c.region} at ({c.place[0]:.4g}, {c.place[1]:.4g}): {c.angle:.0f} degrees" for c in shown]
    head = "sharp corners in the medium, which may slip into what they meet: round those, with a radius of some cells"
    return [head, *lines, *([f"  and {more} more"] if more else [])]


def _picture(file: str, output: Path | None) -> Path:
    """Where the picture goes.

    Raises:
        InputError: it is no name of a picture, or the directory is not there.
    """
    path = Path(f"{Path(file).stem}-check.png") if output is None else output
    if path.suffix.lower() not in PICTURES:
        raise InputError(f"--output {path}: a picture ends in {', '.join(PICTURES)}")
    if not path.parent.is_dir():
        raise InputError(f"--output {path}: there is no directory {path.parent}")
    return path
