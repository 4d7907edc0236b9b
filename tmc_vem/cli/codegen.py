"""The command ``tmc-vem codegen``: the code generator's, for kernels with the cell driver."""

from __future__ import annotations

from codegen.cli import make_command
from tmc_vem.vem.kernel.driver import CELL_DRIVER, DEVICE_CELLS

main = make_command({"c": CELL_DRIVER, "cuda": DEVICE_CELLS})
