"""Writes the model of a parameter file as C source, as a ros2_control controller, or as FMU."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.node_parameters import refuse_missing
from sgms_observer.whole_file import write_bytes


@dataclass(frozen=True)
class ExportOptions:
    """Options of an export.

    Attributes:
        target: ``c``, ``fmu`` or ``ros2_control``.
        axes: names of axes, none for all (an FMU: for the first).
        real: type of the numbers in C, ``double`` or ``float``.
        fmi: version of an FMU, 2 or 3.
        overwrite: replace an existing export.
    """

    target: str
    axes: tuple[str, ...] = ()
    real: str = "double"
    fmi: int = 3
    overwrite: bool = False


@dataclass(frozen=True)
class Exported:
    """Result of an export.

    Attributes:
        path: the folder or the FMU.
        axes: names of the axes in it.
        files: names of the files in it.
        warnings: one sentence each.
    """

    path: str
    axes: tuple[str, ...]
    files: tuple[str, ...]
    warnings: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the result for ``--json``."""
        return {"path": self.path, "axes": self.axes, "files": self.files, "warnings": self.warnings}


def export(config: str | Path, out: str | Path, options: ExportOptions) -> Exported:
    """Write the C folder, the controller package or the FMU of a parameter file.

    Args:
        config: the YAML.
        out: folder (``c``, ``ros2_control``) or file (``fmu``) to write.
        options: target, axes and format.

    Raises:
        ConfigurationError: the YAML, or something in it, cannot be exported.
        RecordingError: the files cannot be written.
    """
    settings = load_settings(config)
    axes = settings.wanted_axes(options.axes, str(config))
    path = Path(out)
    refuse_missing(settings, axes[:1] if options.target == "fmu" else axes)
    _refuse_existing(path, options)
    if options.target == "fmu":
        from sgms_observer.export.fmu_target import write_fmu

        if options.axes and len(options.axes) > 1:
            sentence = "an FMU holds one axis; give one --axis, and export the others as FMUs of their own"
            raise ConfigurationError([sentence])
        names = write_fmu(settings, axes[0], options.fmi, path)
        warnings = []
        if path.suffix != ".fmu":
            warnings.append(f"{path} does not end in .fmu; rename it for tools that ask for it")
        return Exported(str(path), (axes[0].name,), names, tuple(warnings))
    from sgms_observer.export.c_target import c_files

    files, warnings = c_files(settings, axes, options.real)
    if options.target == "ros2_control":
        from sgms_observer.export.c_target import controller_files

        files = controller_files(axes, files, settings.sample_period)
    for name, text in files.items():
        write_bytes(text.encode(), path / name)
    return Exported(str(path), tuple(axis.name for axis in axes), tuple(files), tuple(warnings))


def _refuse_existing(path: Path, options: ExportOptions) -> None:
    """Raise if the path exists and must not be replaced."""
    if not path.exists():
        return
    if not options.overwrite:
        raise ConfigurationError([f"{path} exists already and is not overwritten; give another name, or --overwrite"])
    if options.target == "fmu":
        is_ours = _is_fmu(path)
    elif options.target == "c":
        is_ours = (path / "sgms.h").is_file() or _is_empty_folder(path)
    else:
        is_ours = _is_exported_package(path) or _is_empty_folder(path)
    if not is_ours:
        raise ConfigurationError([f"{path} was not written by sgms export and is not overwritten; give another name"])


def _is_fmu(path: Path) -> bool:
    """Return whether a file is an FMU, and no parameter file or other file of the user."""
    if not path.is_file() or not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as archive:
        return "modelDescription.xml" in archive.namelist()


def _is_exported_package(path: Path) -> bool:
    """Return whether a folder is a ROS package that an export wrote, and none of the user."""
    try:
        return "written by sgms export" in (path / "package.xml").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False


def _is_empty_folder(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())
