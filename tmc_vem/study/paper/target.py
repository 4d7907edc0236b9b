"""A table or figure of the paper that can be reproduced."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tmc_vem.report.page import Section
from tmc_vem.results.run_result import RunResult
from tmc_vem.study.batch import Job

Results = Mapping[str, RunResult]  # by name of the job


@dataclass(frozen=True)
class Target:
    """A table or figure of the paper.

    Attributes:
        title, lead: head of the page.
        jobs: runs by label, for a quick or the full version.
        sections: content of the page from the results, by name of the job.
    """

    title: str
    lead: str
    jobs: Callable[[bool], Mapping[str, Job]]
    sections: Callable[[Results, bool], list[Section]]
