"""Results by their key, on disk: a run that was cut off goes on where it was."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Store:
    """One JSON file an item. A key holds all that the item follows from, so that nothing stale is taken for new."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def get(self, key: dict[str, Any], make: Callable[[], Any]) -> Any:
        """The kept value of `key`, or what `make` gives, which is kept."""
        text = json.dumps(key, sort_keys=True)
        path = self._folder / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.json"
        if path.is_file():
            return json.loads(path.read_text())["value"]
        value = make()
        part = path.with_suffix(".part")
        part.write_text(json.dumps({"key": key, "value": value}))
        part.replace(path)
        return value
