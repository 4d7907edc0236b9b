"""``tmc-vem``: entry point, list of commands, and how errors become one line and an exit code."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any

import click

from tmc_vem.support.singleton import settle
from tmc_vem.support.version import VERSION

# command: (module, attribute, line for --help). Modules are imported when a command is used, so that --help is quick.
COMMANDS = {
    "run": ("tmc_vem.cli.run", "run_group", "Solve a problem and write results, fields and a picture."),
    "check": ("tmc_vem.cli.check", "check_file", "Check and draw a problem file before it is run."),
    "optimise": ("tmc_vem.cli.optimise", "optimise", "Find the best design of a problem file."),
    "extract": ("tmc_vem.cli.extract", "extract", "The outlines of a design as a problem of their own."),
    "resume": ("tmc_vem.cli.resume", "resume", "Go on with a run or a search that was stopped."),
    "compare": ("tmc_vem.cli.compare", "compare_group", "Virtual and finite elements on several meshes, as a report."),
    "sweep": ("tmc_vem.cli.sweep", "sweep", "Runs of a problem with all combinations of some values."),
    "gradient": ("tmc_vem.cli.gradient", "gradient", "Derivatives of results by numbers of a problem."),
    "reproduce": ("tmc_vem.cli.reproduce", "reproduce", "The paper's tables and figures beside ours."),
    "list": ("tmc_vem.cli.list", "list_runs", "Table of the runs below a directory."),
    "plot": ("tmc_vem.cli.plot", "plot", "Curves and states of a run as figures."),
    "animate": ("tmc_vem.cli.plot", "animate", "A run as an animated picture."),
    "mesh": ("tmc_vem.cli.mesh", "mesh_group", "Generate, describe, check and draw polygon meshes."),
    "codegen": ("tmc_vem.cli.codegen", "main", "Generate, show and check the kernel of your own energy."),
    "info": ("tmc_vem.cli.info", "info", "Print versions and what is available on this machine."),
}


class LazyGroup(click.Group):
    """Group that imports a command when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of ``COMMANDS``."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command itself."""
        if cmd_name not in COMMANDS:
            return None
        module, attribute, _ = COMMANDS[cmd_name]
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, _, line) in COMMANDS.items()])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(VERSION, prog_name="tmc-vem")
def cli() -> None:
    """Third medium contact with stabilization-free virtual elements.

    A very soft third medium fills the gaps between bodies and stiffens as it is squeezed, so that contact needs no
    search. Start with:

    \b
      tmc-vem run box --out runs/box
      mpirun -n 2 tmc-vem run box --cells 80 20 --out runs/box-fine
    """


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 failed check, 2 bad input, 3 load not reached, 130 interrupted."""
    # one thread per process unless the user says otherwise: small BLAS calls from many threads only get in their way
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    settle()
    sys.exit(_run(arguments))


def _run(arguments: list[str] | None) -> int:
    from tmc_vem.support.notes import heard_by
    from tmc_vem.support.validation import printable

    said: set[str] = set()

    def show(note: str) -> None:
        if note not in said and _rank() == 0:
            said.add(note)
            click.echo(f"tmc-vem: note: {printable(note)}", err=True)

    with heard_by(show):
        return _exit_code(arguments)


def _exit_code(arguments: list[str] | None) -> int:
    from codegen.errors import CodegenError
    from tmc_vem.support.errors import TmcError

    try:
        code: Any = cli.main(arguments, prog_name="tmc-vem", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except click.exceptions.Exit as leave:
        return int(leave.exit_code)
    except click.ClickException as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # click 8.1 has none: it prints the help itself
            error.show()
            return 2
        hint = f" ('{error.ctx.command_path} --help' explains)" if getattr(error, "ctx", None) else ""  # type: ignore[attr-defined]
        return _report(f"{error.format_message()}{hint}", error.exit_code)
    except (TmcError, CodegenError) as error:
        _report(str(error), error.exit_code)
        if _mpi_runs() and _ranks() > 1:
            from mpi4py import MPI

            from tmc_vem.support.parallel import leave_together

            leave_together(MPI.COMM_WORLD, error.exit_code)
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return _report("interrupted", 130)
    except BrokenPipeError:
        return 1
    except OSError as error:  # a full disk, no permission: where it is said better, it has been
        if _ranks() > 1:
            _abort_all()
        where = f"{error.filename}: " if error.filename else ""
        return _report(f"{where}{error.strerror or error}", 1)
    except Exception:
        if _ranks() > 1:
            _abort_all()
        raise


def _abort_all() -> None:
    """Print the error and end all ranks: the others would wait for this one for ever."""
    import traceback

    from mpi4py import MPI

    traceback.print_exc()
    sys.stderr.flush()
    MPI.COMM_WORLD.Abort(1)


def _report(message: str, code: int) -> int:
    if _rank() == 0:
        from tmc_vem.support.validation import printable

        click.echo(f"tmc-vem: {printable(message)}", err=True)  # what a user typed may hold line breaks and worse
    return code


def _rank() -> int:
    return _world()[0]


def _ranks() -> int:
    return _world()[1]


def _mpi_runs() -> bool:
    return "mpi4py.MPI" in sys.modules


def _world() -> tuple[int, int]:
    """Rank and number of ranks, without starting MPI only to say that something was misspelt."""
    if _mpi_runs():
        world = sys.modules["mpi4py.MPI"].COMM_WORLD
        return int(world.rank), int(world.size)
    for rank, size in (("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("PMI_RANK", "PMI_SIZE")):
        if rank in os.environ:
            return int(os.environ[rank]), int(os.environ.get(size, "1"))
    return 0, 1
