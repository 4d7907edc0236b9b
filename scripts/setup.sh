#!/usr/bin/env bash
# Set up everything the project needs on Debian 12 or 13: the missing system packages, then .venv.
# Idempotent: what is already there is left alone. With --test also a browser, in which reports are tested, and other compilers.
set -euo pipefail
cd "$(dirname "$0")/.."

lists=(scripts/debian-packages.txt)
[ "${1:-}" != --test ] || lists+=(scripts/debian-packages-test.txt)

missing=()
while read -r package; do
  [ -n "$package" ] || continue
  dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
done < <(cat "${lists[@]}")

if [ "${#missing[@]}" -gt 0 ]; then
  install="apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends ${missing[*]}"
  if [ "$(id -u)" -eq 0 ]; then
    sh -c "$install"
  elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    sudo sh -c "$install"
  else
    printf 'setup: %d Debian packages are missing. Run this as root, then call make again:\n\n  %s\n\n' \
      "${#missing[@]}" "$install" >&2
    exit 1
  fi
fi

# The environment belongs to Debian's own Python: dolfinx, petsc4py and gmsh are built for it.
[ -x .venv/bin/python ] || /usr/bin/python3 -m venv --system-site-packages .venv
.venv/bin/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
touch .venv/.ready
