"""Errors that a user can act on; each class carries the exit code of the command line."""

from __future__ import annotations


class TmcError(Exception):
    """Base of the errors that the command line prints in one line."""

    exit_code = 1


class InputError(TmcError):
    """Something given by the user is wrong: a parameter, a mesh, a path. Exit code 2."""

    exit_code = 2


class Note(UserWarning):
    """Something that a user should know about how an input was read; the command line prints it in one line."""


class EvaluationError(TmcError):
    """The potential could not be evaluated at a state; raised on all ranks, whichever failed, and all cut the step."""


class ConvergenceError(TmcError):
    """The load could not be applied in full; what converged is kept. Exit code 3."""

    exit_code = 3
