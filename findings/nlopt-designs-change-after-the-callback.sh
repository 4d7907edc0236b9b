#!/usr/bin/env bash
# One would guess that the array which nlopt hands to an objective in Python is the point that it asked for, and stays so.
# It is a window on nlopt's own memory: a history that keeps the arrays has the same point many times at the end, and memory
# that was freed at its beginning, without an error. Keep x.copy(). Debian 12's python3-nlopt 2.7.1-5; skipped without it.
set -euo pipefail
if [[ $(dpkg-query -W -f '${Version}' python3-nlopt 2>/dev/null) != 2.7.1-5 ]]; then
  echo "skipped: needs python3-nlopt 2.7.1-5"
  exit 0
fi
/usr/bin/python3 - <<'PY'
import nlopt
import numpy as np

kept, copied = [], []


def objective(x, gradient):
    kept.append(x)
    copied.append(x.copy())
    if len(kept) == 5:
        during.extend(len({point.tobytes() for point in points}) for points in (kept, copied))
    gradient[:] = 2.0 * (x - 0.3)
    return float(((x - 0.3) ** 2).sum())


during = []
opt = nlopt.opt(nlopt.LD_MMA, 2)
opt.set_lower_bounds([0.0, 0.0])
opt.set_upper_bounds([1.0, 1.0])
opt.set_maxeval(5)
opt.set_min_objective(objective)
opt.optimize([0.9, 0.1])
print(f"nlopt {nlopt.__version__}: of 5 points, {during[0]} are different where x was kept, {during[1]} where it was copied")
print("x has memory of its own:", kept[0].flags.owndata)
if during[0] >= 5 or during[1] != 5 or kept[0].flags.owndata:
    raise SystemExit("this has changed")
PY
