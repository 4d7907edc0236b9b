"""What is drawn and listed of contact, by page and command; probes of contact."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from helpers_traction import LAYERS, changed, solved

from tmc_vem import RunResult
from tmc_vem.cli.main import cli
from tmc_vem.problems.contact_probe import Contact
from tmc_vem.problems.contact_quantities import OF_BODY, OF_PAIR
from tmc_vem.report.contact_figure import contact_of, contact_pictures
from tmc_vem.report.contact_tables import contact_tables
from tmc_vem.report.page import Picture, Text
from tmc_vem.report.run_page import contact_page, run_page
from tmc_vem.results.contact.curves import ContactCurves
from tmc_vem.results.contact_table import read_table
from tmc_vem.simulation.contact_probe import contact_reader
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units

PROBES = """[probes]
push = { contact = "force_y", of = "up" }
wide = { contact = "contact_length", of = "low-up" }
round = { contact = "half_width", of = "low-up" }
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    folder = tmp_path_factory.mktemp("layers")
    text = changed(LAYERS, ("snapshots = 0", "snapshots = 1"), ("[mesh]", PROBES + "[mesh]"))
    text = changed(text, ("gap =", 'units = { length = "mm", force = "N" }\ngap ='))
    solved(folder, text, folder / "run")
    return RunResult.read(folder / "run")


def test_probes_are_what_is_reported(run: RunResult) -> None:
    assert run.probes["push"] == run.contact["up"]["force_y"]
    assert run.probes["push"] > 0.1
    assert run.probes["wide"] == run.contact["low-up"]["contact_length"]
    assert math.isnan(run.probes["round"]), "a level pressure has no half width"
    assert [run.unit(name) for name in ("push", "wide", "round")] == ["N/mm", "mm", "mm"]


def test_what_probes_are_of() -> None:
    read = contact_reader({"a": Contact("force", "x"), "b": Contact("force", "y")}, None, None)  # type: ignore[arg-type]
    state: Any = SimpleNamespace(contact={"x": {"force": 3.0}})
    assert read(state) == {"a": 3.0, "b": 0.0}
    apart = {quantity: Contact(quantity, "x-y") for quantity in OF_PAIR}
    values = contact_reader(apart, None, None)(state)  # type: ignore[arg-type]
    unknown = [name for name, value in values.items() if math.isnan(value)]
    assert unknown == ["gap", "pressure_fit", "centre_x", "centre_y"], "a gap of 0 would be a closed one"
    assert {value for name, value in values.items() if name not in unknown} == {0.0}
    assert Contact("half_width", "a-b").kind == OF_PAIR["half_width"] == "length"
    assert str(Contact("half_width", "a-b")) == "half_width of contact, a-b"
    with pytest.raises(InputError, match=r"unknown contact 'width'.*choose one of force"):
        Contact("width", "a-b")


@pytest.mark.parametrize(
    ("quantity", "of", "says"),
    [
        ("force", "mid", "there is no body or pair 'mid': give one of low, up, or two of them in this order"),
        ("force", "up-low", "there is no body or pair 'up-low'"),
        ("gap", "low", "'low' is one body, which has force, force_x, force_y, moment: gap is that of a pair"),
    ],
)
def test_probes_of_what_is_not_there(quantity: str, of: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "layers.toml"
    path.write_text(changed(LAYERS, ("[mesh]", f'[probes]\np = {{ contact = "{quantity}", of = "{of}" }}\n[mesh]')))
    for command in (["check", str(path)], ["run", str(path), "--out", str(tmp_path / "run")]):
        done = CliRunner().invoke(cli, command)
        assert isinstance(done.exception, InputError)
        assert f"probes: p: of: {says}" in str(done.exception)
    assert Contact(quantity if of != "low" else "force", "low") is not None


def test_tables_of_contact(run: RunResult) -> None:
    bodies, pairs = contact_tables(run)
    assert list(bodies.head) == ["body", "force [N/mm]", "force x [N/mm]", "force y [N/mm]", "moment [N]"]
    assert [row[0] for row in bodies.rows] == ["low", "up"]
    assert bodies.rows[1][3] == f"{run.contact['up']['force_y']:.3e}"
    assert len(pairs.head) == len(OF_PAIR) + 2
    values = dict(zip(pairs.head, pairs.rows[0], strict=True))
    assert (values["pair"], values["half width [mm]"], values["contact length [mm]"]) == ("low-up", "–", "1.000e+00")
    assert values["regulariser's share of pressure"] in ("+0.00 %", "-0.00 %")
    plain = dataclasses.replace(run, inputs={}, checks={})
    assert list(contact_tables(plain)[0].head)[1:] == [name.replace("_", " ") for name in OF_BODY]
    assert len(contact_tables(plain)[1].head) == len(OF_PAIR) + 1


def axes_of(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures that are made of contact from now on."""
    made: list[Any] = []

    def keep(figure: Any, name: str, caption: str) -> Any:
        made.append(figure)
        return SimpleNamespace(name=name, caption=caption)

    monkeypatch.setattr("tmc_vem.report.contact_figure.picture", keep)
    return made


def test_pictures_show_tractions_and_pressure(run: RunResult, monkeypatch: pytest.MonkeyPatch) -> None:
    figures = axes_of(monkeypatch)
    found = contact_of(run)
    assert [each.name for each in found] == ["contact-tractions", "contact-pressure"]
    assert all(each.caption.endswith(", at displacement -0.5.") for each in found)
    tractions, along = figures
    whole, near = tractions.axes
    assert (whole.get_xlabel(), whole.get_ylabel()) == ("x [mm]", "y [mm]")
    assert near.get_title() == f"largest pressure {run.contact['low-up']['pressure_max']:.4g} N/mm^2"
    assert [text.get_text() for text in tractions.legends[0].get_texts()] == ["on low, from up", "on up, from low"]
    curves = run.traction()
    arrows = [each for each in whole.collections if type(each).__name__ == "Quiver"]
    for name, some in zip(("low", "up"), arrows, strict=True):
        mine = curves.between(name)
        tips = some.get_offsets() + np.column_stack([some.U, some.V])
        assert np.asarray(tips) == pytest.approx(curves.point_nx[mine])
        assert np.sign(some.V).tolist() == [-1.0 if name == "low" else 1.0] * mine.sum()
    pressure, shear = along.axes
    assert (pressure.get_ylabel(), shear.get_ylabel()) == ("pressure [N/mm^2]", "shear [N/mm^2]")
    for line, name in zip(pressure.lines, ("low", "up"), strict=True):
        assert line.get_ydata() == pytest.approx(curves.pressure_n[curves.between(name)])
        assert line.get_xdata()[[0, -1]] == pytest.approx([-0.5, 0.5])


def test_nothing_is_drawn_where_nothing_presses(run: RunResult, monkeypatch: pytest.MonkeyPatch) -> None:
    axes_of(monkeypatch)
    curves = run.traction()
    pulled = dataclasses.replace(curves, pressure_n=-curves.pressure_n)
    assert contact_pictures(pulled, None, Units(), "now") == []
    assert len(contact_pictures(curves, None, Units(), "now")) == 2


def test_pages_and_command(run: RunResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    drawn = [Picture("contact-a", "caption", b"", b"\x89PNG")]
    for name, block in (("_states", Text("")), ("_field", Text("")), ("_curves", [])):
        monkeypatch.setattr(f"tmc_vem.report.run_page.{name}", lambda *_, block=block: block)
    monkeypatch.setattr("tmc_vem.report.run_page.contact_of", lambda _, load=None: asked.append(load) or drawn)
    sections = {section.title: section for section in run_page(run).sections}
    assert list(sections)[1:3] == ["Deformed states", "Contact"]
    assert [block.kind for block in sections["Contact"].blocks] == ["picture", "table", "table"]
    (section,) = contact_page(run).sections
    assert [block.kind for block in section.blocks] == ["picture", "table", "table"]
    assert [block.kind for block in contact_page(run, 0.5).sections[0].blocks] == ["picture"]
    assert asked == [None, None, 0.5]
    memory = dataclasses.replace(run, directory=None)
    monkeypatch.setattr("tmc_vem.report.run_page.contact_of", contact_of)
    assert "Contact" not in [section.title for section in run_page(memory).sections]
    monkeypatch.setattr("tmc_vem.report.run_page.contact_of", lambda _, load=None: asked.append(load) or drawn)
    done = CliRunner().invoke(cli, ["plot", str(run.directory), "--contact", "--at", "0.25", "--out", str(tmp_path)])
    assert done.exit_code == 0
    assert asked[-1] == 0.25
    assert (tmp_path / "contact.html").exists()
    assert [path.name for path in (tmp_path / "figures").glob("*.png")] == ["contact-a.png"]
    drawn.clear()
    (nothing,) = contact_page(run, 0.5).sections[0].blocks
    assert nothing.text == "No pressure acts on any solid."  # type: ignore[union-attr]


def test_shares_of_the_regulariser() -> None:
    """Over what has more than half of the pressure, of pairs that press."""
    zero, two = np.zeros(4), np.zeros((4, 2))
    curves = ContactCurves(
        ("a", "b"), np.array([False]), np.array([0, 0, 1, 1]), np.zeros(4, dtype=int), np.array([1, 1, 0, -1]), zero,
        zero, two, two, two, two, two, np.array([4.0, 1.0, 3.0, 9.0]), zero, np.array([3.0, 9.0, 2.0, 9.0]), zero, zero,
        np.array([1.0, 1.0, 2.0, 1.0]), "--",
    )  # fmt: skip
    assert curves.regulariser_share() == pytest.approx({"a--b": 1.0 - (3.0 + 4.0) / (4.0 + 6.0)})
    assert curves.between("b", "a").tolist() == [False, False, True, False]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--contact", "--at", "nan"], "at = nan must be a finite number"),
        (["--field", "ux", "--at", "nan"], "at = nan must be a finite number"),
        (["--contact", "--field", "ux"], "--contact shows contact alone, and no use is made of --field: leave one out"),
        (["--contact", "--with-medium", "--range", "0", "1"], "no use is made of --with-medium, --range"),
    ],
)
def test_options_that_mean_nothing(run: RunResult, options: list[str], says: str) -> None:
    done = CliRunner().invoke(cli, ["plot", str(run.directory), *options])
    assert isinstance(done.exception, InputError)
    assert says in str(done.exception)


@pytest.mark.parametrize("text", ["", "a,b\n", "body,faces,closed\n"])
def test_a_table_of_something_else_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "contact.csv").write_text(text)
    with pytest.raises(InputError, match=r"contact\.csv is not a readable table of contact: '(arc_length|body)'"):
        read_table(tmp_path / "contact.csv")
