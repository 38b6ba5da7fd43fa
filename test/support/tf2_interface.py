"""`tf2_msgs`, which the wheels of ROS 2 lack, made of its one message by the wheels' own generators and a compiler."""

from __future__ import annotations

import importlib.metadata
import inspect
import os
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

PACKAGE = "tf2_msgs"
DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"
MANIFEST = f"<package format='3'><name>{PACKAGE}</name><version>0.36.0</version><description>-</description></package>"
NEEDED = ("geometry_msgs", "std_msgs", "builtin_interfaces")
# Fast DDS asks for both by their files' names. All that is compiled is in the first; the second leads there.
LIBRARY = f"lib{PACKAGE}__rosidl_typesupport_fastrtps_c.so"
INTROSPECTION = f"lib{PACKAGE}__rosidl_typesupport_introspection_c.so"
RUNTIME = (
    *("rosidl_runtime_c", "rosidl_typesupport_c", "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_fastrtps_cpp"),
    *("rosidl_typesupport_introspection_c", "fastcdr", "rcutils"),
)
KINDS = ("generator_c", "typesupport_c", "typesupport_fastrtps_c", "typesupport_introspection_c", "generator_py")


def can_build() -> bool:
    """Whether there are the generators and a compiler."""
    return bool(shutil.which("gcc") and shutil.which("g++")) and bool(_extensions("rosidl_cli.command.hash.extensions"))


def build_tf2_msgs(directory: Path) -> Path:
    """The directory to import `tf2_msgs` from."""
    source, generated = directory / "source", directory / "generated"
    (source / "msg").mkdir(parents=True)
    (source / "msg" / "TFMessage.msg").write_text(DEFINITION)
    (source / "package.xml").write_text(MANIFEST)
    # In a process of its own: the generators go by the working directory.
    environment = {**os.environ, "AMENT_PREFIX_PATH": sys.prefix}
    words = [sys.executable, "-P", __file__, str(directory)]
    subprocess.run(words, cwd=source, env=environment, check=True, capture_output=True, timeout=120)
    return _compiled(generated, directory / "site")


def _extensions(group: str) -> dict[str, importlib.metadata.EntryPoint]:
    return {entry.name: entry for entry in importlib.metadata.entry_points(group=group)}


def _generate(directory: Path) -> None:
    from rosidl_cli.command.hash.api import generate_type_hashes
    from rosidl_cli.command.translate.api import translate

    shares = [str(Path(sys.prefix) / "share" / name) for name in NEEDED]
    idl = translate(
        package_name=PACKAGE,
        interface_files=["msg/TFMessage.msg"],
        include_paths=[],
        output_format="idl",
        output_path=directory / "idl",
    )
    hashed = directory / "hash"
    generate_type_hashes(package_name=PACKAGE, interface_files=idl, include_paths=shares, output_path=hashed)
    for group, name in (
        *(("type_extensions", name) for name in ("c", "py")),
        *(("typesupport_extensions", name) for name in ("c", "fastrtps_c", "introspection_c")),
    ):
        extension = _extensions(f"rosidl_cli.command.generate.{group}")[name].load()(name)
        output = directory / "generated" / name / PACKAGE
        output.mkdir(parents=True, exist_ok=True)  # `c` is both
        words = {"type_description_files": [str(hashed / "msg" / "TFMessage.json")]}
        known = inspect.signature(extension.generate).parameters
        extension.generate(PACKAGE, idl, shares, output, **{key: words[key] for key in words if key in known})


def _compiled(generated: Path, site: Path) -> Path:
    package, prefix = site / PACKAGE, Path(sys.prefix)
    shutil.copytree(generated / "py" / PACKAGE, package)
    (package / "__init__.py").touch()
    folders = [*generated.iterdir(), prefix / "include", *(prefix / "include").iterdir()]
    folders += [Path(sysconfig.get_paths()["include"]), Path(np.get_include())]
    includes = [f"-I{folder}" for folder in folders]
    libraries = [
        f"-l{name}__rosidl_{kind}"
        for name in NEEDED
        for kind in KINDS
        if (prefix / "lib" / f"lib{name}__rosidl_{kind}.so").exists()
    ]
    linked = [f"-L{prefix / 'lib'}", f"-Wl,-rpath,{prefix / 'lib'}", *libraries, *(f"-l{name}" for name in RUNTIME)]

    def compiled(file: Path) -> str:
        compiler = ["g++", "-std=c++17"] if file.suffix == ".cpp" else ["gcc", "-std=gnu11"]
        target = site / f"{file.parent.parent.parent.parent.name}_{file.name}.o"
        _run([*compiler, "-fPIC", *includes, "-c", str(file), "-o", str(target)])
        return str(target)

    sources = [one for end in ("*.c", "*.cpp") for one in generated.rglob(end) if ".ep." not in one.name]
    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(compiled, sources))
    _run(["g++", "-shared", f"-Wl,-soname,{LIBRARY}", "-o", str(package / LIBRARY), *objects, *linked])
    ours = [f"-L{package}", "-Wl,-rpath,$ORIGIN", "-Wl,--no-as-needed", f"-l:{LIBRARY}"]
    _run(["gcc", "-shared", f"-Wl,-soname,{INTROSPECTION}", "-o", str(package / INTROSPECTION), *ours])
    for file in package.glob("*.ep.*.c"):
        kind = file.name.split(".")[2]
        module = package / f"{PACKAGE}_s__{kind}{sysconfig.get_config_var('EXT_SUFFIX')}"
        words = [*ours, f"-l:{INTROSPECTION}", *linked]
        _run(["gcc", "-shared", "-fPIC", *includes, str(file), "-o", str(module), *words])
    return site


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False, timeout=120)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stderr}"


if __name__ == "__main__":
    _generate(Path(sys.argv[1]))
