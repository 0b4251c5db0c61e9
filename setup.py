"""Lists the packages: cli/ and configs/ are installed inside gridslam (see pyproject.toml, package-dir)."""

from setuptools import find_namespace_packages, setup

NESTED = [
    f"gridslam.{top}{sub}"
    for top in ("cli", "configs")
    for sub in ("", *("." + p for p in find_namespace_packages(top)))
]
setup(packages=find_namespace_packages(include=["gridslam", "gridslam.*"]) + NESTED)
