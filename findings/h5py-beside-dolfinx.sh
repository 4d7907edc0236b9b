#!/usr/bin/env bash
# One would guess that a checkpoint of a dolfinx program can be written with h5py, as each works alone and neither names
# the other. Instead the wheel of h5py, imported after Debian's dolfinx, finds that one's parallel HDF5 library loaded and
# fails with 'ValueError: Not a datatype'. h5py==3.16.0 with Debian 12's python3-dolfinx-real 0.5.2; skipped without it.
set -euo pipefail
if ! /usr/bin/python3 -c 'import dolfinx; assert dolfinx.__version__ == "0.5.2"' 2>/dev/null; then
  echo "skipped: needs Debian 12's python3-dolfinx-real 0.5.2"
  exit 0
fi
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
/usr/bin/python3 -m venv --system-site-packages "$here/env"
"$here/env/bin/pip" install --quiet --disable-pip-version-check h5py==3.16.0 'numpy==1.26.4'
cat >"$here/write.py" <<'PY'
import importlib
import sys

for name in sys.argv[2:]:
    try:
        module = importlib.import_module(name)
        print(name, module.__version__)
    except ValueError as error:
        print(f"import {name}: ValueError: {error}")
        raise SystemExit(3)
import h5py

with h5py.File(sys.argv[1], "w") as file:
    file["a"] = [1.0, 2.0]
print("written")
PY
alone=0 beside=0
"$here/env/bin/python" "$here/write.py" "$here/a.h5" h5py || alone=$?
"$here/env/bin/python" "$here/write.py" "$here/b.h5" dolfinx h5py || beside=$?
[ "$alone $beside" = "0 3" ] || { echo "this has changed"; exit 1; }
