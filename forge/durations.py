"""How long something took, in words."""

from __future__ import annotations


def duration(seconds: float) -> str:
    """Return seconds as colcon writes them: 0.15s, 12.3s, 1min 5s, 1h 2min 3s."""
    if seconds < 9.995:  # noqa: PLR2004  (where two decimals would round up to 10.00)
        return f"{seconds:.2f}s"
    if seconds < 59.95:  # noqa: PLR2004
        return f"{seconds:.1f}s"
    whole = round(seconds)
    hours, rest = divmod(whole, 3600)
    minutes, rest = divmod(rest, 60)
    return f"{hours}h {minutes}min {rest}s" if hours else f"{minutes}min {rest}s"
