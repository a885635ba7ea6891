"""A page of sections, of which some are made anew."""

from __future__ import annotations

import re
from collections.abc import Iterable


def stamped(section: str, made: str) -> str:
    """The section with when and how it was made under its heading."""
    heading, _, rest = section.partition("\n\n")
    return f"{heading}\n\n{made}.\n\n{rest}"


def replaced(page: str, sections: Iterable[str]) -> str:
    """The page with these sections in place of those of the same headings; new ones come last."""
    parts = [part.rstrip() for part in re.split(r"(?m)^(?=## )", page)]
    for section in sections:
        heading = section.partition("\n")[0]
        places = [k for k, part in enumerate(parts) if part.partition("\n")[0] == heading]
        if places:
            parts[places[0]] = section
        else:
            parts.append(section)
    return "\n\n".join(parts) + "\n"
