from setuptools import find_packages, setup

package_name = "example_topic_rclpy"

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
    description="A publisher and a subscriber in Python",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "topic_publisher_02 = example_topic_rclpy.topic_publisher_02:main",
            "topic_subscribe_02 = example_topic_rclpy.topic_subscribe_02:main",
        ],
    },
)
