"""Every target that forge has set itself, issue by issue, and how its value is found."""

from tests.bench import occupancy
from tests.bench.builds import COMPILERS
from tests.bench.cdr_cpp import FAST_CDR
from tests.bench.commands import COLCON
from tests.bench.generation import ROSIDL
from tests.bench.interface_builds import FROM_NOTHING
from tests.bench.messages import NUMPY, PLAIN
from tests.bench.reading import (
    Question,
    beyond,
    counted,
    exponent,
    least_times,
    mean_times,
    most_beyond,
    part_of,
    time_of,
    times_beyond,
    times_of,
    times_without,
)
from tests.bench.restoring import BUILDING, COPYING, START
from tests.bench.sourcing import EMPTY
from tests.bench.targets import ByHand, Target

_LARGE = ("PointCloud2 1 MB", "Image 1 MB")
_SMALL = ("String of 15", "String, varied", "Imu", "PoseStamped")
_GENERATED = "Python and C++, from nothing"


ROWS: dict[int, tuple[tuple[str, str, Question | ByHand], ...]] = {
    2: (
        ("`forge --help` answers", "<= 100 ms", time_of("start-up", "--help")),
        ("`forge list` of 100 packages", "<= 150 ms", time_of("list", "list", 100)),
    ),
    3: (
        (
            "250 messages to Python and C++ on one processor",
            "<= 2000 ms",
            time_of("generation", _GENERATED, 250),
        ),
        (
            "linear up to 5,000 messages: exponent of growth from 250",
            "<= 1.10",
            exponent("generation", _GENERATED, 250),
        ),
        (
            "one of 250 files changed",
            "<= 300 ms",
            time_of("generation", "Python and C++, one file changed", 250),
        ),
        (
            "which writes only that type's files",
            "<= 7 files",
            counted("generation", "Python and C++, one file changed", "files written", 250),
        ),
        (
            "Python writes, geometric mean, beside rosbags",
            ">= 4.00 times",
            mean_times("python-cdr", "write, ", "rosbags"),
        ),
        ("Python reads", ">= 2.40 times", mean_times("python-cdr", "read, ", "rosbags")),
        ("Python reads lazily", ">= 4.50 times", mean_times("python-cdr", "read lazily, ", "rosbags")),
        (
            "messages are constructed, geometric mean, beside plain classes that check",
            ">= 3.00 times",
            mean_times("construction", "", PLAIN),
        ),
        (
            "C++ writes small messages, the slowest case, beside Fast-CDR",
            ">= 8.0 times",
            least_times("cpp-cdr", FAST_CDR, "write, ", _SMALL),
        ),
        ("C++ writes a Path of 100", ">= 10.0 times", times_of("cpp-cdr", "write, Path of 100", FAST_CDR)),
        (
            "C++ reads into a message that was used, the slowest case",
            ">= 3.0 times",
            least_times("cpp-cdr", FAST_CDR, "read, used, ", but=_LARGE),
        ),
        (
            "C++ reads into a new message, the slowest case",
            ">= 3.0 times",
            least_times("cpp-cdr", FAST_CDR, "read, fresh, ", but=_LARGE),
        ),
        ("C++ handles 1 MB, the slowest case", ">= 1.0 times", least_times("cpp-cdr", FAST_CDR, "", _LARGE)),
        (
            "compiling 92 headers, beside rosidl's",
            "<= 0.35 of its time",
            part_of("compile-cost", "all headers, included", ROSIDL),
        ),
        (
            "`import sensor_msgs.msg`, all of its types, beyond numpy's own",
            "<= 30.0 ms",
            beyond("import", "all of sensor_msgs", NUMPY),
        ),
        (
            "spoilt buffers that neither reader crashes over",
            ">= 1000000 each",
            ByHand(
                "1,000,000 in Python, 1,000,000 in C++ with sanitizers",
                met=True,
                date="2026-11",
                how="`make fuzz`",
            ),
        ),
        (
            "snippets of real user code that compile and run",
            ">= 10",
            ByHand("18 in Python, 15 in C++", met=True, date="2026-11", how="`tests/e2e/test_user_code.py`"),
        ),
    ),
    4: (
        ("nothing changed in 100 packages of 20 files", "<= 150 ms", time_of("no-op", "plain CMake", 100)),
        ("the same, beside colcon", ">= 25.0 times", times_of("no-op", "plain CMake", COLCON, 100)),
        (
            "nothing changed in 100 packages on a real ament, beside colcon",
            ">= 100.0 times",
            times_of("no-op", "ament_cmake, Debian's", COLCON, 100),
        ),
        ("nothing changed in 1,000 packages", "<= 800 ms", time_of("no-op", "plain CMake", 1000)),
        (
            "one changed .cpp in a leaf of 100 packages, beyond ninja alone",
            "<= 300 ms",
            beyond("one-line", "one .cpp of a leaf", "ninja alone", 100),
        ),
        (
            "100 small `ament_cmake` packages from nothing, beside colcon",
            ">= 2.00 times",
            times_of("cold", "ament_cmake", COLCON, 100),
        ),
        (
            "the same without what the compilers take alone",
            ">= 4.00 times",
            times_beyond("cold", "ament_cmake", COLCON, COMPILERS, 100),
        ),
        ("`forge list` of 1,000 packages", "<= 400 ms", time_of("list", "list", 1000)),
        (
            "processors in use until the last chain, Ninja",
            ">= 90.0 %",
            time_of("occupancy", f"{occupancy.IN_USE}, Ninja"),
        ),
        (
            "processors in use until the last chain, Makefiles",
            ">= 90.0 %",
            time_of("occupancy", f"{occupancy.IN_USE}, Makefiles"),
        ),
        (
            "compilers at a time with two jobs",
            "<= 2",
            counted("occupancy", f"{occupancy.IN_USE}, Ninja", occupancy.MOST),
        ),
        (
            "interrupts at random, after which a plain build ends as a clean one",
            ">= 50",
            ByHand("52, isolated and merged", met=True, date="2026-11", how="`make soak`"),
        ),
    ),
    5: (
        (
            "completion of a package's name among 300",
            "<= 100 ms",
            beyond("completion", "a package's name", "the script alone", 300),
        ),
    ),
    6: (
        (
            "configuring a package with ament, beyond one without, the slowest",
            "<= 60.0 ms",
            most_beyond("configure", "plain"),
        ),
    ),
    7: (
        (
            "sourcing 500 packages, beyond an empty shell, the slowest shell",
            "<= 25.0 ms",
            most_beyond("sourcing", EMPTY, 500),
        ),
    ),
    8: (
        (
            "ROS 2 from source, 140 packages, from nothing, beside colcon",
            ">= 1.25 times",
            ByHand("2.02", met=True, date="2026-11-24", how="[by hand](ros2-from-source.md)"),
        ),
        (
            "ROS 2 from source, nothing changed, beside colcon",
            ">= 60 times",
            ByHand("76 to 104", met=True, date="2026-11-22", how="[by hand](ros2-from-source.md)"),
        ),
    ),
    9: (
        (
            "a save of a Python file under `--watch`, of that package",
            "<= 500 ms",
            time_of("watch", "a Python module", 10),
        ),
        (
            "a save of a message under `--watch`, of that package",
            "<= 500 ms",
            time_of("watch", "a message", 10),
        ),
        (
            "typical mistakes whose message leads to the remedy",
            ">= 10",
            ByHand("more than 50", met=True, date="2026-11", how="`tests/e2e/test_mistakes.py` and others"),
        ),
    ),
    10: (
        (
            "kills at random, after which a plain build ends as a clean one",
            ">= 200",
            ByHand("280 rounds", met=True, date="2026-11-22", how="[by hand](explanation/trust.md)"),
        ),
        (
            "packages listed, ordered, and built again with nothing to do",
            ">= 5000",
            ByHand("5,000: 3.4 s, 91 MB", met=True, date="2026-11-22", how="`make scale`"),
        ),
        (
            "packages in a chain of dependencies",
            ">= 3000",
            ByHand("3,000: built in 56 s, 84 MB", met=True, date="2026-11-22", how="`make scale`"),
        ),
        (
            "interfaces in one workspace",
            ">= 20000",
            ByHand("20,000: 49 s, 143 MB", met=True, date="2026-11-22", how="`make scale`"),
        ),
    ),
    11: (
        (
            "100 compiled packages from the local cache, beside building them",
            ">= 20.0 times",
            times_of("cache-restore", "compiled packages", BUILDING, 100),
        ),
        (
            "the same, start-up excluded",
            ">= 20.0 times",
            times_beyond("cache-restore", "compiled packages", BUILDING, START, 100),
        ),
        (
            "20,000 files from the local cache, start-up excluded, beside `cp -r`",
            "<= 2.00 times",
            times_without("cache-restore", "files of one package", COPYING, START, 20_000),
        ),
    ),
    36: (
        (
            "a comment in one of 1,200 messages, beside a build from nothing",
            "<= 0.15 of its time",
            part_of("large-interfaces", "one comment", FROM_NOTHING, 1200),
        ),
        (
            "a field in one of 1,200 messages",
            "<= 0.35 of its time",
            part_of("large-interfaces", "one field", FROM_NOTHING, 1200),
        ),
        (
            "linear up to 1,200 messages: exponent of growth from 300",
            "<= 1.10",
            exponent("large-interfaces", "one field", 300),
        ),
    ),
}
"""By issue: what is measured, the limit with as many digits as count, and where its value comes from."""

TARGETS = tuple(Target(issue, *row) for issue, rows in ROWS.items() for row in rows)
