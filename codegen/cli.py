"""The command that generates, shows and checks the kernel of an energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from codegen.backends import TARGETS
from codegen.by_parameters import ParameterKernel, compile_by_parameters
from codegen.compiler import derive, generate, versions
from codegen.driver import Driver
from codegen.errors import CodegenError
from codegen.finding import Finding
from codegen.kernel import Kernel, compiled
from codegen.reference import fault_at_reference
from codegen.show import derivation
from codegen.trace import trace
from codegen.userfile import LoadedDensity, load_density
from codegen.verify import DECLARED_OTHERWISE, verify

UNSET = 1.0  # value at which a parameter without a given one is checked


class _OneLineErrors(click.Command):
    """Reports a CodegenError in one line with exit code 2; as a part of another command it leaves that to it."""

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except CodegenError as error:
            if ctx.parent is not None:
                raise
            click.echo(f"Error: {error}", err=True)
            ctx.exit(error.exit_code)


def _parse_parameters(_ctx: click.Context, _option: click.Parameter, values: Sequence[str]) -> dict[str, float]:
    parsed = {}
    for text in values:
        name, separator, number = text.partition("=")
        try:
            parsed[name.strip()] = float(number)
        except ValueError:
            separator = ""
        if not separator or not name.strip():
            raise click.BadParameter(f"'{text}' is not name=value, for example kappa=0.1")
    return parsed


def make_command(drivers: Mapping[str, Driver] | None = None) -> click.Command:
    """The command for kernels with a driver, or without: a package that has one makes its own command.

    Args:
        drivers: by the target in whose language they are.
    """

    @click.command("codegen", cls=_OneLineErrors)
    @click.argument("energy", metavar="FILE.py:FUNCTION")
    @click.option(
        "-o", "--output", type=click.Path(path_type=Path), help="Directory to write NAME.c and NAME.h, or NAME.cu, to."
    )
    @click.option(
        "--target",
        type=click.Choice(TARGETS),
        default="c",
        show_default=True,
        help="Language. cuda is a source to build into programs of your own: tmc-vem itself does not run on GPUs yet.",
    )
    @click.option("--check", is_flag=True, help="Compile the kernel and verify values, derivatives and objectivity.")
    @click.option("--show", is_flag=True, help="Print the symbolic energy, P, T and operation counts.")
    @click.option(
        "--param",
        "values",
        multiple=True,
        metavar="NAME=VALUE",
        callback=_parse_parameters,
        help="Parameter of the energy with its value; repeat for several. Declares it if the file does not.",
    )
    def main(energy: str, output: Path | None, target: str, check: bool, show: bool, values: dict[str, float]) -> None:
        """Generate the C kernel, or the device source, of an energy density written in Python.

        FILE.py:FUNCTION names a function density(F, G, p, m); package.module:FUNCTION works as well. --check compiles
        device source as plain C++ and runs it here.
        """
        if not (output or check or show):
            raise CodegenError("nothing to do: give -o DIR to write the kernel, --check or --show")
        loaded = load_density(energy).with_values(values)
        driver = (drivers or {}).get(target)
        if output or show:
            _write_and_show(loaded, output, show, target, driver)
        if check and not (_check(loaded, driver) if target == "c" else _check_on_host(loaded, target)):
            click.get_current_context().exit(1)

    return main


def _write_and_show(loaded: LoadedDensity, output: Path | None, show: bool, target: str, driver: Driver | None) -> None:
    traced = trace(loaded.integrand)
    source = generate(traced, loaded.description, versions(), driver, target)
    if output:
        for path in _write(output, loaded.name, source.files):
            click.echo(f"wrote {path}")
    if show:
        fault = fault_at_reference(traced, _values(loaded))
        for line in derivation(derive(traced), source, fault):
            click.echo(line)


def _write(directory: Path, name: str, texts: Mapping[str, str]) -> list[Path]:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        paths = []
        for suffix, text in texts.items():
            paths.append(directory / f"{name}{suffix}")
            paths[-1].write_text(text)
    except OSError as error:
        raise CodegenError(f"cannot write to {directory}: {error.strerror}") from error
    return paths


def _values(loaded: LoadedDensity) -> dict[str, float]:
    """Values of all parameters, also of those that were given none."""
    return {name: UNSET if value is None else value for name, value in loaded.parameters.items()}


def _check(loaded: LoadedDensity, driver: Driver | None) -> bool:
    """Compile the kernel, print the verification table, and say whether everything passed."""
    kernel = Kernel(compiled(loaded.integrand, driver), loaded.integrand)
    return _verified(loaded, kernel, compile_by_parameters(loaded.integrand))


def _check_on_host(loaded: LoadedDensity, target: str) -> bool:
    """The same of device source: what it computes is checked, but not on a device."""
    from codegen.backends.host import HostKernel, compile_on_host

    source = generate(trace(loaded.integrand), loaded.description, target=target)
    with TemporaryDirectory() as directory:
        passed = _verified(loaded, HostKernel(compile_on_host(source, Path(directory)), loaded.integrand), None)
    click.echo("The device source was compiled as plain C++ and run on this machine's processor, not on a GPU.")
    return passed


def _verified(loaded: LoadedDensity, kernel: Kernel, derivatives: ParameterKernel | None) -> bool:
    values = _values(loaded)
    findings = verify(kernel, loaded.function, values, loaded.declared, by_parameters=derivatives)
    _print_table(loaded, values, findings)
    return all(finding.passed for finding in findings)


def _print_table(loaded: LoadedDensity, values: Mapping[str, float], findings: Sequence[Finding]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    given = ", ".join(
        f"{name} = {value:g}{' (no value given)' if loaded.parameters[name] is None else ''}"
        for name, value in values.items()
    )
    table = Table(title=f"{loaded.name}{': ' + given if given else ''}", title_justify="left")
    for heading in ("property", "measured", "required", ""):
        table.add_column(heading, justify="right" if heading in ("measured", "required") else "left")
    for finding in findings:
        table.add_row(finding.what, finding.measured, finding.required, _verdict(finding))
    console.print(table)
    for finding in findings:
        if finding.words:
            console.print(f"{'note' if finding.passed else 'FAIL'}: {finding.words}", markup=False, soft_wrap=True)
    failed = sum(not finding.passed for finding in findings)
    console.print(f"{loaded.name}: {failed} of {len(findings)} checks failed" if failed else f"{loaded.name}: verified")


def _verdict(finding: Finding) -> str:
    if not finding.passed:
        return "[red]FAIL[/red]"
    return "[yellow]-[/yellow]" if finding.required == DECLARED_OTHERWISE else "[green]pass[/green]"
