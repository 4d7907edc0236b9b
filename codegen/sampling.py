"""Random admissible states, from mild to extreme, at which an energy is checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import LAYOUT
from codegen.layout import Input

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Regime:
    """A range of deformations: bounds of J, rotations up to ``rotation`` degrees, ratio of the principal stretches."""

    name: str
    j_min: float
    j_max: float
    rotation: float
    stretch_ratio: float


REGIMES = (
    Regime("mild", 0.8, 1.25, 20.0, 1.2),
    Regime("large", 0.2, 2.0, 90.0, 2.0),
    Regime("extreme", 1e-4, 3.0, 170.0, 4.0),
)
SAFETY_ANGLE = 10.0  # states keep this far (degrees) from the largest rotation that an energy admits


def sample(regime: Regime, n: int, rng: np.random.Generator, max_rotation: float = 180.0) -> Array:
    """States (n, 12) ``[F - I, G]`` in the order of Appendix C; the bounds of J and of the rotation are among them."""
    rotation = min(regime.rotation, max_rotation - SAFETY_ANGLE)
    J = np.exp(rng.uniform(np.log(regime.j_min), np.log(regime.j_max), n))
    angle = rng.uniform(-rotation, rotation, n)
    J[:2] = (regime.j_min, regime.j_max)[:n]
    angle[:4] = (rotation, -rotation, -rotation, rotation)[:n]
    ratio = np.exp(rng.uniform(0.0, np.log(regime.stretch_ratio), n))
    stretches = np.sqrt(np.stack([J * ratio, J / ratio], axis=1))
    axes = rotation_matrix(rng.uniform(0.0, 180.0, n))
    U = np.einsum("nia,na,nja->nij", axes, stretches, axes)
    F = rotation_matrix(angle) @ U
    return to_vector(F, rng.normal(scale=0.5, size=(n, 2, 2, 2)))


def rotation_matrix(degrees: Array) -> Array:
    """(n, 2, 2) rotations."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def to_vector(F_nij: Array, G_nijk: Array) -> Array:
    """(n, 12) states from deformation gradients and second gradients."""
    parts = [_part(of, tensor) for of, tensor in zip(LAYOUT.inputs, (F_nij, G_nijk), strict=True)]
    return np.concatenate(parts, axis=1)


def _part(of: Input, tensor: Array) -> Array:
    entries = of.components(np.moveaxis(tensor, 0, -1))
    return np.stack([entry - of.at_rest(index) for index, entry in zip(of.indices, entries, strict=True)], axis=1)


def from_vector(x_nx: Array) -> tuple[Array, Array]:
    """Inverse of :func:`to_vector`."""
    F, G = LAYOUT.tensors(lambda a: x_nx[:, a] + LAYOUT.at_rest[a])
    return np.ascontiguousarray(np.moveaxis(F, -1, 0)), np.ascontiguousarray(np.moveaxis(G, -1, 0))


def rotate(x_nx: Array, degrees: Array) -> Array:
    """States after a superposed rotation: ``F -> Q F`` and ``G -> Q G``."""
    F, G = from_vector(x_nx)
    Q = rotation_matrix(degrees)
    return to_vector(Q @ F, np.einsum("nia,najk->nijk", Q, G))


def directions(x_nx: Array, rng: np.random.Generator) -> Array:
    """Random perturbations (n, 12) of relative size one: a full step changes J, F or G by about its own size."""
    F, G = from_vector(x_nx)
    d = rng.normal(size=x_nx.shape)
    dF, dG = from_vector(d)
    dF -= np.eye(2)
    J = np.linalg.det(F)
    dJ = np.einsum("nij,nij->n", _cofactor(F), dF)
    size_f = np.minimum(J / np.abs(dJ), _norm(F) / _norm(dF))
    size_g = np.maximum(_norm(G), 0.1) / _norm(dG)
    return np.concatenate([d[:, LAYOUT.part("F")] * size_f[:, None], d[:, LAYOUT.part("G")] * size_g[:, None]], axis=1)


def _cofactor(F: Array) -> Array:
    return np.stack([np.stack([F[:, 1, 1], -F[:, 1, 0]], -1), np.stack([-F[:, 0, 1], F[:, 0, 0]], -1)], -2)


def _norm(array: Array) -> Array:
    return np.asarray(np.linalg.norm(array.reshape(len(array), -1), axis=1))
