"""The environment of the programs that tmc-vem is compared with: runs/peers-env, made when it is needed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ENVIRONMENT = ROOT / "runs" / "peers-env"
PYTHON = ENVIRONMENT / "bin" / "python"
REQUIREMENTS = Path(__file__).resolve().parent / "peers" / "requirements.txt"
SYSTEM = Path("/usr/bin/python3")  # the versions are those for Debian 12's
GROUP = "# group: "


def groups(text: str) -> dict[str, list[str]]:
    """Requirements by the name of the group that they stand under."""
    found: dict[str, list[str]] = {}
    name = ""
    for line in text.splitlines():
        if line.startswith(GROUP):
            name = line.removeprefix(GROUP).strip()
            found[name] = []
        elif line.strip() and not line.startswith("#"):
            found[name].append(line.strip())
    return found


def installed() -> dict[str, str]:
    """Install what is missing or of another version.

    Returns:
        Groups that could not be installed, with the reason.
    """
    left_out = {}
    for name, wanted in groups(REQUIREMENTS.read_text()).items():
        stamp = ENVIRONMENT / f".installed-{name}"
        if stamp.is_file() and stamp.read_text().splitlines() == wanted:
            continue
        print(f"installing {', '.join(wanted)} into {ENVIRONMENT}", flush=True)
        reason = _install(wanted)
        if reason:
            left_out[name] = reason
        else:
            stamp.write_text("\n".join(wanted) + "\n")
    return left_out


def _install(wanted: list[str]) -> str:
    """Why it did not work; empty if it did."""
    if not PYTHON.exists():
        base = SYSTEM if SYSTEM.exists() else Path(sys.executable)
        made = subprocess.run([base, "-m", "venv", ENVIRONMENT], capture_output=True, text=True, check=False)
        if made.returncode:
            shutil.rmtree(ENVIRONMENT, ignore_errors=True)  # half of one would be taken for a whole one
            return _last(made.stdout + made.stderr)
    pip = [PYTHON, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary", ":all:", *wanted]
    done = subprocess.run(pip, capture_output=True, text=True, check=False)
    return _last(done.stdout + done.stderr) if done.returncode else ""


def _last(text: str) -> str:
    """The last line that says something."""
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "no reason was given")
