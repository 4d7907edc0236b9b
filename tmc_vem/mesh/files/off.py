"""Object File Format (.off): vertices and faces of any number of sides, no regions and no names.

Format: https://people.sc.fsu.edu/~jburkardt/data/off/off.html
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tmc_vem.mesh.files.record import Reading, Record
from tmc_vem.mesh.files.text import lines_of, shown_line
from tmc_vem.support.errors import InputError

HEAD = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF( BINARY)?$")


def read(path: Path, reading: Reading) -> Record:
    """Read a .off file.

    Raises:
        InputError: it is not one, or is cut off.
    """
    lines = ((n, line.split("#")[0].strip()) for n, line in lines_of(path))
    rows = [(n, line) for n, line in lines if line]
    if not rows:
        raise InputError("it is empty")
    head = HEAD.match(rows[0][1])
    if head and (head[4] or head[5] or head[6]):
        raise InputError(f"it is of the kind '{rows[0][1]}': write plain OFF")
    words = rows[0][1].split()
    if words[0].endswith("OFF") and len(words) > 1:
        rows[0] = (rows[0][0], " ".join(words[1:]))
    elif head:
        rows = rows[1:]
    else:
        raise InputError("it does not start with OFF")
    try:
        n_points, n_faces = (int(word) for word in rows[0][1].split()[:2])
    except (ValueError, IndexError):
        raise InputError("the numbers of vertices and faces are missing after OFF") from None
    body = rows[1:]
    if n_points < 0 or n_faces < 0 or len(body) < n_points + n_faces:
        raise InputError(f"{n_points} vertices and {n_faces} faces are announced and {len(body)} lines are there")
    points, loops = [], []
    n, line = rows[0]  # the last that was looked at
    try:
        for n, line in body[:n_points]:  # noqa: B007
            values = [float(word) for word in line.split()[:3]]
            if len(values) < 2:
                raise ValueError("a vertex needs x, y and z")
            points.append(([*values, 0.0])[:3])
        for n, line in body[n_points : n_points + n_faces]:  # noqa: B007
            size, *corners = line.split()
            if len(corners) < int(size):
                raise ValueError(f"a face of {size} needs as many vertices")
            loops.append(np.array([int(corner) for corner in corners[: int(size)]], dtype=np.int64))
    except (ValueError, OverflowError) as error:
        raise InputError(f"line {n}: '{shown_line(line)}' is not understood: {error}") from None
    return Record(np.array(points, dtype=float).reshape(-1, 3), loops)
