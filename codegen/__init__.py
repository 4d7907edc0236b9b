"""Code generator: a strain energy density in Python becomes a verified, compiled C kernel.

The package stands on its own (sympy and cffi) and never imports ``tmc_vem``.
"""

from codegen.errors import CodegenError

__all__ = ["CodegenError"]
