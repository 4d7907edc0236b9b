"""Arrays inside PETSc objects against the copies that petsc4py hands out."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.support.petsc import PETSc
from tmc_vem.support.petsc_arrays import compressed_rows, in_place


def matrix_of(dense: np.ndarray) -> PETSc.Mat:
    rows, columns = np.nonzero(dense)
    starts = np.searchsorted(rows, np.arange(len(dense) + 1))
    csr = (starts.astype(PETSc.IntType), columns.astype(PETSc.IntType), dense[rows, columns])
    return PETSc.Mat().createAIJ(dense.shape, csr=csr, comm=PETSc.COMM_SELF)


def test_rows_and_values_are_those_of_the_matrix():
    dense = np.array([[1.0, 0.0, 2.0, 0.0], [0.0, 0.0, 0.0, 0.0], [3.0, 4.0, 5.0, 0.0], [0.0, 0.0, 0.0, 6.0]])
    matrix = matrix_of(dense)
    starts, columns = compressed_rows(matrix)
    expected = matrix.getValuesCSR()
    np.testing.assert_array_equal(starts, expected[0])
    np.testing.assert_array_equal(columns, expected[1])
    values = in_place("MatSeqAIJGetArray", matrix, len(columns), np.float64)
    np.testing.assert_array_equal(values, expected[2])
    values[0] = 7.0  # in place
    assert matrix.getValue(0, 0) == 7.0


def test_matrices_without_entries_or_without_rows():
    empty = matrix_of(np.zeros((3, 3)))  # which the arrays are part of, so it must live on
    starts, columns = compressed_rows(empty)
    assert starts.tolist() == [0, 0, 0, 0]
    assert len(columns) == 0
    dense = PETSc.Mat().createDense((2, 2), comm=PETSc.COMM_SELF)
    dense.setUp()
    with pytest.raises(ValueError, match="type seqdense has no compressed rows"):
        compressed_rows(dense)
