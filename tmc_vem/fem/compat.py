"""The one place that knows versions of dolfinx.

Tested with 0.5.2 (Debian 12), 0.9.0 (Debian 13) and 0.11.0 (wheels). 0.6 to 0.8 and 0.10 are mapped from their
documentation; every other version is refused. Nothing else in the package imports dolfinx, basix or ufl before
:func:`require` has passed.
"""

from __future__ import annotations

import functools
import importlib
import logging
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fem.jit_lock import no_stale_locks
from tmc_vem.support.distributed import Comm, Mat
from tmc_vem.support.errors import InputError
from tmc_vem.support.optional import load
from tmc_vem.support.petsc_start import start

Float = NDArray[np.float64]
Int = NDArray[np.int64]

OLDEST, NEWEST = (0, 5), (0, 11)
TRIANGLE, QUADRILATERAL = "triangle", "quadrilateral"

# -O2 is what dolfinx uses anyway; a tangent with facet terms takes longer to compile than dolfinx's limit of 10 s.
JIT_OPTIONS = {"cffi_extra_compile_args": ["-O2", "-g0"], "timeout": 600}


@functools.cache
def require() -> tuple[int, int]:
    """Import dolfinx and check it.

    Returns:
        Major and minor version.

    Raises:
        InputError: dolfinx or PETSc is missing, dolfinx is too old or too new, or PETSc is built for complex numbers.
    """
    start()  # MPI and PETSc, for real numbers
    dolfinx = load("dolfinx", "the finite element method needs")
    version = parse_version(dolfinx.__version__)
    importlib.import_module("dolfinx.fem.petsc")
    return version


def parse_version(text: str) -> tuple[int, int]:
    """Major and minor version of dolfinx from its version string.

    Raises:
        InputError: it is not between :data:`OLDEST` and :data:`NEWEST`.
    """
    found = re.match(r"(\d+)\.(\d+)", text)
    version = (int(found[1]), int(found[2])) if found else None
    if version is None or not OLDEST <= version <= NEWEST:
        low, high = (".".join(map(str, v)) for v in (OLDEST, NEWEST))
        raise InputError(f"dolfinx {text} is not supported: use {low} to {high} ({low}.2, 0.9 and 0.11 are tested)")
    return version


def create_mesh(comm: Comm, cell: str, cells: Int, points: Float) -> Any:
    """Distributed mesh whose facets on a border between ranks know both of their cells.

    Args:
        comm: communicator.
        cell: :data:`TRIANGLE` or :data:`QUADRILATERAL`.
        cells: (n, 3 or 4) global vertices of this rank's cells in the order of :func:`tensor_order`.
        points: (m, 2) coordinates of this rank's block of the vertices.
    """
    version = require()
    from dolfinx import mesh

    if version >= (0, 7):
        from basix.ufl import element

        coordinates = element("Lagrange", cell, 1, shape=(2,))
    else:
        from ufl import VectorElement

        # compiling a form fills in the variant if it is missing, which would change the next form's place in the cache
        coordinates = VectorElement("Lagrange", cell, 1, variant="equispaced")
    import ufl

    domain = ufl.Mesh(coordinates)
    if version < (0, 6):
        return mesh.create_mesh(comm, cells, points, domain)  # its default is what is asked for here
    if version >= (0, 11):  # how many cells share a facet at most; it is asked for as on a border there may be one
        shared = mesh.create_cell_partitioner(mesh.GhostMode.shared_facet, 2)
    else:
        shared = mesh.create_cell_partitioner(mesh.GhostMode.shared_facet)
    if version >= (0, 10):
        return mesh.create_mesh(comm, cells=cells, x=points, e=domain, partitioner=shared)
    return mesh.create_mesh(comm, cells, points, domain, partitioner=shared)


def tensor_order(cell: str) -> list[int]:
    """Where the vertices of a counter-clockwise polygon stand in dolfinx' cell."""
    return [0, 1, 2] if cell == TRIANGLE else [0, 1, 3, 2]


def reference_edges(cell: str) -> Int:
    """(n_edges, 2) vertices of the reference cell's edges, in dolfinx' numbering of edges."""
    pairs = [(1, 2), (0, 2), (0, 1)] if cell == TRIANGLE else [(0, 1), (0, 2), (1, 3), (2, 3)]
    return np.array(pairs)


def vector_space(mesh: Any, order: int) -> Any:
    """Continuous Lagrange space of displacements."""
    from dolfinx import fem

    with _quiet():
        if require() >= (0, 7):
            return fem.functionspace(mesh, ("Lagrange", order, (2,)))
        return fem.VectorFunctionSpace(mesh, ("Lagrange", order))


def cell_function(mesh: Any, values: Float) -> Any:
    """Piecewise constant function with the values (n,) of the local cells, ghosts included."""
    from dolfinx import fem

    with _quiet():
        space = fem.functionspace(mesh, ("DG", 0)) if require() >= (0, 7) else fem.FunctionSpace(mesh, ("DG", 0))
    function = fem.Function(space)
    function.x.array[rows(space.dofmap.list, len(values))[:, 0]] = values
    return function


def set_cell_values(function: Any, n_cells: int, cells: Int, values: Float) -> None:
    """Change a :func:`cell_function` in place, on all ranks together.

    Args:
        function: of a mesh.
        n_cells: local cells, ghosts included.
        cells: (n,) those that change, which this rank owns; their ghosts on other ranks follow.
        values: (n,) in them.
    """
    function.x.array[rows(function.function_space.dofmap.list, n_cells)[cells, 0]] = values
    function.x.scatter_forward()


def point_function(mesh: Any, cell: str, degree: int, n_values: int) -> Any:
    """A function with some values at each point of the quadrature rule of a degree, and none elsewhere; zero."""
    from dolfinx import fem

    with _quiet():
        if require() >= (0, 7):
            from basix.ufl import quadrature_element

            element = quadrature_element(cell, value_shape=(n_values,), scheme="default", degree=degree)
            return fem.Function(fem.functionspace(mesh, element))
        from ufl import VectorElement

        element = VectorElement("Quadrature", mesh.ufl_cell(), degree, n_values, quad_scheme="default")
        return fem.Function(fem.FunctionSpace(mesh, element))


def point_rows(function: Any, n_cells: int) -> NDArray[Any]:
    """(n_cells, n_points) where the points of local cells, in the order of :func:`quadrature`, stand among the values
    of a :func:`point_function`."""
    return rows(function.function_space.dofmap.list, n_cells)


def rows(adjacency: Any, n_rows: int) -> NDArray[Any]:
    """Array (n_rows, width) of a map in which every row is equally long: a list of lists before 0.7, an array since."""
    flat = adjacency.array if hasattr(adjacency, "array") else adjacency
    array: NDArray[Any] = np.asarray(flat).reshape(n_rows, -1)
    return array


def form(expression: Any) -> Any:
    """Compile a form; the result is kept in dolfinx' cache, so that the next run finds it there.

    Raises:
        InputError: the compiler failed, on rank 0 where it is called.
    """
    from cffi import VerificationError
    from dolfinx import fem

    option = "jit_options" if require() >= (0, 6) else "jit_params"
    try:
        with _quiet():
            return fem.form(expression, **{option: JIT_OPTIONS})
    except VerificationError as error:  # what distutils said
        raise InputError(f"a form could not be compiled: {str(error).splitlines()[0]}") from None
    except RuntimeError as error:
        if "just-in-time" not in str(error):
            raise
        raise InputError("a form could not be compiled: rank 0 says why") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Compile: without what setuptools does to the root logger, without its commands, without waiting for dead runs."""
    root = logging.getLogger()
    level, handlers, disabled = root.level, list(root.handlers), root.manager.disable
    logging.disable(logging.INFO)
    try:
        with no_stale_locks():
            yield
    finally:
        logging.disable(disabled)
        root.setLevel(level)
        root.handlers[:] = handlers


def assemble_vector(out: Any, compiled: Any) -> None:
    """Assemble a linear form into a function's degrees of freedom, summed over the ranks."""
    from dolfinx import fem

    out.x.array[:] = 0.0
    fem.assemble_vector(out.x.array, compiled)
    scatter_reverse(out)


def scatter_reverse(function: Any) -> None:
    """Add what ghosted degrees of freedom hold to their owners."""
    from dolfinx import la

    mode = la.InsertMode.add if hasattr(la, "InsertMode") else la.ScatterMode.add
    function.x.scatter_reverse(mode)


def create_matrix(compiled: Any) -> Mat:
    """Matrix with the pattern of a bilinear form."""
    from dolfinx.fem import petsc

    matrix: Mat = petsc.create_matrix(compiled)
    return matrix


def assemble_matrix(out: Mat, compiled: Any) -> None:
    """Assemble a bilinear form, without boundary conditions."""
    from dolfinx.fem import petsc

    out.zeroEntries()
    petsc.assemble_matrix(out, compiled)
    out.assemble()


def lagrange_table(cell: str, order: int, points: Float, n_derivatives: int) -> Float:
    """Derivatives of the scalar Lagrange basis: (n_derivatives_in_all, n_points, n_basis).

    The first axis runs over value, d1, d2, d1d1, d1d2, d2d2 as far as ``n_derivatives`` asks for.
    """
    import basix

    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.gll_warped
    cell_type = getattr(basix.CellType, cell)
    if require() >= (0, 6):
        element = basix.create_element(family, cell_type, order, lagrange_variant=variant)
    else:
        element = basix.create_element(family, cell_type, order, variant, False)
    table: Float = np.asarray(element.tabulate(n_derivatives, points))[..., 0]
    return table


def quadrature(cell: str, degree: int) -> tuple[Float, Float]:
    """Points (n, 2) and weights (n,) on the reference cell: the rule that the form compiler uses for a degree."""
    import basix

    points, weights = basix.make_quadrature(getattr(basix.CellType, cell), degree)
    return np.asarray(points), np.asarray(weights)


def atan2(y: Any, x: Any) -> Any:
    """UFL's atan2."""
    import ufl

    return ufl.atan2(y, x) if hasattr(ufl, "atan2") else ufl.atan_2(y, x)


def mesh_tags(mesh: Any, dimension: int, entities: NDArray[Any], values: NDArray[Any]) -> Any:
    """Numbers on some entities of a mesh, which may come in any order."""
    from dolfinx.mesh import meshtags

    order = np.argsort(entities, kind="stable")
    return meshtags(mesh, dimension, entities[order].astype(np.int32), values[order].astype(np.int32))


def cell_nodes(mesh: Any, n_cells: int) -> NDArray[Any]:
    """(n_cells, 3 or 4) nodes of the geometry of the local cells."""
    geometry = mesh.geometry
    return rows(geometry.dofmaps[0] if require() >= (0, 11) else geometry.dofmap, n_cells)


def global_nodes(space: Any, nodes: Int) -> Int:
    """Numbers over all ranks of local nodes of a space, of any shape."""
    numbers = space.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32))
    return np.asarray(numbers, dtype=np.int64).reshape(nodes.shape)


def plane_cells(mesh: Any) -> tuple[Int, str]:
    """Nodes (n, 3 or 4) of the geometry of all local cells, and their kind.

    Raises:
        InputError: the mesh is not plane, or has other cells than triangles or quadrilaterals with straight sides.
    """
    topology = mesh.topology
    if topology.dim != 2:
        raise InputError(
            f"the mesh has cells of dimension {topology.dim}: plane meshes of dimension 2 have a polygon mesh"
        )
    if len(set(mesh.geometry.x[:, 2].tolist())) > 1:
        raise InputError("the mesh is not in the plane of x and y: its nodes have different z")
    cells = topology.index_map(2)
    nodes = cell_nodes(mesh, cells.size_local + cells.num_ghosts).astype(np.int64)
    kind = mesh.ufl_domain().ufl_cell().cellname
    cell = str(kind() if callable(kind) else kind)  # an attribute since 0.11
    if nodes.shape[1] != len(tensor_order(cell)):
        raise InputError(f"cells have {nodes.shape[1]} nodes: a polygon mesh needs straight sides, geometry of order 1")
    return nodes, cell


def corners(mesh: Any) -> tuple[Float, str]:
    """Coordinates (n, 3 or 4, 2) of the corners of all local cells, in dolfinx' order, and the kind of cell."""
    nodes, cell = plane_cells(mesh)
    return np.asarray(mesh.geometry.x)[nodes, :2], cell


def cell_and_position(mesh: Any, facets: Int) -> tuple[Int, Int]:
    """A local cell of each facet (n,), and where among its facets it is (n,)."""
    mesh.topology.create_connectivity(1, 2)
    mesh.topology.create_connectivity(2, 1)
    to_cells, to_facets = mesh.topology.connectivity(1, 2), mesh.topology.connectivity(2, 1)
    cells = np.asarray(to_cells.array)[np.asarray(to_cells.offsets)[facets]].astype(np.int64)
    around = rows(to_facets, len(np.asarray(to_facets.offsets)) - 1)[cells]
    return cells, np.argmax(around == facets[:, None], axis=1)


def neighbours(mesh: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Local facets between two cells, and these cells: (n,) and (n, 2)."""
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(1, 2)
    mesh.topology.create_connectivity(2, 1)
    to_cells = mesh.topology.connectivity(1, 2)
    offsets, cells = np.asarray(to_cells.offsets), np.asarray(to_cells.array)
    facets = np.flatnonzero(np.diff(offsets) == 2)
    return facets, cells[offsets[facets][:, None] + np.arange(2)]


def original_cells(mesh: Any) -> Int:
    """Numbers of the local cells, ghosts included, in the mesh as it was handed to :func:`create_mesh`."""
    return np.asarray(mesh.topology.original_cell_index, dtype=np.int64)


def constants(mesh: Any, values: Sequence[float]) -> tuple[list[Any], Any]:
    """Numbers that can change without a form being compiled again, and the array that holds their values.

    They are the components of one constant: UFL orders several by their running numbers as text ("10" before "9"), so
    that the form, and with it its place in the cache, would depend on how many constants were made before.
    """
    from dolfinx import fem

    vector = fem.Constant(mesh, np.array([*values, 0.0, 0.0], dtype=float))  # never a scalar
    return [vector[n] for n in range(len(values))], vector.value


def function(space: Any) -> Any:
    """A function of a space, zero."""
    from dolfinx import fem

    return fem.Function(space)


def assemble_scalar(compiled: Any) -> float:
    """This rank's part of an integral."""
    from dolfinx import fem

    return float(fem.assemble_scalar(compiled))


def evaluate(function: Any, points: Float) -> tuple[Float, NDArray[np.bool_]]:
    """Values (n, 2) of a function at points (n, 2), and at which of them this rank has a cell."""
    from dolfinx import geometry

    mesh = function.function_space.mesh
    space = np.column_stack([points, np.zeros(len(points))])
    if require() < (0, 7):
        tree = geometry.BoundingBoxTree(mesh, 2)
        near = geometry.compute_collisions(tree, space)
    else:
        tree = geometry.bb_tree(mesh, 2)
        near = geometry.compute_collisions_points(tree, space)
    colliding = geometry.compute_colliding_cells(mesh, near, space)
    first = [colliding.links(n)[:1] for n in range(len(points))]
    found = np.array([len(cells) > 0 for cells in first], dtype=bool)
    values = np.zeros((len(points), 2))
    if found.any():
        cells = np.concatenate(first).astype(np.int32)
        values[found] = np.reshape(function.eval(space[found], cells), (-1, 2))
    return values, found
