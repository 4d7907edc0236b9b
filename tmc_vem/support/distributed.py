"""Objects that are spread over ranks, by what this program asks of them.

petsc4py has no types, and what mpi4py's communicators hand out is Any. So these protocols are what a type checker knows
about vectors, matrices, solvers and communicators, and a test compares them with the classes they stand for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

T = TypeVar("T")


class Request(Protocol):
    """A call that goes on in the background (``MPI.Request``)."""

    def Test(self) -> bool:
        """Whether it is done."""


class Comm(Protocol):
    """Ranks that work together (``MPI.Intracomm``); every method is called by all of them."""

    @property
    def rank(self) -> int:
        """Number of this rank, from 0."""

    @property
    def size(self) -> int:
        """How many there are."""

    def barrier(self) -> None:
        """Wait for all."""

    def Ibarrier(self) -> Request:
        """The same, to be asked about later."""

    def bcast(self, obj: T, root: int = 0) -> T:
        """What the root has, on all ranks."""

    def gather(self, sendobj: T, root: int = 0) -> list[T] | None:
        """What all ranks have, on the root; None elsewhere."""

    def allgather(self, sendobj: T) -> list[T]:
        """What all ranks have, in their order."""

    def scatter(self, sendobj: Sequence[T], root: int = 0) -> T:
        """One thing of those that the root has for each rank; what others hand over does not matter."""

    def alltoall(self, sendobj: Sequence[T]) -> list[T]:
        """What every rank has for this one, of what each has for all."""

    def allreduce(self, sendobj: T, op: Any = ...) -> T:
        """Sum, or another operation, over all ranks."""

    def Abort(self, errorcode: int = 0) -> object:
        """End all of them at once."""


class Vec(Protocol):
    """A vector over all ranks (``PETSc.Vec``)."""

    def getArray(self, readonly: bool = False) -> NDArray[np.float64]:
        """This rank's part, in place."""

    def getSize(self) -> int:
        """Entries of all ranks."""

    def duplicate(self) -> Vec:
        """Another vector of the same kind, its values not set."""

    def copy(self, result: Vec | None = None) -> Vec:
        """Copy into another vector, a new one by default."""

    def set(self, alpha: float) -> None:
        """All entries become ``alpha``."""

    def scale(self, alpha: float) -> None:
        """Times ``alpha``."""

    def abs(self) -> None:
        """Every entry becomes its absolute value."""

    def axpy(self, alpha: float, x: Vec) -> None:
        """Add ``alpha x``."""

    def axpby(self, alpha: float, beta: float, x: Vec) -> None:
        """Become ``alpha x + beta self``."""

    def waxpy(self, alpha: float, x: Vec, y: Vec) -> None:
        """Become ``alpha x + y``."""

    def dot(self, vec: Vec) -> float:
        """Scalar product."""

    def norm(self, norm_type: int | None = None) -> float:
        """Euclidean norm; 3 is the largest absolute entry."""

    def normalize(self) -> float:
        """Divide by the norm, which is returned."""

    def setValues(self, indices: NDArray[Any], values: NDArray[Any], addv: object = None) -> None:
        """Entries by numbers over all ranks, which :meth:`assemble` brings to where they belong."""

    def assemble(self) -> None:
        """Bring to other ranks what belongs there."""

    def destroy(self) -> object:
        """Free it."""


class Mat(Protocol):
    """A matrix over all ranks (``PETSc.Mat``)."""

    @property
    def handle(self) -> int:
        """Address of PETSc's object."""

    def getComm(self) -> Any:
        """Its ranks, as a communicator of PETSc."""

    def getType(self) -> str:
        """Its format."""

    def getSize(self) -> tuple[int, int]:
        """Rows and columns of all ranks."""

    def getOwnershipRange(self) -> tuple[int, int]:
        """First row of this rank, and first one of the next."""

    def getDiagonalBlock(self) -> Mat:
        """This rank's rows and columns as a matrix of its own."""

    def createSubMatrix(self, isrow: Any, iscol: Any, submat: Mat | None = None) -> Mat:
        """Some rows and columns as another matrix."""

    def setOption(self, option: int, flag: bool) -> None:
        """What PETSc may take for granted, or has to refuse."""

    def setBlockSize(self, bsize: int) -> None:
        """How many rows belong together."""

    def setLGMap(self, rmap: object, cmap: object = None) -> None:
        """This rank's numbers of rows and columns."""

    def setDM(self, dm: object) -> None:
        """The mesh that the matrix is of."""

    def setNearNullSpace(self, nullspace: object) -> None:
        """Vectors that multigrid has to keep."""

    def stateIncrease(self) -> object:
        """Tell PETSc that values were changed in place."""

    def createVecLeft(self) -> Vec:
        """A vector that products with the matrix fit into."""

    def createVecRight(self) -> Vec:
        """A vector that the matrix can be multiplied with."""

    def getDiagonal(self, result: Vec | None = None) -> Vec:
        """The diagonal, into a vector."""

    def setDiagonal(self, diag: Vec) -> None:
        """Replace the diagonal."""

    def mult(self, x: Vec, y: Vec) -> None:
        """``y`` becomes the product with ``x``."""

    def ptap(self, P: Mat) -> Mat:
        """``P^T A P`` as a new matrix."""

    def zeroEntries(self) -> None:
        """All values become 0, and the pattern stays."""

    def zeroRowsColumns(self, rows: NDArray[Any], diag: float = 1.0) -> None:
        """Rows and columns become those of the identity times ``diag``."""

    def setValueLocal(self, row: int, col: int, value: float, addv: object = None) -> None:
        """One entry, by this rank's numbers."""

    def setValuesRCV(self, R: NDArray[Any], C: NDArray[Any], V: NDArray[Any], addv: object = None) -> None:
        """Many dense blocks, by numbers over all ranks."""

    def assemble(self) -> None:
        """Bring to other ranks what belongs there."""

    def duplicate(self, copy: bool = False) -> Mat:
        """Another matrix of the same pattern."""

    def copy(self, result: Mat | None = None, structure: object = None) -> Mat:
        """Copy into another matrix."""

    def destroy(self) -> object:
        """Free it."""


class Pc(Protocol):
    """A preconditioner (``PETSc.PC``)."""

    def getType(self) -> str:
        """Its kind."""

    def getComm(self) -> Any:
        """Its ranks, as a communicator of PETSc."""

    def getOptionsPrefix(self) -> str | None:
        """What its options begin with."""

    def getOperators(self) -> tuple[Mat, Mat]:
        """Matrix of the equations, and the one that it is made of."""

    def getPythonContext(self) -> object:
        """The object that does the work of one of type 'python'."""

    def getFactorSolverType(self) -> str:
        """The package that factorises."""

    def getFactorMatrix(self) -> Any:
        """The factors."""

    def reset(self) -> None:
        """Forget the factors, and the matrices."""


class Ksp(Protocol):
    """A linear solver (``PETSc.KSP``)."""

    def getType(self) -> str:
        """Its kind."""

    def getPC(self) -> Pc:
        """Its preconditioner."""

    def getOptionsPrefix(self) -> str | None:
        """What its options begin with."""

    def setOptionsPrefix(self, prefix: str) -> None:
        """What its options shall begin with."""

    def setType(self, ksp_type: str) -> None:
        """Choose its kind."""

    def setFromOptions(self) -> None:
        """Read its options."""

    def getOperators(self) -> tuple[Mat, Mat]:
        """Matrix of the equations, and the one that the preconditioner is made of."""

    def setOperators(self, A: Mat, P: Mat | None = None) -> None:
        """Other matrices, or other values in them."""

    def setUp(self) -> None:
        """Make the preconditioner."""

    def solve(self, b: Vec, x: Vec) -> None:
        """Solve into ``x``."""

    def getConvergedReason(self) -> int:
        """Why it stopped, below 0 if it failed."""

    def getIterationNumber(self) -> int:
        """Iterations of the last solve."""

    def destroy(self) -> object:
        """Free it."""
