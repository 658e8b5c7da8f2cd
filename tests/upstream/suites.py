"""The suites of upstream that apply to the embedded packages."""

SUITES = {
    "rosidl_generator_c": "generated C structures and functions",
    "rosidl_generator_cpp": "generated C++ structures, builders and traits",
    "rosidl_generator_py": "generated Python classes",
    "rosidl_generator_tests": "generated C and C++ since Jazzy, with type hashes and descriptions",
    "rosidl_runtime_c": "sequences, strings, type hashes and descriptions in C",
    "rosidl_runtime_cpp": "the bounded vector in C++",
    "rosidl_runtime_py": "messages by name, from and to dictionaries, YAML and CSV",
    "rosidl_typesupport_interface": "names of functions that return type supports",
}
"""What each suite tests, by the name of its package."""
