"""Entry point of ``python -m codegen``: kernels without a driver."""

from __future__ import annotations

from codegen.cli import make_command

if __name__ == "__main__":
    make_command()(prog_name="python -m codegen")
