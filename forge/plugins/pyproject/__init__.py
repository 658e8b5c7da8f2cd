"""Python packages: those without package.xml, build backends other than setuptools, and common mistakes."""
