"""The case files that come with freqrail. Imports nothing, so that completing their names costs nothing."""

from __future__ import annotations

from importlib import resources
from pathlib import Path


def shipped_cases() -> dict[str, str]:
    """The cases that come with freqrail: {name: TOML text}."""
    inside = resources.files("freqrail") / "cases"
    folder = inside if inside.is_dir() else Path(__file__).parents[2] / "cases"
    files = sorted(
        (f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name.removesuffix(".toml")
    )
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in files}
