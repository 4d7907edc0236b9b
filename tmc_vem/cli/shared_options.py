"""Options that several commands share, and the settings that are made of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.field_options import Decorator, setting, with_options
from tmc_vem.problems.materials import Medium
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.options import PATH, RunOptions
from tmc_vem.support.errors import InputError
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings


def medium_options(
    gamma: float = Medium.gamma, alpha_r: float = 1.0, regulariser: str = "huhu_lulu", beta: float = Medium.beta
) -> Decorator:
    """Options of the third medium, with the defaults of a command."""

    def weight(context: click.Context, _: click.Parameter, given: float | None) -> float | None:
        """The default of this command, unless alpha is given instead."""
        return alpha_r if given is None and context.params.get("alpha") is None else given

    return with_options(
        [
            setting(Medium, "gamma", default=gamma),
            setting(Medium, "alpha", is_eager=True),
            setting(Medium, "alpha_r", callback=weight, optional=True, after=f" [default: {alpha_r:g}]"),
            setting(Medium, "energy", "--medium-energy", "medium_energy"),
            setting(Medium, "log_j"),
            setting(Medium, "friction"),
            setting(Medium, "elastic_slip"),
            setting(Medium, "regulariser", default=regulariser, metavar="NAME"),
            setting(Medium, "parameters", "--param", "parameters", multiple=True, metavar="NAME=VALUE"),
            setting(Medium, "beta", default=beta),
        ]
    )


def angle_medium_options(gamma: float, alpha_r: float) -> Decorator:
    """Options of the third medium with the defaults of sections 5.2 to 5.4: regulariser (15), not damped."""
    return medium_options(gamma, alpha_r, "angle", 0.0)


def element_options(*, optional: bool = False) -> list[click.Option]:
    """Options of the discretisation; optional ones are None unless they are given."""
    return [
        setting(RunOptions, "method", optional=optional),
        setting(ElementSettings, "order", optional=optional),
        setting(ElementSettings, "degree", "--l", "degree", before="vem:", optional=optional),
        setting(ElementSettings, "projection", before="vem:", optional=optional),
        setting(ElementSettings, "rule", before="vem:", optional=optional),
        click.Option(
            ["--quadrature"], type=int, help=f"Quadrature degree. Default: 2 k (vem), {FemSettings.quadrature} (fem)."
        ),
        setting(FemSettings, "interior_penalty", optional=optional),
        setting(ElementSettings, "eta", optional=optional),
        setting(FemSettings, "triangles", before="fem:", optional=optional),
    ]


def penalty_option(default: str = FemSettings.interior_penalty, *, before: str = "") -> click.Option:
    """Option of the interior penalty, with the default of a command and what it says before."""
    return setting(FemSettings, "interior_penalty", before=before, default=default)


def change_option(values: str = "VALUE", after: str = "") -> click.Option:
    """``--set``: other values for entries of a problem file."""
    text = (
        "Another value for an entry of the file: regions.block.solid.mu=20, or of a list by number or name, "
        "support.top.ux=0. May be given several times."
    )
    help_text = f"{text} {after}".rstrip()
    return click.Option(["--set", "changes"], multiple=True, metavar=f"NAME={values}", help=help_text)


def out_options() -> list[click.Option]:
    """Options of where a run is written."""
    return [
        click.Option(["--out"], type=click.Path(path_type=Path), help="Run directory. Default: nothing is written."),
        setting(RunOptions, "overwrite"),
    ]


def display_options() -> list[click.Option]:
    """Options of what is shown."""
    return [
        click.Option(["--json", "as_json"], is_flag=True, help="Print result.json on stdout, and nothing else."),
        click.Option(["--quiet"], is_flag=True, help="No progress display and no summary."),
    ]


def petsc_option() -> click.Option:
    """Option for options of PETSc."""
    text = "PETSc options, e.g. '-tmc_mat_mumps_icntl_4 2'."
    return click.Option(["--petsc"], default="", metavar="OPTIONS", help=text)


def method_options() -> Decorator:
    """Options of discretisation, load stepping and output."""
    path = " ".join(f"{load:g}" for load in RunOptions.path)
    return with_options(
        [
            *load_options(path),
            setting(RunOptions, "max_iterations"),
            setting(RunOptions, "max_seconds"),
            *element_options(),
            *out_options(),
            setting(RunOptions, "checkpoint_every"),
            setting(RunOptions, "snapshots"),
            setting(RunOptions, "triangulated"),
            setting(RunOptions, "fields", metavar="NAMES"),
            *display_options(),
            setting(RunOptions, "solver", metavar="PRESET|FILE"),
            petsc_option(),
        ]
    )


def load_options(path: str | None, *, optional: bool = False) -> list[click.Option]:
    """Options of load stepping, with the default of the path; optional ones are None or empty unless they are given."""
    start = "For small gamma, e.g. --gamma 1e-7 --continuation gamma=1e-4 (below that with --rule triangles)."
    if optional:
        start = "For small gamma, e.g. --continuation gamma=1e-4."
    return [
        setting(RunOptions, "steps", optional=optional),
        setting(RunOptions, "path", metavar="'LOADS'", type=str, default=path, optional=optional),
        setting(
            RunOptions, "output_loads", "--at", "output_loads", type=float, multiple=True, default=(),
            show_default=False, metavar="LOAD",
        ),
        setting(RunOptions, "continuation", multiple=True, metavar="NAME=VALUE", after=start),
        setting(RunOptions, "follow", optional=optional),
        *limit_options(),
        *adapt_options(),
        setting(RunOptions, "friction_error", optional=optional),
        setting(RunOptions, "allow_overlap", optional=optional),
    ]  # fmt: skip


def adapt_options() -> list[click.Option]:
    """Options of meshes that are adapted; None or empty unless they are given."""
    return [
        setting(AdaptSettings, "of", "--adapt", "adapt_of", optional=True, metavar="NAMES"),
        setting(
            AdaptSettings, "tolerance", "--adapt-tolerance", "adapt_tolerance", optional=True, type=str, metavar="PART"
        ),
        setting(AdaptSettings, "rounds", "--adapt-rounds", "adapt_rounds", optional=True),
        setting(
            AdaptSettings, "at", "--adapt-at", "adapt_at", type=float, multiple=True, default=(), show_default=False,
            metavar="LOAD",
        ),
        setting(AdaptSettings, "estimator", "--adapt-estimator", "adapt_estimator", optional=True),
        setting(AdaptSettings, "meshes", "--adapt-meshes", "adapt_meshes", optional=True),
        setting(AdaptSettings, "cells", "--adapt-cells", "adapt_cells", optional=True),
    ]  # fmt: skip


ADAPT = "adapt_"  # what the names of these options begin with


def chosen_adapt(settings: AdaptSettings, options: Mapping[str, Any]) -> AdaptSettings:
    """Settings with those of :func:`adapt_options` that were given in their place.

    Raises:
        InputError: a value is out of range, or nothing says what the mesh is adapted to.
    """
    given = {
        name.removeprefix(ADAPT): value for name, value in options.items()
        if name.startswith(ADAPT) and value is not None and value is not False and value != ()
    }  # fmt: skip
    chosen = dataclasses.replace(settings, **given)
    if given and not chosen.names:
        first = next(iter(given))
        raise InputError(f"--adapt-{first} goes with --adapt NAMES, which say what the mesh is adapted to")
    return chosen


def limit_options() -> list[click.Option]:
    """Options of the limit for gamma to 0; None unless they are given."""
    after = "As --extrapolate-gamma path."
    return [
        setting(
            RunOptions, "extrapolate_gamma", is_flag=False, flag_value="end", type=click.Choice(["end", PATH]),
            default=None, show_default=False, after=after, callback=_limit,
        ),
        setting(RunOptions, "gamma_decades", optional=True),
    ]  # fmt: skip


def chosen_limit(options: dict[str, Any]) -> dict[str, Any]:
    """What was given of :func:`limit_options`, as arguments of :class:`tmc_vem.RunOptions`."""
    return {name: options[name] for name in LIMIT if options.get(name) is not None}


def _limit(_: click.Context, __: click.Parameter, given: str | bool | None) -> str | bool | None:
    """``True`` or ``'path'``, which a resumed run gives itself, from the word of the command line."""
    return True if given == "end" else given


def file_options() -> list[click.Parameter]:
    """Options of a problem file's command; those of its [solve] table are None or empty unless they are given."""
    return [
        change_option(),
        *load_options(None, optional=True),
        *(setting(RunOptions, name, optional=True) for name in ("max_iterations", "max_seconds")),
        *element_options(optional=True),
        *out_options(),
        *(setting(RunOptions, name, optional=True) for name in ("checkpoint_every", "snapshots", "triangulated")),
        setting(RunOptions, "fields", metavar="NAMES", optional=True),
        *display_options(),
        setting(RunOptions, "solver", metavar="PRESET|FILE", optional=True),
        petsc_option(),
    ]


LIMIT = ("extrapolate_gamma", "gamma_decades")
# Options that a problem file decides unless they are given.
DECIDED = (
    "method", "steps", "output_loads", "follow", "friction_error", "allow_overlap", "max_iterations", "max_seconds",
    "solver", *LIMIT, "checkpoint_every", "snapshots", "triangulated", "fields",
)  # fmt: skip
# Of the element of either method; what the other one has is refused.
OF_VEM = ("order", "degree", "quadrature", "projection", "rule", "interior_penalty", "eta")
OF_FEM = ("order", "quadrature", "interior_penalty", "eta", "triangles")


def with_given(settings: RunOptions, options: dict[str, Any]) -> RunOptions:
    """Run options of a problem file, with those of the command line that were given in their place.

    Raises:
        InputError: a value is out of range, or an option belongs to the other method.
    """
    # a flag is None or True; run directories of earlier versions ask to resume with False where it was not given
    given = {name: value for name, value in options.items() if value is not None and value is not False and value != ()}
    chosen = {name: given[name] for name in DECIDED if name in given}
    if "path" in given:
        chosen["path"] = parse_path(given["path"])
    if "continuation" in given:
        chosen["continuation"] = parse_parameters(given["continuation"], "--continuation")
    method = chosen.get("method", settings.method)
    _refuse_others(method, given)
    where, names = ("fem", OF_FEM) if method == "fem" else ("element", OF_VEM)
    element = {name: given[name] for name in names if name in given}
    if element:
        chosen[where] = dataclasses.replace(getattr(settings, where), **element)
    chosen["adapt"] = chosen_adapt(settings.adapt, options)
    return dataclasses.replace(settings, overwrite=options["overwrite"], **chosen)


def chosen_options(options: dict[str, Any]) -> RunOptions:
    """The run options of :func:`method_options`.

    Raises:
        InputError: a value is out of range, or an option belongs to the other method.
    """
    same = (
        "method", "steps", "solver", "output_loads", "follow", "friction_error", "allow_overlap", "max_iterations",
        "max_seconds",
        "snapshots", "triangulated", "fields", "checkpoint_every", "overwrite",
    )  # fmt: skip
    return RunOptions(
        **{name: options[name] for name in same},
        **chosen_limit(options),
        **method_settings(options),
        adapt=chosen_adapt(AdaptSettings(), options),
        path=parse_path(options["path"]),
        continuation=parse_parameters(options["continuation"], "--continuation"),
    )


def chosen_medium(options: dict[str, Any]) -> Medium:
    """The third medium of :func:`medium_options`.

    Raises:
        InputError: a value is out of range, or both alpha and alpha_r are given.
    """
    return Medium(
        gamma=options["gamma"],
        alpha_r=options["alpha_r"],
        alpha=options["alpha"],
        beta=options["beta"],
        energy=options["medium_energy"],
        log_j=options["log_j"],
        friction=options["friction"],
        elastic_slip=options["elastic_slip"],
        regulariser=options["regulariser"],
        parameters=parse_parameters(options["parameters"]),
    )


def method_settings(options: dict[str, Any]) -> dict[str, Any]:
    """Settings of the method in use, as arguments of :class:`tmc_vem.RunOptions`.

    Raises:
        InputError: a value is out of range, or an option belongs to the other method.
    """
    _refuse_others(options["method"], options)
    if options["method"] == "fem":
        given = {name: options[name] for name in ("quadrature", "eta") if options[name] is not None}
        return {
            "fem": FemSettings(
                order=options["order"],
                interior_penalty=options["interior_penalty"],
                triangles=options["triangles"],
                **given,
            )
        }
    return {"element": ElementSettings(**{name: options[name] for name in OF_VEM})}


def _refuse_others(method: str, options: dict[str, Any]) -> None:
    """Check that no option of the other method is given.

    Raises:
        InputError: one is.
    """
    if method == "fem":
        if options.get("degree") is not None:
            raise InputError("--l belongs to --method vem: finite elements project nothing")
        if options.get("projection", "auto") != "auto":
            raise InputError("--projection belongs to --method vem: finite elements project nothing")
        if options.get("rule", "auto") != "auto":
            raise InputError("--rule belongs to --method vem: finite elements have the rules of dolfinx")
    elif options.get("triangles"):
        raise InputError("--triangles belongs to --method fem")


def parse_path(text: str) -> tuple[float, ...]:
    """Load factors separated by blanks or commas.

    Raises:
        InputError: one is not a number.
    """
    try:
        return tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise InputError(f"--path '{text}' is not a list of load factors, for example '0 1 0'") from None


def parse_parameters(texts: tuple[str, ...], option: str = "--param") -> dict[str, float]:
    """Values of ``NAME=VALUE`` options.

    Raises:
        InputError: one is not of that form.
    """
    values = {}
    for text in texts:
        name, separator, number = text.partition("=")
        try:
            values[name.strip()] = float(number)
        except ValueError:
            separator = ""
        if not separator or not name.strip():
            example = "kappa=0.1" if option == "--param" else "gamma=1e-4"
            raise InputError(f"{option} '{text}' is not NAME=VALUE, for example {example}")
    return values
