"""Gallery pages from demos/*.py: comment cells become text with formulas, the rest code, the picture stands on top.

A line ``# %%`` starts a cell of text, which ends with the first line that is no comment.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
TEXT = "# %%"


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before the sources are read."""
    app.connect("builder-inited", _write_pages)
    return {"parallel_read_safe": True}


def _write_pages(app: Any) -> None:
    folder = Path(app.srcdir) / "gallery"
    folder.mkdir(exist_ok=True)
    demos = sorted((ROOT / "demos").glob("demo_*.py"))
    for page in folder.glob("*.md"):
        if page.stem != "index" and page.stem not in {demo.stem for demo in demos}:
            page.unlink()
    for demo in demos:
        write_if_changed(folder / f"{demo.stem}.md", gallery_page(demo))
    entries = "\n".join(demo.stem for demo in demos)
    write_if_changed(folder / "index.md", f"{_INTRODUCTION}\n```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```\n")


_INTRODUCTION = """# Gallery

Each demo is a script that runs by itself, explains its mathematics and asserts its numbers; the tests run all of them
with `--quick`. The pictures are of the full runs and made by `make pictures`.
"""


def write_if_changed(path: Path, text: str) -> None:
    """Write a generated page; one that is the same already stays, so that only what changed is built again."""
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def gallery_page(demo: Path) -> str:
    """Page of a demo in MyST."""
    source = demo.read_text()
    title, _, rest = (ast.get_docstring(ast.parse(source)) or demo.stem).partition("\n")
    picture = f"pictures/{demo.stem.removeprefix('demo_')}.png"
    shown = f"![{title}](../{picture})\n\n" if (ROOT / "docs" / picture).exists() else ""
    parts = [f"# {title.rstrip('.')}\n\n{shown}{rest.strip()}\n"]
    body = source[source.index('"""', source.index('"""') + 3) + 3 :].strip("\n")
    parts += [f"```python\n{text}\n```\n" if is_code else f"{text}\n" for is_code, text in cells(body)]
    return "\n".join(parts) + f"\nThe whole file: `demos/{demo.name}`.\n"


def cells(source: str) -> list[tuple[bool, str]]:
    """The source as a list of (is it code, text)."""
    found: list[tuple[bool, list[str]]] = [(True, [])]
    for line in source.splitlines():
        if line.strip() == TEXT:
            found.append((False, []))
        elif found[-1][0] or line.startswith("#"):
            found[-1][1].append(line if found[-1][0] else line.removeprefix("#").removeprefix(" "))
        else:
            found.append((True, [line]))
    return [(is_code, "\n".join(lines).strip("\n")) for is_code, lines in found if "".join(lines).strip()]
