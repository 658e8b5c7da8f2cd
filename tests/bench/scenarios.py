"""All that is measured: a table of scenarios, in the order of the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

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
        "colcon's `--help` loads all of its extensions and lists their options; forge's loads its "
        "table of commands.",
    ),
    "list": Scenario(
        "List of packages",
        starting.listing,
        0.8,
        "Both read the same manifests and print the same lines.",
    ),
    "completion": Scenario(
        "Completion of a package's name in bash",
        starting.completion,
        0.2,
        "Sourcing the script happens once in life; what a press of the key costs is the difference. "
        "colcon completes by a Python of its own for each press and is not measured.",
    ),
    "no-op": Scenario(
        "Build with nothing changed",
        builds.no_op,
        8.0,
        "colcon starts each package's build tool and install step, which look for changes themselves; "
        "forge compares what it knows of all sources, of the tools and of what is installed, and "
        "starts nothing. Of 1,000 packages colcon's build would take minutes: left out.",
    ),
    "one-line": Scenario(
        "Build after a change of one line",
        builds.one_line,
        1.5,
        "Ninja alone compiles and links and does not install.",
    ),
    "cold": Scenario(
        "Build from nothing",
        builds.cold,
        6.0,
        "Both build on the same installed ament. forge examines the compilers once for all packages, "
        "colcon's CMake in each. 'compilers alone' is ninja in each of forge's build folders after "
        "`ninja clean`: what no build tool can save.",
    ),
    "cold-ccache": Scenario(
        "Build from nothing with a warm compiler cache",
        builds.warm_ccache,
        2.0,
        "Each tool has a cache of its own, filled by one build at the same place.",
    ),
    "cache-restore": Scenario(
        "Packages from forge's cache",
        restoring.restoring,
        2.5,
        "`forge build --cache` where nothing is built and everything is in a local cache, beside the same "
        "build without a cache, and beside `cp -r` of one large package's files. colcon has no such cache.",
        per="",
    ),
    "shapes": Scenario(
        "Shapes of workspaces",
        builds.shapes,
        1.7,
        "A star, a chain, and one as people have them, of as many packages; in a chain nothing can "
        "run side by side.",
    ),
    "one-interface": Scenario(
        "Build after a change of one interface",
        interface_builds.one_interface,
        2.0,
        "With forge's generators both tools run the same compiler of interfaces. Debian's rosidl "
        "writes C and C++ and compiles type support for introspection; forge's own writes Python, "
        "too, and headers only.",
    ),
    "cold-interfaces": Scenario(
        "Packages of interfaces from nothing",
        interface_builds.cold_interfaces,
        3.0,
        "As above.",
    ),
    "watch": Scenario(
        "From a save to the end of its build",
        watching.watching,
        0.6,
        "Under `forge build --watch`, in a workspace of ten packages; colcon has nothing of the kind.",
    ),
    "generation": Scenario(
        "Compiler of interfaces",
        generation.generation,
        3.0,
        "On one processor, start included. rosidl converts to .idl and writes C and C++ in one Python "
        "process here; its CMake code starts one for each step and package. forge writes type hashes "
        "and ROS's wire format in addition, rosidl's C has sources and not only headers.",
        per="messages",
    ),
    "compile-cost": Scenario(
        "Compiling generated headers",
        compile_cost.compile_cost,
        1.8,
        "Processor time of g++. rosidl's headers have no wire format, which ROS keeps in libraries of "
        "type support.",
    ),
    "python-cdr": Scenario(
        "Wire format in Python",
        cdr_python.python_cdr,
        0.4,
        "rosbags makes its functions from the definitions at run time and gives dataclasses, without "
        "checks; mcap-ros2-support interprets them and gives plain namespaces. forge's classes check "
        "what is assigned. Read lazily, large arrays stay views of the bytes, which neither peer "
        "offers: their time is that of reading.",
    ),
    "cpp-cdr": Scenario(
        "Wire format in C++",
        cdr_cpp.cpp_cdr,
        0.8,
        "Fast-CDR is called as ROS's type support calls it: first the size, then member by member, in "
        "functions that are not inlined, as they lie in libraries. It also knows other encodings, "
        "which forge's headers do not.",
    ),
    "import": Scenario(
        "Import of generated Python",
        messages.importing,
        0.6,
        "numpy's own import is part of all figures. rosbags makes all standard types at once.",
    ),
    "construction": Scenario(
        "Construction of messages in Python",
        messages.constructing,
        0.3,
        "The plain classes are ours: a property with a check for each field, as generators of code "
        "usually write them.",
    ),
    "sourcing": Scenario(
        "Sourcing a workspace",
        sourcing.sourcing,
        1.0,
        "The same installed packages, each in its own prefix. colcon starts a Python that writes the "
        "commands; forge's script is written when packages change.",
    ),
    "configure": Scenario(
        "CMake's configure with ament and without",
        configures.configuring,
        0.3,
        "Each command is the one that forge runs; compilers are known already, as in all packages but "
        "the first.",
    ),
    "occupancy": Scenario(
        "Use of processors",
        occupancy.occupancy,
        1.5,
        "Packages that take long to compile; measured until the last chain, when fewer can run than "
        "there are jobs.",
    ),
}
