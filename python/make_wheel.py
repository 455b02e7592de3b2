"""Writes the wheel of the package duet (PEP 427) from a build folder: module, package, engines, shipped files, program.

    python3 python/make_wheel.py BUILD_FOLDER OUTPUT_FOLDER
"""

import base64
import glob
import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

METADATA = """Metadata-Version: 2.1
Name: duet
Version: {version}
Summary: A benchmark for two-person interactions with a humanoid
Requires-Python: >=3.9
Requires-Dist: numpy>=1.22
License-File: LICENSE
"""
WHEEL = "Wheel-Version: 1.0\nGenerator: duet\nRoot-Is-Purelib: false\nTag: {tag}\n"
ENTRY_POINTS = "[console_scripts]\nduet = duet._program:main\n"
STAMP = (2020, 1, 1, 0, 0, 0)  # the same files give the same bytes


def version_of(build):
    """The version of the CMake project."""
    with open(os.path.join(build, "CMakeCache.txt"), encoding="utf-8") as cache:
        return re.search(r"^CMAKE_PROJECT_VERSION:STATIC=(.+)$", cache.read(), re.M).group(1)


def stage(source, build, folder):
    """Everything that the wheel has, below `folder`."""
    package = os.path.join(folder, "duet")
    shutil.copytree(os.path.join(source, "python", "duet"), package, ignore=shutil.ignore_patterns("__pycache__", "*.pyc"))
    modules = glob.glob(os.path.join(build, "python", "duet", "_duet.*.so"))
    if len(modules) != 1:
        sys.exit(f"make_wheel: expected one module _duet in {build}/python/duet, found {len(modules)}")
    shutil.copy2(modules[0], package)
    for component in ("share", "program"):
        subprocess.run(["cmake", "--install", build, "--prefix", package, "--component", component], check=True,
                       stdout=subprocess.DEVNULL)
    for folder_of_systems in ("doc", "man"):
        shutil.rmtree(os.path.join(package, "share", folder_of_systems), ignore_errors=True)
    for path in glob.glob(os.path.join(package, "**", "*.so"), recursive=True) + [os.path.join(package, "bin", "duet")]:
        subprocess.run(["strip", "--strip-unneeded", path], check=True)


def metadata(source, folder, version, tag):
    info = os.path.join(folder, f"duet-{version}.dist-info")
    os.makedirs(info)
    shutil.copy2(os.path.join(source, "LICENSE"), info)
    for name, text in (("METADATA", METADATA.format(version=version)), ("WHEEL", WHEEL.format(tag=tag)),
                       ("entry_points.txt", ENTRY_POINTS)):
        with open(os.path.join(info, name), "w", encoding="utf-8") as file:
            file.write(text)
    return info


def record_line(name, content):
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(content)}\n"


def write(folder, info, path):
    files = sorted(os.path.relpath(os.path.join(root, name), folder) for root, _, names in os.walk(folder) for name in names)
    record = os.path.join(os.path.basename(info), "RECORD")
    lines = ""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as wheel:
        for name in files:
            with open(os.path.join(folder, name), "rb") as file:
                content = file.read()
            entry = zipfile.ZipInfo(name, STAMP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (os.stat(os.path.join(folder, name)).st_mode & 0o777 | 0o100000) << 16
            wheel.writestr(entry, content)
            lines += record_line(name, content)
        wheel.writestr(zipfile.ZipInfo(record, STAMP), lines + f"{record},,\n")


def main(build, output):
    source = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    version = version_of(build)
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
    os.makedirs(output, exist_ok=True)
    path = os.path.join(output, f"duet-{version}-{tag}.whl")
    with tempfile.TemporaryDirectory() as folder:
        stage(source, build, folder)
        write(folder, metadata(source, folder, version, tag), path)
    print(path)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(os.path.abspath(sys.argv[1]), sys.argv[2])
