"""The package's own data files (config/, launch/, bags/), in a source checkout and in an installation alike."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from lasso_motion_ros.core.errors import LassoMotionError

PACKAGE = "lasso_motion_ros"


def share_directory() -> Path:
    """The directory that holds `package.xml`, `config/`, `launch/` and `bags/`.

    That is the checkout itself where the modules lie in one (also an editable install or colcon's
    `--symlink-install`), otherwise the nearest `share/lasso_motion_ros` above the installed modules: it is
    above them in a virtual environment, in colcon's install space and in `pip install --target` alike.

    Raises:
        LassoMotionError: the modules were copied somewhere without their data files.
    """
    module = Path(__file__)
    for package in dict.fromkeys((module.parents[1], module.resolve().parents[1])):
        if (package.parent / "package.xml").is_file():
            return package.parent
        for prefix in package.parents:
            candidate = prefix / "share" / PACKAGE
            if (candidate / "package.xml").is_file():
                return candidate
    raise LassoMotionError(f"{module.parent}: no share/{PACKAGE} above it; install with pip or colcon")


def share_file(relative: str | Path) -> Path:
    """Path of one data file, such as `config/tracker.yaml`.

    Args:
        relative: path below the share directory.

    Raises:
        LassoMotionError: there is no such file.
    """
    path = share_directory() / relative
    if not path.exists():
        raise LassoMotionError(f"{path}: no such file in the installed package")
    return path


def version() -> str:
    """The package's version; `package.xml` is the one place where it stands."""
    return ElementTree.parse(share_file("package.xml")).getroot().findtext("version", default="")


def bundled_recording() -> Path:
    """The recording that comes with the package.

    Raises:
        LassoMotionError: it is not there.
    """
    found = sorted(share_file("bags").glob("*.mcap"))
    if not found:
        raise LassoMotionError(f"{share_directory() / 'bags'}: no recording in it")
    return found[0]
