"""``tmc-vem plot`` and ``tmc-vem animate``: figures of a run, whether it is done, goes on or was interrupted."""

from __future__ import annotations

from pathlib import Path

import click

from tmc_vem.support.errors import InputError

RUN = click.argument("run_dir", type=click.Path(path_type=Path))


@click.command("plot")
@RUN
@click.option("--out", type=click.Path(path_type=Path), help="Where figures go. Default: plots in the run directory.")
@click.option(
    "--quantity", type=click.Choice(["uy", "ux", "J", "energy"]), default="uy", show_default=True,
    help="What colours the deformed states.",
)  # fmt: skip
@click.option(
    "--field",
    metavar="NAME",
    help="Which field gets a large picture: ux, uy, J, min_J, energy_density, or what the run wrote of stress and "
    "strain (run --fields), as von_mises or cauchy_stress_xy. Default: von_mises; with an option below, the load's "
    "displacement component.",
)
@click.option(
    "--at",
    "load",
    type=float,
    metavar="LOAD",
    help="State in it, and of --contact, by load factor. Default: the last one.",
)
@click.option("--with-medium", is_flag=True, help="Colour the third medium in it as well; else solids only.")
@click.option(
    "--range", "span", type=(float, float), metavar="LOW HIGH", help="Ends of its colours. Default: of all shown."
)
@click.option("--states", "n_states", type=click.IntRange(1, 16), default=4, show_default=True, help="States shown.")
@click.option("--contact", is_flag=True, help="Contact alone: tractions on the solids, pressure along their outlines.")
def plot(
    run_dir: Path, out: Path | None, quantity: str, field: str | None, load: float | None, with_medium: bool,
    span: tuple[float, float] | None, n_states: int, contact: bool,
) -> None:  # fmt: skip
    """Draw curves and deformed states of a run as SVG and PNG, and a page with all of them. Examples:

    \b
      tmc-vem plot runs/box
      tmc-vem plot runs/box --field von_mises
      tmc-vem plot runs/box --field principal_stress_1 --at 0.5 --range -2 2
      tmc-vem plot runs/box --field cauchy_stress_yy --with-medium
      tmc-vem plot runs/box --contact --at 0.5
    """
    import math

    from tmc_vem.report.field_figure import Shown
    from tmc_vem.report.run_page import contact_page, run_page
    from tmc_vem.report.write import write_page
    from tmc_vem.results.run_result import RunResult
    from tmc_vem.support.validation import require_finite

    if load is not None:
        require_finite("at", load)
    others = {"--field": field is not None, "--with-medium": with_medium, "--range": span is not None}
    given = [name for name, is_given in others.items() if is_given]
    if contact and given:
        raise InputError(f"--contact shows contact alone, and no use is made of {', '.join(given)}: leave one out")
    result = RunResult.read(run_dir)
    shown = Shown(field, math.inf if load is None else load, with_medium, span)
    page = (
        contact_page(result, load) if contact else run_page(result, quantity=quantity, n_states=n_states, shown=shown)
    )
    try:
        report = write_page(page, out or run_dir / "plots", "contact" if contact else "run")
    except OSError as error:
        where = error.filename or out or run_dir
        raise InputError(f"{where} cannot be written: {error.strerror or error}; --out names another place") from None
    for picture in page.pictures:
        click.echo(str(report.parent / "figures" / f"{picture.name}.png"))
    click.echo(str(report))


@click.command("animate")
@RUN
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="File to write (.gif). Default: deformed.gif in the run; with --meshes adapted.gif.",
)
@click.option(
    "--quantity",
    type=click.Choice(["uy", "ux", "J", "energy"]),
    help="What colours the states. Default: uy.",
)
@click.option(
    "--meshes", is_flag=True, help="The meshes that the run was adapted on, round by round, in place of states."
)
@click.option(
    "--seconds",
    type=click.FloatRange(0.01, 10.0),
    help="For each state. Default: 0.25; with --meshes 1, for each mesh.",
)
def animate(run_dir: Path, out: Path | None, quantity: str | None, meshes: bool, seconds: float | None) -> None:
    """Animate the deformed states that a run has written; more of them with run --snapshots. Examples:

    \b
      tmc-vem animate runs/box --out box.gif
      tmc-vem animate runs/box --meshes          of a run with --adapt: a picture a round
    """
    from tmc_vem.report.animation import animate as write_animation
    from tmc_vem.report.animation import animate_meshes, meshes_of, states_of
    from tmc_vem.results.run_result import RunResult

    target = out or run_dir / ("adapted.gif" if meshes else "deformed.gif")
    if target.suffix != ".gif":
        raise InputError(f"{target}: animations are written as .gif")
    if meshes and quantity is not None:
        raise InputError("--meshes shows regions, and no use is made of --quantity: leave one out")
    result = RunResult.read(run_dir)
    states = meshes_of(result) if meshes else states_of(result)
    if not states:
        raise InputError(f"{run_dir} has no fields yet")
    try:
        if meshes:
            animate_meshes(states, target, seconds_each=seconds or 1.0)
        else:
            write_animation(states, target, quantity=quantity or "uy", seconds_each=seconds or 0.25)
    except OSError as error:
        raise InputError(f"{target} cannot be written: {error.strerror or error}") from None
    click.echo(str(target))
