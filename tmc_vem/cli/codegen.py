"""The command ``tmc-vem codegen``: the code generator's, for kernels with the cell driver."""

from __future__ import annotations

from codegen.cell_driver import CELL_DRIVER
from codegen.cli import make_command

main = make_command(CELL_DRIVER)
