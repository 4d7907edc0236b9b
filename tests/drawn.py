"""What pictures consist of, as words and numbers: paths and texts on a canvas, artists of a figure.

A picture is compared with the record of it in ``tests/golden/pictures.json``; ``make golden`` writes that anew after a
wanted change, which is then to be looked at.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from matplotlib.backends import backend_agg
from numpy.typing import NDArray

from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Box, Medium
from tmc_vem.problems.probes import Displacement, Gap
from tmc_vem.report import animation, figures, mesh_figure, panels, plots, problem_figure
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.system.constraints import Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.fields import Fields, Polygons
from tmc_vem.system.forces import BodyForce, FollowerPressure, PointForce, Spring, Traction

Record = list[list[Any]]


def fingerprint(values: Any) -> list[float]:
    """Shape of an array, its mean, and a mean that its order changes."""
    array = np.asarray(values, dtype=float)
    flat = array.ravel()
    n = max(1, len(flat))
    return [*map(float, array.shape), float(flat.sum() / n), float(flat @ np.cos(np.arange(len(flat)))) / n]


def outline(points: Any) -> list[float]:
    """Length, middle and extent of a line, wherever a closed one begins."""
    points = np.asarray(points, dtype=float)
    arms, middles = np.diff(points, axis=0), 0.5 * (points[1:] + points[:-1])
    lengths = np.hypot(*arms.T)
    return [*map(float, points.shape), *((lengths @ middles) / lengths.sum()), lengths.sum(), *np.ptp(points, axis=0)]


class Recorder(backend_agg.RendererAgg):
    """Agg's renderer, which keeps what is drawn by it in :attr:`drawn`."""

    drawn: ClassVar[Record] = []

    def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
        points, one = transform.transform_path(path).vertices, path.codes is not None and (path.codes == 1).sum() == 1
        codes = [] if path.codes is None else path.codes
        style = [gc.get_linewidth(), gc.get_antialiased(), *gc.get_rgb(), gc.get_alpha(), gc.get_joinstyle()]
        face = [] if rgbFace is None else list(rgbFace)
        where = outline(points) if one and not face else fingerprint(points)
        self.drawn.append(["path", *where, *fingerprint(codes), *style, *face])
        super().draw_path(gc, path, transform, rgbFace)

    def draw_text(self, gc: Any, x: float, y: float, s: str, prop: Any, angle: float, *rest: Any, **more: Any) -> None:
        self.drawn.append(["text", s, x, y, prop.get_size_in_points(), prop.get_style(), angle])
        super().draw_text(gc, x, y, s, prop, angle, *rest, **more)


def on_a_canvas(draw: Callable[[Path], None]) -> Record:
    """What is drawn into a file, in pixels."""
    kept, Recorder.drawn = backend_agg.RendererAgg, []
    backend_agg.RendererAgg = Recorder  # type: ignore[misc]
    try:
        with tempfile.TemporaryDirectory() as folder:
            draw(Path(folder) / "picture.png")
    finally:
        backend_agg.RendererAgg = kept  # type: ignore[misc]
    return Recorder.drawn


def of_figure(figure: Any) -> Record:
    """The artists of a figure, in the units of its data."""
    drawn: Record = [["figure", *figure.get_size_inches(), *(text.get_text() for text in figure.texts)]]
    supxlabel = getattr(figure, "_supxlabel", None)
    drawn += [["below", supxlabel.get_text()]] if supxlabel is not None else []
    for axes in figure.axes:
        place = [] if figure.get_layout_engine() is not None else list(axes.get_position().bounds)
        words = [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), axes.get_xscale(), axes.get_yscale()]
        axis = [axes.axison, str(axes.get_aspect()), axes.title.get_fontsize()]
        drawn.append(["axes", *words, *axis, *axes.get_xlim(), *axes.get_ylim(), *place])
        drawn += [entry for artist in axes.get_children() for entry in _artist(artist)]
    for legend in figure.legends:
        drawn += _artist(legend)
    return drawn


def _artist(artist: Any) -> Iterator[list[Any]]:
    kind = type(artist).__name__
    if kind == "Line2D":
        style = [artist.get_linestyle(), artist.get_linewidth(), artist.get_marker(), artist.get_markersize()]
        label = artist.get_label()
        yield [kind, *fingerprint(artist.get_xydata()), *_colours(artist.get_color()), *style,
               "" if label.startswith("_") else label]  # fmt: skip
    elif kind in ("Text", "Annotation"):
        if artist.get_text() or kind == "Annotation":
            offset = [*artist.xyann, *artist.xy] if kind == "Annotation" else []
            place = [*artist.get_position(), artist.get_ha(), artist.get_va()]
            yield [kind, artist.get_text(), artist.get_fontsize(), *offset, *map(_plain, place)]
    elif kind in ("PolyCollection", "LineCollection", "TriMesh"):
        paths = [path.vertices for path in artist.get_paths()]
        data = artist.get_array()
        where = [outline(path) for path in paths] if kind == "LineCollection" else [fingerprint(path) for path in paths]
        yield [kind, len(paths), *fingerprint(sorted(where)),
               *fingerprint([] if data is None else data), *_colours(artist.get_facecolor()),
               *_colours(artist.get_edgecolor()), *artist.get_linewidths()]  # fmt: skip
        if data is not None:
            yield [*artist.norm.__class__.__name__.split(), artist.norm.vmin, artist.norm.vmax,
                   *fingerprint(artist.get_cmap()(np.linspace(0.0, 1.0, 7)))]  # fmt: skip
    elif kind == "Rectangle" and artist.get_label() != "":
        yield [kind, *artist.get_bbox().extents, *_colours(artist.get_facecolor())]
    elif kind == "Legend":
        texts = artist.get_texts()
        sizes = [text.get_fontsize() for text in texts]
        yield [kind, artist.get_frame_on(), *(text.get_text() for text in texts), *sizes]
        yield from (["patch", *_colours(patch.get_facecolor())] for patch in artist.get_patches())
        yield from (["line", *_colours(line.get_color()), line.get_marker()] for line in artist.get_lines())


def _plain(value: Any) -> Any:
    return value if isinstance(value, str) else float(value)


def _colours(value: Any) -> list[float]:
    from matplotlib.colors import to_rgba_array

    rgba: NDArray[np.float64] = to_rgba_array(value)
    return fingerprint(rgba)


def state(u: float = 0.3) -> Fields:
    """Five cells of several sizes in three regions; displacements, J and energies differ everywhere."""
    points = np.array(
        [[0, 0], [2, 0], [3, 0], [0, 1], [2, 1], [3, 1], [0, 1.5], [2, 1.5], [3, 1.5], [4, 0.5]], dtype=float
    )
    loops = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7], [2, 9, 5]]
    polygons = Polygons(
        points, np.cumsum([0, *map(len, loops)]), np.concatenate(loops), np.array([0, 1, 2, 1, 0]),
        ("solid", "medium", "other"), ("medium",),
    )  # fmt: skip
    x, y = points.T
    return Fields(
        polygons, np.column_stack([0.1 * x * y, -u * x - 0.2 * y**2]), np.array([1.1, 0.7, 1.3, 0.2, 0.9]),
        np.array([1.0, 0.6, 1.2, 0.1, 0.8]), np.array([0.4, 0.02, 0.0, 3e-5, 0.7]),
    )  # fmt: skip


def runs() -> dict[str, RunResult]:
    """Two runs of some load steps, one with failed attempts."""
    found = {}
    for name, share, wasted in (("VEM 20 x 5", 1.0, 3), ("FEM", 0.9, 0)):
        history = [
            StepRecord(
                step=n, load=0.25 * n, displacement=-0.2 * n, reaction=-share * n**1.5, iterations=2 + n, cut_backs=0,
                probes={"gap": share * 0.1**n, "tip": 0.3 * n, "mean J": 1 / n, "span": n**2, "J": 2.0 / n},
                wasted_iterations=wasted * (n == 2), min_j={"solid": 0.9**n, "medium": 0.2**n}, negative_pivots=0,
                energy={"solid": 0.5 * n * share, "medium": 0.01 * n}, jumped=False, seconds=0.1,
            )
            for n in range(1, 5)
        ]  # fmt: skip
        units = {"displacement": "mm", "reaction": "N", "gap": "mm"}
        found[name] = RunResult(
            {"name": "box"}, {}, True, "", 1.0, 4, 9, 18 + wasted, 0, {}, {}, history, units=units, media=["medium"]
        )
    return found


def _animated(path: Path) -> Record:
    """Sizes of the frames of an animation, how long each is shown, and the colours of some."""
    from PIL import Image

    animation.animate([("a", state(0.1)), ("b", state(0.4))], path / "a.gif", seconds_each=0.5)
    with Image.open(path / "a.gif") as frames:
        drawn: Record = []
        for n in range(frames.n_frames):
            frames.seek(n)
            pixels = np.asarray(frames.convert("RGB"), dtype=float)
            drawn.append(["frame", *frames.size, frames.info["duration"], round(float(pixels.mean()))])
        return drawn


def _loaded() -> Any:
    """A problem with every kind of support and load, its cells and its corners."""
    lines = np.linspace(0.0, 2.0, 5)
    halves = [Rectangle("body", 0.0, 1.0, 0.0, 2.0), Rectangle("medium", 1.0, 2.0, 0.0, 2.0)]
    edges = {"left": ((0, 0), (0, 2)), "bottom": ((0, 0), (1, 0)), "top": ((0, 2), (1, 2)), "side": ((1, 0), (1, 2)),
             "lid": ((1, 2), (2, 2)), "base": ((1, 0), (2, 0))}  # fmt: skip
    points = {"a": (0.0, 1.0), "b": (0.5, 1.0), "c": (2.0, 1.0)}
    mesh = with_names(structured_quadrilaterals(lines, lines, halves), points, edges)
    slant = PrescribedAcross("base", "normal", axis=(0.6, 0.8))
    held = [Prescribed("left", 0), Prescribed("bottom", 1), Prescribed("a", 0), Prescribed("a", 1), slant]
    moved = [Prescribed("lid", 1, -0.25), PrescribedAcross("top", "tangential", 0.125),
             PrescribedRotation("lid", (1.0, 1.0), 30.0)]  # fmt: skip
    forces = [PointForce("push", "b", (3.0, -4.0)), Traction("drag", "top", (0.5, 0.0)),
              BodyForce("weigh", ("body",), (0.0, -1.0)), FollowerPressure("blow", "side", 2.0),
              Spring("hold", "c", (1.0, 0.0))]  # fmt: skip
    probes = {"gap": Gap("b", "c"), "crown": Displacement("uy", "b")}
    return problem_figure.draw_problem(
        mesh, ["medium"], [*held, *moved], moved[0], probes, forces, cells=True, corners=[(1.0, 0.0), (1.0, 2.0)]
    )


def pictures() -> dict[str, Record]:
    """Every picture of the program, of small cases, by name."""
    two, many = runs(), {f"run {n}": run for n, run in enumerate([*runs().values()] * 4)}
    box = Box(cells=(20, 5), medium=Medium())
    mesh, conditions = box.make_mesh(), box.prescribed()
    found = {
        "state, u_y": on_a_canvas(lambda path: figures.draw_deformed(state(), path, "a title")),
        "state, u_x": on_a_canvas(lambda path: figures.draw_deformed(state(), path, component=0)),
        "problem": of_figure(problem_figure.draw_problem(mesh, ["medium"], conditions, box.load(), box.probes())),
        "every support and load": of_figure(_loaded()),
        "meshes": of_figure(problem_figure.draw_meshes([("one", mesh), ("two", mesh)], ["medium"])),
        "gap and reaction": of_figure(plots.gap_and_reaction(two)),
        "many runs": of_figure(plots.gap_and_reaction(many)),
        "smallest J": of_figure(plots.smallest_j(two)),
        "energies": of_figure(plots.energy_split(two)),
        "iterations": of_figure(plots.newton_iterations(two)),
        "convergence": of_figure(plots.convergence(*_errors({"VEM": 0.0, "FEM": 1e-3}))),
        "convergence, one floor": of_figure(plots.convergence(*_errors({"VEM": 1e-3, "FEM": 1e-3}))),
    }
    for quantity in panels.QUANTITIES:
        states = [("soft", state(0.1)), ("stiff", state(0.4)), ("third", state(0.2))]
        found[f"panels, {quantity}"] = of_figure(panels.draw_panels(states, quantity=quantity))
    found["panels in a row"] = of_figure(panels.draw_panels(states, columns=3, width=8.0))
    with tempfile.TemporaryDirectory() as folder:
        found["animation"] = _animated(Path(folder))
        named = {"left": np.array([[0, 1]]), "up": np.array([[1, 2]])}
        fine = replace(Box(cells=(80, 20)).make_mesh(), named_edges=named)
        found["fine mesh"] = _of_saved(lambda: mesh_figure.draw_mesh(fine, Path(folder) / "mesh.png"))
        found["mesh"] = _of_saved(lambda: mesh_figure.draw_mesh(mesh, Path(folder) / "mesh.png", numbers=True))
    return found


def _errors(floors: dict[str, float]) -> tuple[Any, ...]:
    series = {
        "VEM": [(200.0, 0.5, 0.1), (800.0, 2.0, 0.03), (3200.0, 9.0, 0.006), (9000.0, 40.0, 5e-4)],
        "FEM": [(300.0, 1.0, 0.2), (1500.0, 5.0, 0.07), (5000.0, 20.0, 9e-4)],
    }
    return series, "gap", floors


def _of_saved(draw: Callable[[], None]) -> Record:
    """The figure that a function saves, and with how many pixels an inch."""
    from unittest.mock import patch

    from matplotlib.figure import Figure

    with patch.object(Figure, "savefig", autospec=True) as save:
        draw()
    (figure, _), options = save.call_args
    return [*of_figure(figure), ["saved", *options.values()]]
