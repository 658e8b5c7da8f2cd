"""The steps that test the packages of each build type."""
