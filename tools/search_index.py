"""Hook of MkDocs: the index of its search as a script, which a page may load from the disk too."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def on_post_build(config: Any) -> None:
    """Write ``search_index.js`` beside the index that the plugin has written."""
    index = Path(config["site_dir"]) / "search" / "search_index.json"
    content = index.read_text(encoding="utf-8")
    index.with_suffix(".js").write_text(f"window.searchIndex = {content};\n", encoding="utf-8")
