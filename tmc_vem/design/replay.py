"""Going on after a kill: evaluations that are on record are answered from there, in the order in which they were made.

A method of nlopt cannot save its state, but it asks the same again if it gets the same answers: the state comes back by
itself at no cost but that of the method.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.evaluation import Evaluate, Evaluation
from tmc_vem.support import notes

Float = NDArray[np.float64]


class Replay:
    """Evaluates designs, those on record from the record; what comes after is appended to it.

    Args:
        evaluate: for designs beyond the record.
        records: designs (n_variables,) and what they had, in order; copied.

    Attributes:
        records: all evaluations until now.
        replayed: how many of them came from the record.
    """

    def __init__(self, evaluate: Evaluate, records: Iterable[tuple[Float, Evaluation]] = ()) -> None:
        self._evaluate = evaluate
        self.records = [(np.array(z, dtype=np.float64), evaluation) for z, evaluation in records]
        self.replayed = 0
        self._position = 0

    def __call__(self, z: Float) -> Evaluation:
        """The evaluation of a design: the next on record if that is of the same design to the last bit.

        If it is not, options or versions have changed since: the rest of the record is dropped, with a note.
        """
        if self._position < len(self.records):
            known, evaluation = self.records[self._position]
            if known.tobytes() == np.asarray(z, dtype=np.float64).tobytes():
                self._position += 1
                self.replayed += 1
                return evaluation
            notes.say(
                f"evaluation {self._position + 1} is of another design than on record: options or versions have "
                f"changed, so {len(self.records) - self._position} evaluations on record are not used"
            )
            del self.records[self._position :]
        z = np.array(z, dtype=np.float64)
        evaluation = self._evaluate(z.copy())
        self.records.append((z, evaluation))
        self._position += 1
        return evaluation
