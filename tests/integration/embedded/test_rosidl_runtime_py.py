"""Messages as dictionaries, YAML and CSV, and fields from dictionaries."""

import sys
from pathlib import Path

from tests.generated import run_python


def test_missing_pyyaml_is_reported_with_a_remedy(probe: Path) -> None:
    code = (
        "import sys; sys.modules['yaml'] = None\n"
        "from probe.msg import Point; import rosidl_runtime_py\n"
        "try: rosidl_runtime_py.message_to_yaml(Point())\n"
        "except ImportError as error: print(error)"
    )
    assert (
        run_python(probe, code) == f"messages as YAML need PyYAML: '{sys.executable} -m pip install PyYAML'"
    )
