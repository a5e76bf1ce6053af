"""Text files from templates: ``templates/*.j2``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgms_observer import __version__

_ENVIRONMENT = Environment(
    loader=FileSystemLoader(Path(__file__).with_name("templates")),
    undefined=StrictUndefined,
    keep_trailing_newline=True,
    trim_blocks=False,
)


def fill(template: str, **values: Any) -> str:
    """Return a template with its values.

    Args:
        template: name of the file below ``templates`` without ``.j2``.
        values: what it asks for.
    """
    return _ENVIRONMENT.get_template(f"{template}.j2").render(version=__version__, **values)
