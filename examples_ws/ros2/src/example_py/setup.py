from setuptools import find_packages, setup

package_name = "example_py"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="Forge examples",
    maintainer_email="examples@example.com",
    description="First nodes in Python: one in main(), one as a class",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "node_02 = example_py.node_02:main",
            "node_04 = example_py.node_04:main",
        ],
    },
)
