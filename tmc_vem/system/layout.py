"""What a node carries, and where it stands in vectors and matrices.

Components of a node stand side by side. A field beside the displacement would be more components here, and
conditions, insertion into matrices and the values at nodes would follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Int = NDArray[np.int64]
Integers = NDArray[np.integer[Any]]
T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True)
class NodeLayout:
    """Degrees of freedom of nodes.

    Attributes:
        components: of the field that nodes carry.
    """

    components: int

    def size(self, n_nodes: int) -> int:
        """Degrees of freedom of so many nodes."""
        return self.components * n_nodes

    def n_nodes(self, size: int) -> int:
        """Nodes of so many degrees of freedom."""
        return size // self.components

    def dof(self, node: int | Integers, component: int | Integers = 0) -> Int:
        """Degree of freedom of a component, for nodes of any shape."""
        numbers: Int = self.components * np.asarray(node) + component
        return numbers

    def dofs(self, nodes: Integers) -> Int:
        """All degrees of freedom (..., components) of nodes (...)."""
        return self.dof(np.asarray(nodes)[..., None], np.arange(self.components))

    def node(self, dofs: Integers) -> Int:
        """The node of each degree of freedom."""
        nodes: Int = np.asarray(dofs) // self.components
        return nodes

    def component(self, dofs: Integers) -> Int:
        """The component of each degree of freedom."""
        components: Int = np.asarray(dofs) % self.components
        return components

    def nodal(self, values: NDArray[T]) -> NDArray[T]:
        """Values (n_nodes, components), a view, of a vector's (n_dofs,)."""
        return values.reshape(-1, self.components)


DISPLACEMENT = NodeLayout(2)
