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
@click.option("--states", "n_states", type=click.IntRange(1, 16), default=4, show_default=True, help="States shown.")
@click.option("--contact", is_flag=True, help="Contact alone: tractions on the solids, pressure along their outlines.")
@click.option(
    "--load", type=float, help="With --contact: the written state nearest to a load factor. Default: the last."
)
def plot(run_dir: Path, out: Path | None, quantity: str, n_states: int, contact: bool, load: float | None) -> None:
    """Draw curves and deformed states of a run as SVG and PNG, and a page with all of them. Examples:

    \b
      tmc-vem plot runs/box
      tmc-vem plot runs/box --contact --load 0.5
    """
    from tmc_vem.report.run_page import contact_page, run_page
    from tmc_vem.report.write import write_page
    from tmc_vem.results.run_result import RunResult

    result = RunResult.read(run_dir)
    if load is not None and not contact:
        raise InputError("--load belongs to --contact: --states says how many deformed states are drawn")
    page = contact_page(result, load) if contact else run_page(result, quantity=quantity, n_states=n_states)
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
@click.option("--out", type=click.Path(path_type=Path), help="File to write (.gif). Default: deformed.gif in the run.")
@click.option(
    "--quantity",
    type=click.Choice(["uy", "ux", "J", "energy"]),
    default="uy",
    show_default=True,
    help="What colours the states.",
)
@click.option("--seconds", type=click.FloatRange(0.01, 10.0), default=0.25, show_default=True, help="For each state.")
def animate(run_dir: Path, out: Path | None, quantity: str, seconds: float) -> None:
    """Animate the deformed states that a run has written; more of them with run --snapshots. Example:

    \b
      tmc-vem animate runs/box --out box.gif
    """
    from tmc_vem.report.animation import animate as write_animation
    from tmc_vem.report.animation import states_of
    from tmc_vem.results.run_result import RunResult

    target = out or run_dir / "deformed.gif"
    if target.suffix != ".gif":
        raise InputError(f"{target}: animations are written as .gif")
    states = states_of(RunResult.read(run_dir))
    if not states:
        raise InputError(f"{run_dir} has no fields yet")
    try:
        write_animation(states, target, quantity=quantity, seconds_each=seconds)
    except OSError as error:
        raise InputError(f"{target} cannot be written: {error.strerror or error}") from None
    click.echo(str(target))
