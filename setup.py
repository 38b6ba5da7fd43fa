"""Build of the ament_python package: the same file serves pip and colcon."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = "lasso_motion_ros"


def files(folder, *suffixes):
    """Names of a folder's files with one of the suffixes."""
    return sorted(str(path) for path in Path(folder).iterdir() if path.suffix in suffixes)


setup(
    name=NAME,
    version=ElementTree.parse("package.xml").getroot().findtext("version"),
    description="Respiratory motion compensation from a lasso catheter in biplane X-ray, for ROS 2",
    license="Apache-2.0",
    maintainer="lasso_motion_ros maintainers",
    maintainer_email="maintainers@users.noreply.github.com",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*", "msg_adapters", "msg_adapters.*"]),
    package_data={
        NAME: ["py.typed", "reports/templates/*", "web/static/*.*", "web/static/vendor/*"],
        "msg_adapters": ["py.typed"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "LICENSE"]),
        (f"share/{NAME}/config", files("config", ".yaml", ".xml", ".rviz", ".json")),
        (f"share/{NAME}/launch", files("launch", ".py")),
        (f"share/{NAME}/bags", files("bags", ".yaml", ".mcap")),
    ],
    zip_safe=False,
    install_requires=[
        "numpy>=1.26",
        "scipy>=1.11",
        "opencv-python-headless>=4.6",
        "scikit-fmm>=2022.8",
        "PyYAML>=6",
        "lz4>=4",
        "mcap>=1.6",
        "rosbags>=0.10",
        "Jinja2>=3.1",
        "matplotlib>=3.6",
        "threadpoolctl>=3",
        "tqdm>=4.60",
        "zstandard>=0.20",
    ],
    extras_require={
        # Not needed, and not wanted, beside an apt installation of ROS 2, which they would shadow.
        "ros": ["ros-jazzy-rclpy", "ros-jazzy-common-interfaces", "ros-jazzy-rmw-fastrtps-cpp"],
        "overlay": ["trimesh>=4"],
        "video": ["av>=12"],
        # JPEG, JPEG-LS and JPEG 2000 are decoded by the plugins.
        "dicom": ["pydicom>=3", "pylibjpeg[libjpeg,openjpeg]>=2"],
        "volume": ["SimpleITK>=2.3", "vtk>=9.2"],
        "web": ["aiohttp>=3.9"],
        # By this, and not by package.xml, `colcon test` knows that pytest is to be run.
        "test": ["pytest"],
        "igtl": ["pyigtl>=0.3"],
        # Compiles the tracker's kernels; numpy 2.4 needs a newer one than Ubuntu 24.04's numpy does.
        "fast": ["numba>=0.59"],
        "cluster": ["distributed>=2024.1", "dask-jobqueue>=0.8"],
        "dev": [
            "colcon-common-extensions",
            "cyclonedds",
            "hypothesis",
            "mcap-ros2-support",
            "mypy",
            "pre-commit",
            "pre-commit-hooks",
            "pytest",
            "pytest-timeout",
            "pytest-xdist",
            "ruff",
            "selenium",
            "types-PyYAML",
        ],
    },
    entry_points={
        "console_scripts": [
            f"lasso-motion = {NAME}.cli.start:start",
            f"lasso_tracker = {NAME}.nodes.executables:lasso_tracker",
            f"lasso_overlay = {NAME}.nodes.executables:lasso_overlay",
            f"lasso_web = {NAME}.nodes.executables:lasso_web",
            f"lasso_igtl = {NAME}.nodes.executables:lasso_igtl",
        ]
    },
)
