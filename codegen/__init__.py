"""Code generator: a strain energy density in Python becomes a verified, compiled C kernel.

The package stands on its own (sympy, numpy and a C compiler) and never imports ``tmc_vem``.
"""

from codegen.declare import energy
from codegen.errors import CodegenError

__all__ = ["CodegenError", "energy"]
