"""All faults that may be put in, and a sample of them that depends on the sources and a seed only."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import CodeType

from mutation.c_sites import c_sites
from mutation.python_sites import python_sites
from mutation.site import Mutant, Site, mutants
from mutation.trees import PACKAGES


def sources(root: Path) -> list[str]:
    """Python and C sources under test."""
    found = (path for package in PACKAGES for path in (root / package).rglob("*") if path.suffix in (".py", ".c", ".h"))
    return sorted(path.relative_to(root).as_posix() for path in found)


def sites(file: str, text: str) -> Iterator[Site]:
    """All sites of a source."""
    return python_sites(file, text) if file.endswith(".py") else c_sites(file, text)


def draw(root: Path, files: Iterable[str], seed: int, number: int) -> list[Mutant]:
    """A sample of faults, no two at the same place: modules with more sites have more of them.

    Args:
        root: the tree.
        files: sources to draw from.
        seed: of the random numbers.
        number: how many; fewer if there are not so many sites.
    """
    texts = {file: (root / file).read_text() for file in files}
    everything = [site for file, text in texts.items() for site in sites(file, text)]
    numbers = random.Random(seed)
    numbers.shuffle(everything)
    chosen: list[Mutant] = []
    places: set[tuple[str, int]] = set()
    for site in everything:
        if len(chosen) == number:
            break
        mutant = site.mutant(texts[site.file], numbers.choice(site.options))
        if (site.file, site.start) not in places and changes(mutant, texts[site.file]):
            places.add((site.file, site.start))
            chosen.append(mutant)
    return sorted(chosen, key=lambda mutant: (mutant.file, mutant.start))


def find(root: Path, keys: Iterable[tuple[str, str, str]]) -> dict[tuple[str, str, str], list[Mutant]]:
    """Faults by file, lines before and lines after, wherever in the file; those that no source has are missing."""
    wanted = set(keys)
    found: dict[tuple[str, str, str], list[Mutant]] = {}
    for file in sorted({key[0] for key in wanted}):
        if (root / file).is_file():
            text = (root / file).read_text()
            for mutant in mutants(sites(file, text), text):
                if mutant.key in wanted:
                    found.setdefault(mutant.key, []).append(mutant)
    return found


def changes(mutant: Mutant, text: str) -> bool:
    """Whether a fault makes another program of a source: it can be read, and does not compile to the same."""
    if not mutant.file.endswith(".py"):
        return True
    try:
        return _code(compile(mutant.apply(text), mutant.file, "exec")) != _code(compile(text, mutant.file, "exec"))
    except (SyntaxError, ValueError):
        return False


def _code(code: CodeType) -> tuple[object, ...]:
    """What a compiled function does, without the places of its lines."""
    constants = tuple(_code(each) if isinstance(each, CodeType) else (type(each), each) for each in code.co_consts)
    return code.co_code, repr(constants), code.co_names, code.co_varnames, code.co_freevars
