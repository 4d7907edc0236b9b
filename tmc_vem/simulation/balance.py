"""How evenly the ranks share work and memory, for result.json."""

from __future__ import annotations

import resource
from collections.abc import Mapping
from typing import Any

from tmc_vem.support.distributed import Comm


def balance(comm: Comm, work: Mapping[str, float]) -> dict[str, Any]:
    """Imbalance and memory over all ranks.

    Args:
        comm: the ranks; all of them call this.
        work: this rank's share of the work, in several measures.

    Returns:
        ``ranks``, ``imbalance`` (for each measure the largest share over the mean one, 1 if all are equal) and
        ``peak_memory_mib`` (resident, of the rank that needed most, and of all together).
    """
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    parts = comm.allgather((dict(work), peak))
    imbalance = {}
    for measure in work:
        shares = [part[0][measure] for part in parts]
        imbalance[measure] = max(shares) * len(shares) / sum(shares) if sum(shares) else 1.0
    peaks = [part[1] for part in parts]
    return {
        "ranks": len(parts),
        "imbalance": imbalance,
        "peak_memory_mib": {"largest": max(peaks), "all": sum(peaks)},
    }
