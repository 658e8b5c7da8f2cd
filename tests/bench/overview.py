"""What the page opens with: the few cases that a user cares about, as three charts and a table."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from tests.bench.cdr_cpp import FAST_CDR
from tests.bench.commands import COLCON
from tests.bench.figures import SUBJECT, Case, Results
from tests.bench.generation import ROSIDL
from tests.bench.restoring import BUILDING

_NINJA = f"{COLCON}, Ninja"
_WITH_ROSIDL = f"{COLCON} with rosidl"


@dataclass(frozen=True, slots=True)
class Task:
    """Something that users do: a case of a scenario, and the tools beside forge, the usual one first."""

    words: str
    scenario: str
    case: str
    size: int | None
    others: tuple[str, ...]


CHARTS: Mapping[str, tuple[str, tuple[Task, ...]]] = {
    "overview-builds": (
        "Building 100 packages",
        (
            Task("nothing changed", "no-op", "ament_cmake, embedded", 100, (COLCON, _NINJA)),
            Task("one line changed", "one-line", "one .cpp of a leaf", 100, (COLCON, _NINJA)),
            Task("clean", "cold", "ament_cmake", 100, (COLCON, _NINJA)),
        ),
    ),
    "overview-interfaces": (
        "Building interfaces",
        (
            Task(
                "one of 20 messages changed",
                "one-interface",
                "one .msg of 20, rosidl's",
                None,
                (_WITH_ROSIDL, "forge with rosidl"),
            ),
            Task(
                "20 messages, clean",
                "cold-interfaces",
                "a package of 20 messages, rosidl's",
                None,
                (_WITH_ROSIDL, "forge with rosidl"),
            ),
            Task("code for 250 messages", "generation", "C and C++, from nothing", 250, (ROSIDL,)),
        ),
    ),
    "overview-workspace": (
        "Working with a workspace",
        (
            Task("list 100 packages", "list", "list", 100, (COLCON,)),
            Task("source 500 packages in bash", "sourcing", "bash", 500, (COLCON,)),
            Task("100 packages from the cache", "cache-restore", "compiled packages", 100, (BUILDING,)),
        ),
    ),
}
"""By the name of the picture: its title and its tasks."""

_MORE = (
    Task("15 Python packages, nothing changed", "no-op", "ament_python", 15, (COLCON,)),
    Task("import all of `sensor_msgs`", "import", "all of sensor_msgs", None, ("rosbags",)),
    Task("serialize an `Imu` in Python", "python-cdr", "write, Imu", None, ("rosbags",)),
    Task("serialize a `PoseStamped` in C++", "cpp-cdr", "write, PoseStamped", None, (FAST_CDR,)),
)
"""Tasks for the table only."""


def tasks(name: str, results: Results) -> Iterator[tuple[Task, Case]]:
    """Yield the tasks of a chart that were measured, each with its case."""
    yield from _measured(CHARTS[name][1], results)


def table(results: Results) -> Iterator[tuple[str, Task, Case, str]]:
    """Yield the rows of the table: what it is about, the task, its case, the usual tool beside forge."""
    for title, chosen in (*CHARTS.values(), ("", _MORE)):
        for task, case in _measured(chosen, results):
            if task.others[0] in case.series:
                yield title, task, case, task.others[0]


def _measured(chosen: tuple[Task, ...], results: Results) -> Iterator[tuple[Task, Case]]:
    for task in chosen:
        case = results.case(task.scenario, task.case, task.size)
        if case and SUBJECT in case.series:
            yield task, case
