"""Run under mpirun: derivatives of results by numbers, and by their values in cells, as JSON from rank 0."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))

from helpers_sensitivity import case_of, finer, own
from test_sensitivity_loads import BESIDE, GRADED, HELD, INCLINED, SEAL, loaded

from tmc_vem import RunOptions, run
from tmc_vem.sensitivity import sensitivities
from tmc_vem.simulation.end_of_run import EndOfRun
from tmc_vem.simulation.simulation import prepare

OF = ("gap", "side", "hold", "squeezed", "mises", "stored", "energy", "reaction", "contact.block.force_y",
      "p_norm.von_mises.block")  # fmt: skip
BY = ("regions.foot.solid.E", "block.K", "regions.medium.medium.gamma")
PROBLEMS = {
    "graded": (own(GRADED), ("load.uy", "support.top.ux")),
    "springs": (
        loaded(
            SEAL + BESIDE, {"name": "push", "at": "corner", "force": [0.05, -0.1]},
            {"name": "press", "at": "top", "traction": [0.1, -0.3]},
            spring=[{"at": "side", "stiffness": [3.0, 1.0], "name": "bed"}],
        ),
        ("load.push.force.2", "load.press.traction.2", "spring.bed.stiffness.1"),
    ),
    "inclined": (
        loaded(INCLINED, {"at": "top", "normal": -0.12, "name": "press"},
               support=(HELD, {"at": "tip", "ux": 0.01})),
        ("load.press.normal", "support.tip.ux"),
    ),
}  # fmt: skip
method = sys.argv[1]
found = {}
for name, (problem, more) in PROBLEMS.items():
    if (name, method) == ("springs", "fem"):
        continue
    case = case_of(problem if method == "vem" else finer(problem, cells="triangles", size=0.2), method, steps=4)
    of = [result for result in OF if result != "reaction"] if name == "springs" else OF
    for entry in case.found.table(of, (*BY, *more)).entries:
        found[f"{name} {entry.of} {entry.by}"] = entry.derivative
    for number in BY:
        cells = np.asarray(case.found.gradient("gap", number, per_cell=True))
        where = np.arange(1.0, len(cells) + 1.0)
        found[f"{name} {number} cells"] = float(np.abs(cells).sum())
        found[f"{name} {number} where"] = float(where @ np.abs(cells))
# the mesh is spread over the ranks anew each time
problem = own() if method == "vem" else finer(own(), cells="triangles", size=0.2)
result = run(problem, options=RunOptions(method, steps=4, snapshots=0))
for n in range(3):
    found[f"result {n}"] = sensitivities(result).gradient("hold", "regions.foot.solid.E")
end = result.end
assert end is not None
system = prepare(problem, None, end.options).system
assert np.array_equal(system.node_labels(), end.labels_nz)
rotated = MPI.COMM_WORLD.allgather((end.labels_nz, end.values))[(MPI.COMM_WORLD.rank + 1) % MPI.COMM_WORLD.size]
elsewhere = EndOfRun(**{**vars(end), "labels_nz": rotated[0], "values": rotated[1]})
assert np.array_equal(elsewhere.give(system).getArray(), end.values)
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps(found))
