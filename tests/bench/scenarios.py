"""All that is measured: a table of scenarios, in the order of the page."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from tests.bench import (
    builds,
    cdr_cpp,
    cdr_python,
    compile_cost,
    configures,
    generation,
    interface_builds,
    messages,
    occupancy,
    restoring,
    sourcing,
    starting,
    watching,
)
from tests.bench.figures import Case
from tests.bench.sitting import Sitting


@dataclass(frozen=True, slots=True)
class Scenario:
    """Something to measure: its heading, minutes on two quiet processors, what a reader must know."""

    title: str
    measure: Callable[[Sitting], Iterator[Case]]
    minutes: float
    notes: str = ""
    per: str = "packages"
    """What sizes count."""


SCENARIOS: Mapping[str, Scenario] = {
    "start-up": Scenario(
        "Start-up",
        starting.start_up,
        0.2,
        "colcon's `--help` loads all extensions and lists their options; forge's loads only its table of "
        "commands.",
    ),
    "list": Scenario(
        "List of packages",
        starting.listing,
        0.8,
        "Both tools read the same manifests and print the same lines.",
    ),
    "completion": Scenario(
        "Completion of a package name in bash",
        starting.completion,
        0.2,
        "A shell sources the script once; a key press costs the difference between the two variants. "
        "colcon starts Python for each key press and is not measured.",
    ),
    "no-op": Scenario(
        "Build with nothing changed",
        builds.no_op,
        8.0,
        "colcon starts the build tool and the install step of each package, which look for changes; "
        "forge compares the sources, the tools and the installed files with its records and starts no "
        "process. colcon is left out for 1,000 packages, which take it minutes.",
    ),
    "one-line": Scenario(
        "Build after a change of one line",
        builds.one_line,
        1.5,
        "Ninja alone compiles and links, but does not install.",
    ),
    "cold": Scenario(
        "Build from nothing",
        builds.cold,
        6.0,
        "Both tools use the same installed ament. forge lets CMake test the compilers once for all packages; "
        "under colcon, CMake tests them in each package. 'compilers alone' is ninja in each of forge's build "
        "folders after `ninja clean`: the lower bound for any build tool.",
    ),
    "cold-ccache": Scenario(
        "Build from nothing with a warm compiler cache",
        builds.warm_ccache,
        2.0,
        "Each tool has its own cache, filled by one build at the same path.",
    ),
    "cache-restore": Scenario(
        "Packages from forge's cache",
        restoring.restoring,
        2.5,
        "`forge build --cache` with an empty build folder and every package in a local cache, compared with "
        "the same build without a cache, and with `cp -r` of the files of one large package. colcon has no "
        "such cache.",
        per="",
    ),
    "shapes": Scenario(
        "Shapes of workspaces",
        builds.shapes,
        1.7,
        "A star, a chain and a typical graph with the same number of packages; in a chain, packages cannot "
        "be built in parallel.",
    ),
    "one-interface": Scenario(
        "Build after a change of one interface",
        interface_builds.one_interface,
        2.0,
        "With forge's generators, both tools run the same interface compiler. Debian's rosidl generates C "
        "and C++ and compiles introspection type support; forge also generates Python, and only "
        "headers for C and C++.",
    ),
    "large-interfaces": Scenario(
        "One message of a large interface package",
        interface_builds.large_interfaces,
        6.0,
        "A package with many messages, which refer to each other and to standard packages. CMake does not "
        "run again, and only the files of the changed message and of its users are generated and installed.",
        per="messages",
    ),
    "cold-interfaces": Scenario(
        "Interface packages from nothing",
        interface_builds.cold_interfaces,
        3.0,
        "As above; everything is built. With Debian's rosidl, both tools run the same generators: forge in "
        "one process, and it compiles their output in units.",
    ),
    "watch": Scenario(
        "From a save to the end of its build",
        watching.watching,
        0.6,
        "`forge build --watch` in a workspace of ten packages; colcon has no such mode.",
    ),
    "generation": Scenario(
        "Interface compiler",
        generation.generation,
        3.0,
        "On one processor, start-up included. Here rosidl converts to .idl and generates C and C++ in one "
        "Python process; its CMake code starts one for each step and package. forge also generates type "
        "hashes and serialization; rosidl's C has source files as well as headers.",
        per="messages",
    ),
    "compile-cost": Scenario(
        "Compiling generated headers",
        compile_cost.compile_cost,
        1.8,
        "Processor time of g++. rosidl's headers contain no serialization, which ROS keeps in type support "
        "libraries.",
    ),
    "python-cdr": Scenario(
        "Wire format in Python",
        cdr_python.python_cdr,
        0.4,
        "rosbags generates functions from the definitions at run time and returns dataclasses without "
        "checks; mcap-ros2-support interprets the definitions and returns plain namespaces. forge's classes "
        "check assignments. With lazy reading, large arrays stay views of the buffer; neither peer offers "
        "this, so that lazy reading is compared with their normal reading.",
    ),
    "cpp-cdr": Scenario(
        "Wire format in C++",
        cdr_cpp.cpp_cdr,
        0.8,
        "Fast-CDR is called as ROS's type support does: first the size, then each member, in functions that "
        "are not inlined because they are in libraries. It also supports other encodings, which forge's "
        "headers do not.",
    ),
    "import": Scenario(
        "Import of generated Python",
        messages.importing,
        0.6,
        "All figures include the import of numpy. rosbags creates all standard types at once.",
    ),
    "construction": Scenario(
        "Construction of messages in Python",
        messages.constructing,
        0.3,
        "The plain classes have one checking property per field, as code generators usually write them.",
    ),
    "numpy": Scenario(
        "Messages from numpy arrays",
        messages.from_numpy,
        0.4,
        "The array is a keyword of the constructor. The plain classes convert it as those of rosidl do: into "
        "an `array.array`, number by number, or into an array of numpy with a fixed size.",
    ),
    "sourcing": Scenario(
        "Sourcing a workspace",
        sourcing.sourcing,
        1.0,
        "The same installed packages, each in its own prefix. colcon's script starts Python, which prints "
        "the commands; forge writes its script when packages change.",
    ),
    "configure": Scenario(
        "CMake's configure with ament and without",
        configures.configuring,
        0.3,
        "The command line is the one that forge runs; the compilers have been tested before, as in all "
        "packages but the first.",
    ),
    "occupancy": Scenario(
        "Use of processors",
        occupancy.occupancy,
        1.5,
        "Packages that take long to compile. Measured until the last chain of dependencies, when fewer "
        "packages can be built than there are jobs.",
    ),
}
