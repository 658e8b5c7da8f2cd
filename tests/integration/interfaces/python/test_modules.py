"""Imports of generated Python, in a new interpreter."""

import subprocess
import sys
from pathlib import Path

import forge
from forge.base.distributions import EMBEDDED
from tests.generated import generate_embedded, run_python

ROOT = Path(forge.__file__).parents[1]


def test_importing_a_package_loads_no_message_modules(probe: Path) -> None:
    code = "import probe.msg, sys; print([name for name in sys.modules if name.startswith('probe.msg.')])"
    assert run_python(probe, code) == "[]"


def test_a_module_without_fixed_arrays_needs_no_numpy(probe: Path) -> None:
    code = "from probe.msg import Loose; import sys; Loose(a_int8=[1]); print('numpy' in sys.modules)"
    assert run_python(probe, code) == "False"


def test_optimized_python_converts_values_without_checks(probe: Path) -> None:
    code = (
        "from probe.msg import Scalars, Fixed, Loose\n"
        "loose = Loose(); loose.a_int8 = [1]\n"
        "fixed = Fixed(); fixed.a_int8 = [1, 2, 3]\n"
        "kinds = type(loose.a_int8).__name__, type(fixed.a_int8).__name__\n"
        "print(Scalars(flag='x', a_int8=1000, other=1).flag, *kinds)"
    )
    assert run_python(probe, code, "-O") == "x array ndarray"


def test_optimized_python_keeps_fractions(probe: Path) -> None:
    code = (
        "from probe.msg import Fixed\nimport numpy\n"
        "fixed = Fixed(a_int8=[1, 2, 3])\n"
        "for value in [1.5] * 3, numpy.array([1.5] * 3), [300] * 3, numpy.array([300] * 3):\n"
        "    try:\n        fixed.a_int8 = value\n"
        "    except (TypeError, OverflowError) as error:\n        print(type(error).__name__, end=' ')\n"
        "print(fixed.a_int8)"
    )
    assert run_python(probe, code, "-O") == "TypeError TypeError OverflowError OverflowError [1 2 3]"


def test_optimized_python_converts_arrays_of_another_type_code(probe: Path) -> None:
    """Its bytes would be written as they are."""
    code = (
        "import array, forge_cdr; from probe.msg import Loose\n"
        "loose = Loose(); loose.a_uint8 = array.array('i', [1, 2])\n"
        "read = forge_cdr.deserialize(forge_cdr.serialize(loose), Loose)\n"
        "print(loose.a_uint8.typecode, read.a_uint8.tolist())"
    )
    assert run_python(probe, code, "-O") == "B [1, 2]"


def test_serializers_are_loaded_with_the_first_message(tmp_path: Path) -> None:
    generate_embedded(tmp_path)
    code = (
        "import sys, forge_cdr; from std_msgs.msg import String;"
        "loaded = lambda: sorted(name for name in sys.modules if name.endswith(('__cdr', 'described')));"
        "print(loaded()); forge_cdr.serialize(String()); print(loaded())"
    )
    assert run_python(tmp_path, code) == "[]\n['std_msgs.msg._string__cdr']"


def test_loaded_classes_work_in_a_new_interpreter_with_serializers() -> None:
    """Only forge is on the Python path."""
    script = (
        "from pathlib import Path; from forge.interfaces import load\n"
        f"types = load(Path({str(EMBEDDED / 'geometry_msgs')!r}))\n"
        "Pose = types['geometry_msgs/msg/PoseStamped']\n"
        "message = Pose(); message.header.frame_id = 'map'; message.pose.position.x = 1.5\n"
        "import forge_cdr, sys\n"
        "data = forge_cdr.serialize(message)\n"
        "assert forge_cdr.deserialize(data, Pose) == message\n"
        "assert f'{Pose.__module__}__cdr' in sys.modules, 'the generated serializers are used'\n"
        "print(len(data), 'geometry_msgs' in sys.modules)\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script],
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ran.stdout, ran.stderr) == ("76 False\n", "")
