from setuptools import find_packages, setup

package_name = "robot_demo_py"

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
    description="Python programs on the same interfaces as the C++ ones",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "move_robot = robot_demo_py.move_robot:main",
            "read_pose = robot_demo_py.read_pose:main",
        ],
    },
)
