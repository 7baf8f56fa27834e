"""What is refused: one sentence that names file and field, and nothing written."""

from pathlib import Path
from typing import Any

import pytest

import faintrack as ft


def refuse(folder: Path, what: Any, scenario: Path | None, names: tuple[str, ...]) -> None:
    """Track in data of a folder, and read in the complaint all of these names."""
    before = sorted(folder.rglob("*"))
    with pytest.raises(ft.InputError) as caught:
        ft.track(what, scenario, out=folder / "out")
    sentence = str(caught.value)
    for name in names:
        assert name in sentence, sentence
    assert "\n" not in sentence
    assert sentence.endswith((".", "?"))
    assert sorted(folder.rglob("*")) == before
