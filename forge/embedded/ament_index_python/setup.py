"""Installs the package and its marker in the index."""

from setuptools import setup

setup(
    name="ament_index_python",
    version="1.4.0",
    description="Finds installed packages and what they registered in the ament resource index.",
    license="Apache-2.0",
    packages=["ament_index_python"],
    package_data={"ament_index_python": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/ament_index_python"]),
        ("share/ament_index_python", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
)
