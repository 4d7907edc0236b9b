#!/usr/bin/env bash
# One would guess that a geometry with a syntax error, which gmsh refuses with an exception, is over and done with, at the
# latest after gmsh.finalize() and gmsh.initialize(). Instead the parser keeps what it has not read of it, so that the next
# file, which is valid, is refused at 'line 0' for words of the other one. Debian 12's python3-gmsh (4.8.4+ds2), whose module
# says 4.8.0, and gmsh 4.13.1 of Debian 13; skipped without one of them.
set -euo pipefail
if ! /usr/bin/python3 -c 'import gmsh; assert gmsh.__version__ in ("4.8.0", "4.13.1")' 2>/dev/null; then
  echo "skipped: needs python3-gmsh of Debian 12 or 13"
  exit 0
fi
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
printf 'Point(1) = {0, 0, 0, 1};\nPoint(2) = {1, 0, 0, 1};\n' >"$here/good.geo"
printf 'Point(1) = {0, 0, 0, 1};\nPoint(2 = {1, 0, 0, 1};\nPoint(3) = {1, 1, 0, 1};\n' >"$here/bad.geo"
/usr/bin/python3 - "$here" <<'PY'
import sys

import gmsh


def points(name):
    """How many points a file has, or what gmsh says; with gmsh started anew."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        gmsh.open(f"{sys.argv[1]}/{name}")
        return len(gmsh.model.getEntities(0))
    except Exception as error:
        return str(error).rpartition("', ")[2]
    finally:
        gmsh.finalize()


print("gmsh", gmsh.__version__)
found = [(name, points(name)) for name in ("good.geo", "bad.geo", "good.geo")]
for name, result in found:
    print(f"{name}: {result}")
if found[0][1] != 2 or "line 2: syntax error" not in str(found[1][1]) or "line 0: syntax error" not in str(found[2][1]):
    raise SystemExit("this has changed")
PY
