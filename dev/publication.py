"""What the package index shows of a release: the README with absolute links, and where the project lives.

A checkout does not know its address. The workflow of a release gives it in RANGER_SIM_ADDRESS
(https://HOST/OWNER/NAME of a GitHub repository); without it links stay relative and there are no addresses.
"""

import re

TARGET = r"\((?!https?://|#|mailto:)([^)\s]+)\)"
IMAGE = re.compile(rf"(!\[[^][]*\]){TARGET}")
LINK = re.compile(rf"((?<!!)\[(?:[^][]|!\[[^][]*\]\([^)]*\)|\[[^][]*\])*\]){TARGET}")


def readme(text: str, address: str, version: str) -> str:
    """README's Markdown with links to the files of this version's tag; images as the files themselves."""
    if not address:
        return text
    base = address.rstrip("/")
    text = IMAGE.sub(rf"\1({base}/raw/v{version}/\2)", text)
    return LINK.sub(rf"\1({base}/blob/v{version}/\2)", text)


def addresses(address: str, version: str) -> dict[str, str]:
    """The project's addresses, {label: URL}, as the package index shows them."""
    if not address:
        return {}
    base = address.rstrip("/")
    return {
        "Source": base,
        "Documentation": f"{base}/blob/v{version}/docs/index.md",
        "Changelog": f"{base}/blob/v{version}/CHANGELOG.md",
        "Issues": f"{base}/issues",
    }
