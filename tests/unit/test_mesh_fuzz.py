"""Meshes survive writing and reading in all formats that hold polygons; damaged files are read or refused in words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from helpers_mesh import hanging, non_convex, voronoi
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tmc_vem.cli.main import _run
from tmc_vem.mesh.files.io import FORMATS, WITHOUT_NAMES, read_mesh, write_mesh
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

CORPUS = Path(__file__).parents[1] / "corpus"
POLYGONS = [kind for kind in (*FORMATS, *WITHOUT_NAMES) if kind not in (".msh", ".inp")]
BASES = {"hanging": hanging(2, 0.04), "voronoi": voronoi(6), "not convex": non_convex()}
NAMES = st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=8).filter(
    lambda name: name == name.strip() and name.isprintable()
)
IN_MEMORY = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)


@st.composite
def meshes(draw: Any) -> PolygonMesh:
    """Cells in any regions, points and edges with any names, anywhere and of any size."""
    base = draw(st.sampled_from(list(BASES.values())))
    names = draw(st.lists(NAMES, min_size=1, max_size=3, unique=True))
    region_c = draw(st.lists(st.integers(0, len(names) - 1), min_size=base.n_cells, max_size=base.n_cells))
    used = sorted(set(region_c))
    points = draw(st.dictionaries(NAMES, st.integers(0, base.n_vertices - 1), max_size=2))
    edges = base.edges.vertices_ev
    some = st.lists(st.integers(0, len(edges) - 1), min_size=1, max_size=4, unique=True)
    scale = 10.0 ** draw(st.integers(-9, 9))
    return PolygonMesh(
        base.points_vx * scale + draw(st.sampled_from([0.0, 1.0 / 3.0])) * scale,
        base.cell_offsets, base.cell_vertices, np.searchsorted(used, region_c), tuple(names[n] for n in used), points,
        {name: edges[chosen] for name, chosen in draw(st.dictionaries(NAMES, some, max_size=2)).items()},
    )  # fmt: skip


def key_of(pairs: Any) -> list[list[int]]:
    return np.unique(np.sort(pairs, axis=1), axis=0).tolist()  # type: ignore[no-any-return]


@pytest.mark.parametrize("suffix", [kind for kind in POLYGONS if kind not in (".mat", ".nc")])
@IN_MEMORY
@given(mesh=meshes())
def test_round_trip(suffix: str, mesh: PolygonMesh, tmp_path: Path) -> None:
    assert_round_trip(suffix, mesh, tmp_path)


@pytest.mark.parametrize("suffix", [".mat", ".nc"])
@settings(IN_MEMORY, max_examples=8)  # each is read in a process of its own
@given(mesh=meshes())
def test_round_trip_through_other_libraries(suffix: str, mesh: PolygonMesh, tmp_path: Path) -> None:
    assert_round_trip(suffix, mesh, tmp_path)


def assert_round_trip(suffix: str, mesh: PolygonMesh, tmp_path: Path) -> None:
    path = tmp_path / f"mesh{suffix}"
    write_mesh(mesh, path)
    again = read_mesh(path)
    for name in ("points_vx", "cell_offsets", "cell_vertices"):
        assert np.array_equal(getattr(mesh, name), getattr(again, name)), name
    if suffix in WITHOUT_NAMES:
        return
    assert again.region_names == mesh.region_names
    assert again.region_c.tolist() == mesh.region_c.tolist()
    assert dict(again.named_points) == dict(mesh.named_points)
    assert list(again.named_edges) == list(mesh.named_edges)
    for name, pairs in mesh.named_edges.items():
        assert key_of(again.named_edges[name]) == key_of(pairs)


# -- damaged files -----------------------------------------------------------------------------------------------------

FILES = sorted(
    path for path in CORPUS.rglob("*") if path.suffix in (*FORMATS, ".off", ".med") and path.stat().st_size < 20000
)
BYTES = st.binary(min_size=1, max_size=4)


@st.composite
def damaged(draw: Any) -> tuple[Path, bytes]:
    """A file of the corpus that was cut off, or with bytes replaced, removed, doubled or put in; or lines exchanged."""
    path = draw(st.sampled_from(FILES))
    content = bytearray(path.read_bytes())
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(content)))
        match draw(st.integers(0, 6)):
            case 0:
                del content[at:]
            case 1:
                content[at : at + 1] = draw(BYTES)
            case 2:
                del content[at : at + draw(st.integers(1, 40))]
            case 3:
                content[at:at] = draw(BYTES)
            case 4:
                content[at:at] = content[at : at + draw(st.integers(1, 200))]
            case 5:
                lines = bytes(content).split(b"\n")
                a, b = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
                lines[a], lines[b] = lines[b], lines[a]
                content = bytearray(b"\n".join(lines))
            case _:
                word = draw(
                    st.sampled_from([b"-1", b"99999999999999999999", b"1e400", b"nan", b"0", b"x", b"3", b"2147483648"])
                )
                digits = [n for n, byte in enumerate(content) if chr(byte).isdigit()]
                if digits:
                    start = digits[draw(st.integers(0, len(digits) - 1))]
                    content[start : start + 1] = word
    return path, bytes(content)


def regions_by_meshio(path: Path) -> dict[int, int] | None:
    """Cells of every number in the first usual cell data, as meshio reads them; None if it does not."""
    try:
        data = meshio.read(path)
    except (Exception, SystemExit):
        return None
    for name in ("gmsh:physical", "region"):
        if name in data.cell_data:
            found: dict[int, int] = {}
            for block, values in zip(data.cells, data.cell_data[name], strict=True):
                if block.type.startswith(("triangle", "quad", "polygon")):
                    for value in np.asarray(values).ravel().tolist():
                        found[int(value)] = found.get(int(value), 0) + 1
            return found
    return None


def check_damaged(path: Path, content: bytes, where: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = where / f"damaged{path.suffix}"
    file.write_bytes(content)
    capsys.readouterr()
    code = _run(["mesh", "check", str(file)])
    said = capsys.readouterr()
    assert code in (0, 1, 2)
    assert "Traceback" not in said.err + said.out
    if code == 2:
        assert said.err.startswith("tmc-vem: ")
        assert said.err.strip().count("\n") == 0
        return
    assert said.out.strip()
    try:
        mesh = read_mesh(file, notes=[])
    except InputError:
        return
    if file.suffix == ".vtu" and (theirs := regions_by_meshio(file)) is not None:
        counts = sorted(np.bincount(mesh.region_c).tolist())
        if sum(theirs.values()) == mesh.n_cells:
            assert counts == sorted(theirs.values())


@settings(deadline=None, suppress_health_check=list(HealthCheck), max_examples=150)
@given(case=damaged())
def test_damaged_files_are_read_or_refused_in_one_line(
    case: tuple[Path, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    check_damaged(*case, tmp_path, capsys)


@pytest.mark.slow
@settings(deadline=None, suppress_health_check=list(HealthCheck), max_examples=1000)
@given(case=damaged())
def test_a_thousand_damaged_files(case: tuple[Path, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check_damaged(*case, tmp_path, capsys)
