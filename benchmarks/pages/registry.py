"""All blocks of all pages."""

from __future__ import annotations

from pages import (
    adapt,
    contact,
    fem,
    friction,
    guide,
    limit,
    loads,
    materials,
    media,
    paper,
    penalty,
    projection,
    solver,
    verification,
)
from pages.block import AnyBlock

BLOCKS: tuple[AnyBlock, ...] = (
    *paper.BLOCKS, *guide.BLOCKS, *fem.BLOCKS, *projection.BLOCKS, *contact.BLOCKS, *penalty.BLOCKS,
    *friction.BLOCKS, *solver.BLOCKS, *media.BLOCKS, *materials.BLOCKS, *loads.BLOCKS, *verification.BLOCKS,
    *limit.BLOCKS, *adapt.BLOCKS,
)  # fmt: skip
