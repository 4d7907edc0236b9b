#!/usr/bin/env bash
# One would guess that reshape(-2, 2) is refused: -1 alone is documented for the length that is left over, and np.zeros((-2, 2))
# says 'negative dimensions are not allowed'. Any negative length is taken as the one that is left over, so that a wrong sign or
# number there goes unseen by results. numpy==2.2.4
set -euo pipefail
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
python3 -m venv "$here/env"
"$here/env/bin/pip" install --quiet --disable-pip-version-check numpy==2.2.4
"$here/env/bin/python" - <<'PYTHON'
import numpy as np

print("numpy", np.__version__)
values = np.arange(6)
shapes = {length: values.reshape(length, 2).shape for length in (-1, -2, -3, -100)}
print("reshape(n, 2) of six values, by n:", shapes)
try:
    np.zeros((-2, 2))
    refused = "nothing"
except ValueError as error:
    refused = str(error)
print("zeros((-2, 2)):", refused)
if set(shapes.values()) != {(3, 2)} or "negative dimensions" not in refused:
    raise SystemExit("this has changed")
PYTHON
