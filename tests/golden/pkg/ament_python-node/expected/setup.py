from setuptools import find_packages, setup

package_name = 'walker'

setup(
    name=package_name,
    version='0.0.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer="Ada 'A' <Lovelace>",
    maintainer_email='ada@example.org',
    description='Walks "far" & <wide>\nwith Ada\'s engine',
    license='BSD-3-Clause',
    extras_require={'test': ['pytest']},
    entry_points={
        'console_scripts': [
            'walk = walker.walk:main',
        ],
    },
)
