"""Write run.txt and dev.txt anew: what pip resolves today for the extras in setup.py, every version exact.

Run it with the oldest Python that is supported, as `python3.11 requirements/lock.py`; what the oldest one can
install, the newer ones can too. ubuntu-24.04.txt is kept by hand.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
# Environments of Python 3.12 and later come without them, and the package's own build needs them. colcon builds
# by setup.py commands that later releases drop.
BUILD = ["setuptools<81", "wheel"]


def resolved(python: Path, extras: str) -> dict[str, str]:
    """Name → version of everything that the package with some extras needs, itself left out."""
    with tempfile.TemporaryDirectory() as directory:
        report = Path(directory) / "report.json"
        command = [python, "-m", "pip", "install", "--quiet", "--dry-run", "--ignore-installed", "--report", report]
        subprocess.run([*command, f"{HERE.parent}[{extras}]", *BUILD], check=True)
        entries = [entry["metadata"] for entry in json.loads(report.read_text())["install"]]
    # The report names what is downloaded; `pip freeze` would add the packages that ROS wheels carry inside.
    pins = {entry["name"].lower().replace("_", "-"): entry["version"] for entry in entries}
    del pins["lasso-motion-ros"]
    return pins


def main() -> int:
    """Resolve both sets in a fresh environment and write them."""
    with tempfile.TemporaryDirectory() as directory:
        venv.create(directory, with_pip=True)
        python = Path(directory) / "bin" / "python"
        everything = resolved(python, "ros,overlay,video,web,dicom,volume,igtl,fast,cluster,dev")
        running = {name: everything[name] for name in resolved(python, "ros,overlay,video,web,dicom")}
    testing = {name: version for name, version in everything.items() if name not in running}
    for name, title, head, pins in (
        ("run.txt", "What `make demo` installs.", "", running),
        ("dev.txt", "What `make test` and `make lint` install.", "-r run.txt\n", testing),
    ):
        lines = [f"{package}=={version}\n" for package, version in sorted(pins.items())]
        (HERE / name).write_text(f"# {title} Written by lock.py; do not edit.\n{head}" + "".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
