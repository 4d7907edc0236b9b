"""Timed loops of the benchmarks are C that stands on the generated kernels' internals: they compile, and what they call
is what the driver calls. Nothing is timed."""

import importlib
import platform
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def benchmark_module(monkeypatch):
    """Imports a benchmark by its name, and forgets it and its neighbours afterwards."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    yield importlib.import_module
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(BENCHMARKS)):
            del sys.modules[name]


def test_point_functions_are_timed(benchmark_module, tmp_path):
    module = benchmark_module("point_kernel")
    energy = module.DENSITIES["solid"]
    source = module.generate(
        module.trace(module.second_gradient_energy(energy.density, energy.name, energy.parameters))
    ).c_source
    library = module.build(source, tmp_path, module.SCALAR, ("-lm",))
    x_bkv = np.zeros((module.N_BATCHES, 12, 8))
    for level in range(3):
        assert module.seconds_per_point(library, level, x_bkv, np.array([20.0, 10.0])) > 0.0


@pytest.mark.skipif(platform.machine() != "x86_64", reason="it is linked with glibc's vector mathematics")
def test_parts_of_the_driver_are_timed(benchmark_module, tmp_path):
    module = benchmark_module("kernel_rates")
    source = module.generated("huhu_lulu")
    found = module.parts(module.build(source, tmp_path), source, "quadrilateral")
    assert set(found) == {"point kernel", "w D B", "contraction"}
    assert all(part["flops"] > 0.0 and part["seconds"] > 0.0 for part in found.values())
    # six rows of nine functions: upper triangles of two blocks and a full one; a product and its sum are two operations
    assert found["contraction"]["flops"] == 16 * 2 * 6 * (9 * 10 + 81)
