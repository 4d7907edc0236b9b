"""Names in figures as they are: matplotlib would take what stands between two dollars for a formula."""

from __future__ import annotations

from tmc_vem.support.validation import printable


def label(text: str) -> str:
    """A text that matplotlib shows character by character, also beside a formula of ours.

    A leading underscore would keep it out of a legend, so that a space comes before it; line breaks and other controls
    are shown as Python writes them.
    """
    shown = printable(text).replace("$", r"\$")
    return f" {shown}" if shown.startswith("_") else shown
