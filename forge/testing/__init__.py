"""Running the tests of packages, and reading what they left behind.

recipes.py         build type to the steps that test a package, pure
looking.py         what a package and its build folder say about its tests
preparing.py       what the tests of a workspace share; the plan of a run
running.py         the environment of tests, and what is left beside them
outcomes.py        JUnit and CTest result files to counts and cases, pure
collecting.py      all result files below a folder
showing.py         results and failures as people and colcon's readers see them, pure
unittests.py       a program of its own: unittest with a JUnit file
"""
