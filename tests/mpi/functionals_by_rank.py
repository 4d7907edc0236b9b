"""Run under mpirun: derivatives of results, as numbers that must not depend on the ranks; JSON from rank 0."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))

from helpers_functionals import Layers, case_of, explicit
from test_functionals import OTHERS, PROBES

from tmc_vem.sensitivity.functionals import Functionals

comm = MPI.COMM_WORLD
found = {}
for slope in (0.0, 0.2):
    case = case_of(Layers("voronoi", slope, PROBES))
    functionals = Functionals(case.problem, case.system)
    for name in (*PROBES, *OTHERS, "contact.block-foot.force_y"):
        derivative = functionals.of(name).derivative(case.state(case.u))
        numbers = {"value": derivative.value, "slope": derivative.by_u.dot(case.du), "norm": derivative.by_u.norm()}
        if derivative.on_residual is not None:
            numbers["held"] = derivative.on_residual.dot(case.du)
        for part in comm.allgather(explicit(case.system, case.u, derivative)):
            for key, mine in part.items():
                numbers[".".join(key)] = numbers.get(".".join(key), 0.0) + mine
        found |= {f"{slope} {name} {what}": number for what, number in numbers.items()}
if comm.rank == 0:
    print(json.dumps(found))
