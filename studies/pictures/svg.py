"""Lines, words and places of the pictures that are written as SVG: the same bytes for the same figures."""

GREY, RED, BLUE, INK = "#b8bec8", "#c8452f", "#2460a7", "#24292f"


def text(x: float, y: float, words: str, anchor: str = "start", size: int = 13, colour: str = INK) -> str:
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="{anchor}" fill="{colour}">{words}</text>'


def line(x1: float, y1: float, x2: float, y2: float, colour: str = GREY, width: float = 1.0, more: str = "") -> str:
    return f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke="{colour}" stroke-width="{width:g}"{more}/>'


def place(value: float, limits: tuple[float, float], ends: tuple[float, float]) -> float:
    """Where a value lies between two ends, in pixels."""
    return round(ends[0] + (value - limits[0]) / (limits[1] - limits[0]) * (ends[1] - ends[0]), 1)


def figure(width: float, height: float, parts: list[str]) -> str:
    """The whole picture, on white."""
    font = 'font-family="Helvetica, Arial, sans-serif"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" {font}>'
    ground = f'<rect width="{width:g}" height="{height:g}" fill="white"/>'
    return "\n".join([head, ground, *parts, "</svg>", ""])
