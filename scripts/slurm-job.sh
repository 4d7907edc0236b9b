#!/usr/bin/env bash
# A run of tmc-vem on a cluster with SLURM. Copy it, set the resources, and submit with
#
#   sbatch slurm-job.sh RUN_DIRECTORY PROBLEM [OPTIONS...]      sbatch slurm-job.sh runs/box box --cells 640 160
#
# Five minutes before the time is up the run is stopped, with its last load step in a checkpoint, and the job goes back into
# the queue; it then resumes, on as many ranks as it is given.
#SBATCH --job-name=tmc-vem
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=32
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=2G
#SBATCH --time=04:00:00
#SBATCH --signal=B:TERM@300
#SBATCH --requeue
#SBATCH --open-mode=append
set -euo pipefail

if [ $# -lt 2 ]; then
  echo "usage: sbatch slurm-job.sh RUN_DIRECTORY PROBLEM [OPTIONS...]" >&2
  exit 2
fi
directory=$1
problem=$2
shift 2

# module load ...; source .../.venv/bin/activate
export OMP_NUM_THREADS=1
# compiled kernels on the disk of each node: processors may differ, and locks on network file systems are slow
export TMC_VEM_CACHE=${TMC_VEM_CACHE:-${TMPDIR:-/tmp}/tmc-vem-$(id -u)}

complete() {
  grep -qs '"complete": true' "$directory/result.json"
}

if complete; then
  echo "$directory is complete"
  exit 0
elif [ -e "$directory/checkpoint.npz" ]; then
  command=(resume "$directory" --quiet)
else
  command=(run "$problem" "$@" --out "$directory" --overwrite --quiet)
fi

stopped=
trap 'stopped=yes; kill -TERM "$step" 2>/dev/null || true' TERM
# a rank that dies must take the others with it
srun --kill-on-bad-exit=1 tmc-vem "${command[@]}" &
step=$!
code=0
wait "$step" || code=$?
if [ -n "$stopped" ]; then
  wait "$step" || code=$?
  if complete; then
    exit 0
  elif [ -e "$directory/checkpoint.npz" ]; then
    scontrol requeue "$SLURM_JOB_ID"
    exit 0
  fi
fi
exit "$code"
