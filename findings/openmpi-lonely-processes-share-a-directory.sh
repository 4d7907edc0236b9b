#!/usr/bin/env bash
# One would guess that processes which use MPI without mpirun, each by itself, have nothing in common, all the more with
# ess_singleton_isolated=1, which keeps Open MPI from starting a daemon for them. But all isolated processes of a user get one
# directory for their session, TMPDIR/ompi.HOST.UID/jf.0/1/0, and each removes it when it ends: here one that lives on
# finds its directory gone after another has ended. One that begins just then can fail in MPI_Init.
# orte_create_session_dirs=0 does without. Debian packages libopenmpi3 4.1.4-3+b1, python3-mpi4py 3.1.4-2+b2
set -euo pipefail
version=$(dpkg-query -W -f '${Version}' libopenmpi3 2>/dev/null || true)
[[ $version == 4.1.4-* ]] && /usr/bin/python3 -c 'import mpi4py' 2>/dev/null ||
  { echo "skipped: needs libopenmpi3 4.1.4 and python3-mpi4py"; exit 0; }
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
export TMPDIR=$here/tmp OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_ess_singleton_isolated=1
mkdir "$TMPDIR"
cat > "$here/lives.py" <<'PY'
import glob, os, subprocess, sys
from mpi4py import MPI
look = lambda: [p.split("ompi.")[1].split("/", 1)[1] for p in glob.glob(os.environ["TMPDIR"] + "/ompi.*/jf.*/*/*")]
clean = {k: v for k, v in os.environ.items() if not k.startswith(("PMIX_", "ORTE_", "OMPI_MCA_ess=", "OMPI_MCA_pmix"))}
print("before:", *look() or ["none"])
subprocess.run([sys.executable, "-c", "from mpi4py import MPI"], env=clean, check=True)
print("after another has ended:", *look() or ["none"])
PY
echo "libopenmpi3 $version"
with=$(/usr/bin/python3 "$here/lives.py")
without=$(OMPI_MCA_orte_create_session_dirs=0 /usr/bin/python3 "$here/lives.py")
echo "$with"
echo "with orte_create_session_dirs=0: $without"
[[ $with == "before: jf.0/1/0"*"ended: none" && $without == "before: none"* ]] || { echo "this has changed"; exit 1; }
