#!/usr/bin/env bash
# One would guess that gmsh prints nothing with General.Terminal = 0 and General.Verbosity = 0, so that a program may write
# JSON on its standard output. Recombining triangles to quadrilaterals (Mesh.RecombineAll = 1) prints a line there all the
# same, where there are some ten thousand of them: what computes the perfect matching prints by itself. Debian 12's
# python3-gmsh (4.8.4+ds2), whose module says 4.8.0; skipped without it.
set -euo pipefail
if ! /usr/bin/python3 -c 'import gmsh; assert gmsh.__version__ == "4.8.0"' 2>/dev/null; then
  echo "skipped: needs python3-gmsh of Debian 12"
  exit 0
fi
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
cd "$here"
cat >square.py <<'PY'
import sys

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setNumber("General.Verbosity", 0)
gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
gmsh.model.occ.synchronize()
for name in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
    gmsh.option.setNumber(name, float(sys.argv[1]))
gmsh.option.setNumber("Mesh.Algorithm", 6)
gmsh.option.setNumber("Mesh.RecombineAll", float(sys.argv[2]))
gmsh.model.mesh.generate(2)
gmsh.finalize()
PY
echo "gmsh $(dpkg-query -W -f '${Version}' python3-gmsh)"
for case in "0.01 0" "0.02 1" "0.01 1"; do
  # shellcheck disable=SC2086
  said=$(/usr/bin/python3 square.py $case 2>/dev/null)
  echo "size and recombination $case: '$said'"
  case "$case" in
    "0.01 1") grep -q 'WARNING: shrinks.length==shrinks_max=' <<<"$said" ;;
    *) [ -z "$said" ] ;;
  esac
done
