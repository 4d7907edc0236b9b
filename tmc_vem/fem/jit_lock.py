"""Compiling forms without waiting for runs that are dead.

FFCx marks a form that is being compiled by its C file and waits for a second file that says it is ready. A process that
is killed meanwhile leaves the first without the second, and every later run of that form waits for the whole of
dolfinx's limit. Here whoever compiles also holds a lock that the system releases when its holder dies: what is marked
but not locked is left over, and is made anew.
"""

from __future__ import annotations

import fcntl
import importlib
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TextIO

from tmc_vem.fem import plain_library

logger = logging.getLogger(__name__)

SILENT = 2.0  # seconds to wait before saying what for


@contextmanager
def no_stale_locks() -> Iterator[None]:
    """Let FFCx look into its cache under our lock for as long as this lasts."""
    jit: Any = importlib.import_module("ffcx.codegeneration.jit")
    original = jit.get_cached_module
    with ExitStack() as held:
        jit.get_cached_module = lambda *arguments, **named: _look(original, held, *arguments, **named)
        if plain_library.needed():
            held.enter_context(plain_library.plain_libraries(jit))
        try:
            yield
        finally:
            jit.get_cached_module = original


def _look(
    original: Callable[..., Any], held: ExitStack, module_name: str, names: Any, cache_dir: Any, timeout: Any
) -> Any:
    """What FFCx has in its cache; with our lock, until ``held`` is closed, if the form is not ready."""
    source = Path(cache_dir) / f"{module_name}.c"
    ready = Path(f"{source}.cached")
    if not ready.exists():
        source.parent.mkdir(parents=True, exist_ok=True)
        try:
            lock = held.enter_context(source.with_suffix(".lock").open("w"))
            _wait(lock, module_name)
        except OSError as error:  # a file system without locks: as FFCx does it
            logger.debug("no lock for %s: %s", module_name, error)
        else:
            if source.exists() and not ready.exists():
                logger.info("%s was left over by a run that ended while it compiled the form", source)
                source.unlink(missing_ok=True)
    if ready.exists() and plain_library.is_plain(source.parent, module_name):
        return plain_library.objects(source.parent, module_name, names)
    return original(module_name, names, cache_dir, timeout)


def _wait(lock: TextIO, module_name: str) -> None:
    """Take the lock; say so if it takes long. Its holder is alive: the lock of a dead one is free."""
    start, said = time.monotonic(), False
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if not said and time.monotonic() - start > SILENT:
                logger.warning("waiting for another run that compiles the same form (%s)", module_name)
                said = True
            time.sleep(0.1)
