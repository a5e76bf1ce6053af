"""The seal: the truth lies outside of the case's folder; inside lies only a salted hash of it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

SEAL_FILE = "seal.txt"


def digest(truth: dict[str, Any]) -> str:
    """Return the salted SHA-256 of a truth (its ``salt`` is one of its entries)."""
    return hashlib.sha256(json.dumps(truth, sort_keys=True).encode("utf-8")).hexdigest()


def seal(truth: dict[str, Any], truth_file: Path, case_folder: Path) -> None:
    """Write the truth to ``truth_file`` and its digest into ``case_folder``.

    Args:
        truth: what is hidden; must carry a ``salt``.
        truth_file: must lie outside of ``case_folder``.
        case_folder: what the workflow sees.

    Raises:
        ValueError: when there is no salt, or the truth would lie where the workflow can see it.
    """
    if not truth.get("salt"):
        raise ValueError("a truth without a salt can be guessed from its digest; add an entry 'salt'")
    if case_folder.resolve() in truth_file.resolve().parents:
        raise ValueError(f"{truth_file} lies inside the case {case_folder}; put the truth elsewhere")
    truth_file.parent.mkdir(parents=True, exist_ok=True)
    truth_file.write_text(json.dumps(truth, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    (case_folder / SEAL_FILE).write_text(digest(truth) + "\n", encoding="utf-8")


def open_seal(truth_file: Path, case_folder: Path) -> dict[str, Any]:
    """Return the truth of a case.

    Raises:
        ValueError: when the truth is not the one that was sealed.
    """
    truth: dict[str, Any] = json.loads(truth_file.read_text(encoding="utf-8"))
    if digest(truth) != (case_folder / SEAL_FILE).read_text(encoding="utf-8").strip():
        raise ValueError(f"{truth_file} was changed after {case_folder} was sealed; make the case again")
    return truth
