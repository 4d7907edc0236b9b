"""All faults that may be put in, and a sample that depends on a seed, and on the sources as little as it can."""

from __future__ import annotations

import hashlib
from collections import Counter
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

    Every site has a number of its own, made from the seed, its file and its line, and the smallest are the sample. So
    all sites have the same probability, and where sources change, only what is at changed lines leaves the sample.

    Args:
        root: the tree.
        files: sources to draw from.
        seed: of the sample.
        number: how many; fewer if there are not so many sites.
    """
    texts = {file: (root / file).read_text() for file in files}
    ranked = sorted(
        ((rank, site) for file, text in texts.items() for rank, site in _ranked(sites(file, text), text, seed)),
        key=lambda pair: (pair[0], pair[1].file, pair[1].start),
    )
    chosen: list[Mutant] = []
    places: set[tuple[str, int]] = set()
    for rank, site in ranked:
        if len(chosen) == number:
            break
        mutant = site.mutant(texts[site.file], site.options[rank % len(site.options)])
        if (site.file, site.start) not in places and changes(mutant, texts[site.file]):
            places.add((site.file, site.start))
            chosen.append(mutant)
    return sorted(chosen, key=lambda mutant: (mutant.file, mutant.start))


def _ranked(sites_: Iterator[Site], text: str, seed: int) -> Iterator[tuple[int, Site]]:
    """Sites, each with its number: the same lines in a file are told apart by their order."""
    alike: Counter[tuple[str, ...]] = Counter()
    for site in sites_:
        first = text.rfind("\n", 0, site.start) + 1
        last = text.find("\n", site.end)
        before, after = text[first : site.start].lstrip(), text[site.end : last if last >= 0 else len(text)]
        name = (site.file, site.operator, before, text[site.start : site.end], after)
        alike[name] += 1
        words = "\0".join((str(seed), *name, str(alike[name])))
        yield int.from_bytes(hashlib.sha256(words.encode()).digest()[:8], "big"), site


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
