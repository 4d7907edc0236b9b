"""What C prints on standard output goes elsewhere meanwhile, and what Python writes before and after does not."""

from __future__ import annotations

import subprocess
import sys

TALK = """
import ctypes
import sys
from tmc_vem.support.c_stdout import c_stdout_on_stderr

c = ctypes.CDLL(None)
print("before")
c.puts(b"C before")
with c_stdout_on_stderr():
    c.puts(b"C within")
print("after")
c.puts(b"C after")
c.fflush(None)
"""
CLOSED = """
import os
import sys
os.close(1)
from tmc_vem.support.c_stdout import c_stdout_on_stderr

with c_stdout_on_stderr():
    print("done", file=sys.stderr)
"""


def said(script: str) -> tuple[str, str]:
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    return done.stdout, done.stderr


def test_what_c_prints_meanwhile_is_on_standard_error() -> None:
    out, errors = said(TALK)
    assert sorted(out.split("\n")) == sorted(["before", "C before", "after", "C after", ""])
    assert errors == "C within\n"


def test_a_closed_standard_output_is_left_alone() -> None:
    assert said(CLOSED) == ("", "done\n")
