"""Names of a model as the harness takes them."""

import re


def identifier(name: str) -> str:
    """The name in letters, digits and underscores."""
    return re.sub(r"\W", "_", name, flags=re.ASCII)
