"""What the code imports is declared: in package.xml, in setup.py, and in the README where rosdep has no key."""

from __future__ import annotations

import ast
import functools
import re
import subprocess
import sys
from xml.etree import ElementTree

import pytest
from support.paths import ROOT

pytestmark = pytest.mark.slow

OURS = {"lasso_motion_ros", "msg_adapters"}
SHIPPED = ("lasso_motion_ros", "msg_adapters", "launch", "examples")
# Module → its rosdep key and its name on PyPI.
FROM_APT = {
    "aiohttp": ("python3-aiohttp", "aiohttp"),
    "cv2": ("python3-opencv", "opencv-python-headless"),
    "jinja2": ("python3-jinja2", "Jinja2"),
    "matplotlib": ("python3-matplotlib", "matplotlib"),
    "numpy": ("python3-numpy", "numpy"),
    "scipy": ("python3-scipy", "scipy"),
    "tqdm": ("python3-tqdm", "tqdm"),
    "yaml": ("python3-yaml", "PyYAML"),
}
# Likewise, where rosdep has the package from PyPI. It has no key for mcap alone.
BY_PIP_KEY = {
    "mcap": ("mcap-ros2-support", "mcap"),
    "rosbags": ("python3-rosbags-pip", "rosbags"),
    "trimesh": ("python3-trimesh-pip", "trimesh"),
}
# Module → what the README tells to install, and its name on PyPI.
WITHOUT_KEY = {
    "av": ("av", "av"),
    "skfmm": ("python3-scikit-fmm", "scikit-fmm"),
    "threadpoolctl": ("python3-threadpoolctl", "threadpoolctl"),
}
BROUGHT_BY_MCAP = {"lz4": "lz4", "zstandard": "zstandard"}
# Of the extras `volume`, `igtl`, `dicom`, `cluster` and `fast`: said when one is missing.
OPTIONAL = {
    "SimpleITK": "SimpleITK",
    "vtkmodules": "vtk",
    "pyigtl": "pyigtl",
    "pydicom": "pydicom",
    "distributed": "distributed",
    "numba": "numba",
    "dask_jobqueue": "dask-jobqueue",
}
PIP_NAMES = {name: pip for name, (_, pip) in (FROM_APT | BY_PIP_KEY | WITHOUT_KEY).items()} | BROUGHT_BY_MCAP | OPTIONAL
# ROS packages that a Python module, or an executable in a launch file, comes from.
ROS_PACKAGES = {"tf2_ros": {"tf2_ros", "tf2_ros_py"}}


@functools.cache
def nodes(folder: str) -> tuple[ast.AST, ...]:
    """All that is written in a folder's files, as far as these tests look."""
    kinds = (ast.Import, ast.ImportFrom, ast.Call, ast.Constant)
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in sorted((ROOT / folder).rglob("*.py")))
    return tuple(node for tree in trees for node in ast.walk(tree) if isinstance(node, kinds))


def words(*folders: str) -> list[str]:
    """All strings."""
    constants = (node.value for folder in folders for node in nodes(folder) if isinstance(node, ast.Constant))
    return [value for value in constants if isinstance(value, str)]


def imported(*folders: str) -> set[str]:
    """Top-level names of all imports, wherever in the files, but for the standard library's and our own."""
    found: set[str] = set()
    for folder in folders:
        for node in nodes(folder):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names) - OURS


def named_in_words(*folders: str) -> set[str]:
    """Packages of message types, which are often made by their names: `package/msg/Name`."""
    return {match[1] for word in words(*folders) if (match := re.match(r"(\w+)/(?:msg|srv)/\w+$", word))}


def started() -> set[str]:
    """Packages whose executables the launch files start."""
    return {
        keyword.value.value
        for node in nodes("launch")
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg == "package" and isinstance(keyword.value, ast.Constant)
    }


def declared(*kinds: str) -> set[str]:
    root = ElementTree.parse(ROOT / "package.xml").getroot()
    return {entry.text or "" for kind in kinds for entry in root.findall(kind)}


def ros_packages() -> set[str]:
    names = (imported(*SHIPPED) | named_in_words(*SHIPPED) | started()) - PIP_NAMES.keys()
    return {package for name in names for package in ROS_PACKAGES.get(name, {name})}


def test_every_ros_package_that_is_used_is_an_exec_depend() -> None:
    assert {"rclpy", "sensor_msgs", "builtin_interfaces", "rcl_interfaces", "tf2_ros_py", "rviz2"} <= ros_packages()
    assert ros_packages() - declared("exec_depend") == set()


def test_no_ros_package_is_declared_that_nobody_uses() -> None:
    by_others = {"lifecycle_msgs", "ros2launch"}  # the services of a lifecycle node; the command `ros2 launch`
    pip_keys = {key for key, _ in BY_PIP_KEY.values()}
    ros = {name for name in declared("exec_depend") if not name.startswith("python3-")} - pip_keys
    assert ros - ros_packages() == by_others


def test_what_the_tests_import_of_ros_is_declared() -> None:
    # By lines, not by syntax trees: there are more tests than code, and what a line imports is all that is asked.
    lines = re.compile(r"^\s*(?:from|import) (\w+_(?:msgs|srvs|interfaces))\b", re.MULTILINE)
    texts = (path.read_text(encoding="utf-8") for path in sorted((ROOT / "test").rglob("*.py")))
    ros = {name for text in texts for name in lines.findall(text)}
    assert "lifecycle_msgs" in ros
    assert ros - declared("exec_depend", "test_depend") == set()


def test_every_library_has_its_rosdep_key_or_stands_in_the_readme() -> None:
    used = imported(*SHIPPED)
    by_key = FROM_APT | BY_PIP_KEY
    keys = {by_key[name][0] for name in used & by_key.keys()}
    libraries = {name for name in declared("exec_depend") if name.startswith("python3-")} | {"mcap-ros2-support"}
    assert keys == libraries <= declared("exec_depend")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = re.findall(
        r"^(?:sudo apt|pip) install (?:--break-system-packages )?([a-z0-9 -]+?) +#", readme, re.MULTILINE
    )
    told = {name for command in commands for name in command.split()}
    assert told == {WITHOUT_KEY[name][0] for name in used & WITHOUT_KEY.keys()}


def test_setup_py_asks_for_every_library_that_is_used_and_no_other() -> None:
    loaded_by_name = {name for name in OPTIONAL if any(word.startswith(name) for word in words(*SHIPPED))}
    used = (imported(*SHIPPED) | loaded_by_name) & PIP_NAMES.keys()
    asked = re.findall(r'"([A-Za-z0-9_-]+)>=', (ROOT / "setup.py").read_text(encoding="utf-8"))
    assert {PIP_NAMES[name] for name in used} == set(asked)


def test_nothing_unknown_is_imported() -> None:
    ros = declared("exec_depend") - {key for key, _ in BY_PIP_KEY.values()}
    assert imported(*SHIPPED) - PIP_NAMES.keys() - {package for package in ros if "-" not in package} == set()


ONLY_FOR_FILES = (
    "rosbags",
    "mcap",
    "lz4",
    "zstandard",
    "trimesh",
    "av",
    "threadpoolctl",
    "matplotlib",
    "jinja2",
    "tqdm",
)
ALIVE = """
import importlib, sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {absent}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
for node in ("tracker_node", "overlay_node", "web_node", "igtl_node"):
    importlib.import_module(f"lasso_motion_ros.nodes.{{node}}")
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.stream.warm_up import warm_up
from msg_adapters.messages import RosMessages

print([output.topic.name for output in warm_up(StreamConfig(), RosMessages())].count("motion"))
"""


@pytest.mark.ros
def test_the_live_nodes_need_nothing_that_is_for_files() -> None:
    """Each is imported, and the tracker goes from ROS messages to ROS messages, as it does before its first pair."""
    pytest.importorskip("rclpy", reason="needs ROS 2")
    pytest.importorskip("aiohttp", reason="needs the web extra")
    words = [sys.executable, "-c", ALIVE.format(absent=ONLY_FOR_FILES)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, encoding="utf-8", check=False, timeout=120)
    assert (done.returncode, done.stdout) == (0, "4\n"), done.stderr


def test_the_package_names_a_page_to_read_on() -> None:
    urls = ElementTree.parse(ROOT / "package.xml").getroot().findall("url")
    assert urls
    assert all((url.text or "").startswith("https://") for url in urls)
    assert {url.attrib["type"] for url in urls} <= {"website", "repository", "bugtracker"}
