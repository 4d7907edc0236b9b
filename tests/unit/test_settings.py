"""What a setting is, is said once: docstrings, checks and options of the command line are made from its field."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from tmc_vem import Medium, RunOptions
from tmc_vem.cli.compare import compare_group
from tmc_vem.cli.field_options import setting, with_options
from tmc_vem.cli.resume import resume
from tmc_vem.cli.run import run_group
from tmc_vem.cli.run_file import problem_command
from tmc_vem.cli.shared_options import DECIDED
from tmc_vem.energy import REGULARISERS
from tmc_vem.problems.description import MediumTable
from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, about_of, described, field_of
from tmc_vem.support.validation import check_fields
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.candidates import BY_PROJECTION
from tmc_vem.vem.spaces.element_settings import PROJECTIONS, ElementSettings

CLASSES = (RunOptions, ElementSettings, FemSettings, Medium, MediumTable)


def option_of(command: click.Command, name: str) -> click.Option:
    (option,) = (p for p in command.params if p.name == name)
    assert isinstance(option, click.Option)
    return option


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_every_field_says_what_it_is_and_the_docstring_has_it(cls: Any) -> None:
    for field in dataclasses.fields(cls):
        said = about_of(field)
        assert said is not None, field.name
        assert said.text[0].isalnum(), said.text
        assert said.text.endswith("."), said.text
        assert f"\n    {field.name}: {said.text}" in cls.__doc__.replace("``tmc_``", "tmc_")
    assert cls.__doc__.count("Attributes:") == 1


@pytest.mark.parametrize(
    ("cls", "name", "option"),
    [
        *((RunOptions, name, name) for name in ("method", "steps", "solver", "follow", "snapshots", "max_seconds")),
        *((ElementSettings, name, name) for name in ("order", "degree", "projection", "rule", "eta")),
        *((FemSettings, name, name) for name in ("interior_penalty", "triangles")),
        *((Medium, name, name) for name in ("gamma", "alpha", "alpha_r", "regulariser", "beta", "parameters")),
    ],
)
def test_options_of_the_command_line_are_the_fields(cls: Any, name: str, option: str) -> None:
    made, field = option_of(run_group.commands["box"], option), field_of(cls, name)
    said = about_of(field)
    assert said is not None
    assert made.help is not None
    assert said.text[1:] in made.help
    if said.choices:
        assert isinstance(made.type, click.Choice)
        assert tuple(made.type.choices) == said.choices
    if field.default not in (dataclasses.MISSING, None, False):
        assert made.default == field.default


@pytest.mark.parametrize("name", DECIDED)
def test_a_problem_file_decides_what_is_not_given(name: str) -> None:
    of_file, of_box = (option_of(c, name) for c in (problem_command("seal.toml"), run_group.commands["box"]))
    given, _ = of_file.handle_parse_result(click.Context(problem_command("seal.toml")), {}, [])
    assert given in (None, ())
    assert (of_box.help or "").startswith(of_file.help or "-")
    assert "Default" not in (of_file.help or "")


def test_comparisons_and_resume_have_the_same_options() -> None:
    box = run_group.commands["box"]
    for name in ("gamma", "alpha", "steps"):
        assert option_of(compare_group.commands["box"], name).help == option_of(box, name).help
    of_both = option_of(box, "interior_penalty").help or ""  # in comparisons it is that of finite elements alone
    of_fem = option_of(compare_group.commands["box"], "interior_penalty").help
    assert of_fem == f"fem: {of_both[0].lower()}{of_both[1:]}"
    for name in ("as_json", "quiet"):
        assert option_of(resume, name).help == option_of(box, name).help


def test_regularisers_are_listed_from_their_table() -> None:
    text = option_of(run_group.commands["box"], "regulariser").help or ""
    assert all(regulariser.title in text for regulariser in REGULARISERS.values())


def test_every_projection_has_its_spaces() -> None:
    assert set(BY_PROJECTION) == set(PROJECTIONS)


@described
@dataclasses.dataclass(frozen=True)
class Oven:
    """Bakes."""

    heat: float = dataclasses.field(default=180.0, metadata=about("How hot.", detail="In degrees."))
    upper_side: str = dataclasses.field(default="on", metadata=about("Heat from above.", choices=("on", "off")))
    minutes: int | None = dataclasses.field(default=None, metadata=about("How long.", none="until it is done"))
    fan: bool = dataclasses.field(default=False, metadata=about("Move the air."))

    def __post_init__(self) -> None:
        check_fields(self)


def test_a_new_setting_is_one_field() -> None:
    doc = Oven.__doc__ or ""
    assert "heat: How hot. In degrees." in doc
    assert "upper_side: Heat from above. One of 'on', 'off'." in doc
    assert "minutes: How long. None: until it is done." in doc
    with pytest.raises(InputError, match=r"unknown upper side 'of' \(did you mean 'off'\?\): choose one of on, off"):
        Oven(upper_side="of")

    @click.command()
    @with_options([setting(Oven, name, before="oven:") for name in ("heat", "upper_side", "minutes", "fan")])
    def bake(**options: Any) -> None:
        click.echo(json.dumps(dataclasses.asdict(Oven(**options))))

    told = CliRunner().invoke(bake, ["--help"]).output
    assert "--heat FLOAT" in told
    assert "oven: how hot.  [default: 180.0]" in told
    assert "--upper-side [on|off]" in told
    assert "until it is done." in told
    assert told.index("--heat") < told.index("--upper-side") < told.index("--fan")
    done = CliRunner().invoke(bake, ["--minutes", "5", "--fan"])
    assert json.loads(done.output) == {"heat": 180.0, "upper_side": "on", "minutes": 5, "fan": True}


def test_run_directories_of_before_ask_with_false_for_flags_not_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """``triangulated`` was False there where the file decided."""
    seen: list[RunOptions] = []
    monkeypatch.setattr("tmc_vem.cli.run_file.execute", lambda problem, settings, options: seen.append(settings))
    monkeypatch.setattr(
        "tmc_vem.simulation.problem_file.read_problem", lambda *_: (None, RunOptions(triangulated=True, steps=3))
    )
    command = problem_command(str(Path("seal.toml")))
    assert command.callback is not None
    options = dict.fromkeys(DECIDED) | {"overwrite": False, "changes": ()}
    command.callback(**options | {"triangulated": False})
    command.callback(**options | {"steps": 5})
    assert [(run.triangulated, run.steps) for run in seen] == [(True, 3), (True, 5)]
