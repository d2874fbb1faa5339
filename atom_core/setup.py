"""Python part of the package; called by catkin only (`catkin_python_setup` in CMakeLists.txt)."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

setup(
    **generate_distutils_setup(
        packages=find_packages("src"),
        package_dir={"": "src"},
        package_data={"atom_core.report.page": ["templates/*", "static/*"]},
    )
)
