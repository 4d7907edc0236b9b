"""A benchmark that prints the blocks of a page."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from pages.block import Block
from pages.runs import directly


def main(description: str, blocks: Sequence[Block], prefix: str) -> None:
    """Measure and print the studies that the command line names, or all."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    studies = {block.name.removeprefix(prefix): block for block in blocks if block.name.startswith(prefix)}
    parser.add_argument("study", nargs="*", default=list(studies), choices=list(studies))
    for name in parser.parse_args().study:
        print(f"\n== {name}\n")
        print(studies[name].write(directly), flush=True)
