"""Python packages without package.xml: the build type `python`, and build backends other than setuptools."""
