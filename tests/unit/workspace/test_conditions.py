"""Conditions of manifests."""

import pytest

from forge.workspace.manifest import ConditionError, holds

VARIABLES = {"ROS_VERSION": "2", "ROS_DISTRO": "humble"}


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("$ROS_VERSION == 2", True),
        ("$ROS_VERSION == 1", False),
        ("2 < 10", False),
        ('$ROS_DISTRO != "foxy"', True),
        ("'$ROS_DISTRO' == humble", False),
        ("$MISSING == 1 or $ROS_VERSION >= 2 and $ROS_DISTRO == humble", True),
        ("($MISSING == 1 or $ROS_VERSION >= 2) and $ROS_DISTRO == foxy", False),
        ("and == and", True),
        ("  a   <=b ", True),
    ],
)
def test_conditions_compare_strings_and_evaluate_and_before_or(condition: str, expected: bool) -> None:
    assert holds(condition, VARIABLES) is expected


@pytest.mark.parametrize(
    ("condition", "column"),
    [
        ("$ROS_VERSION", 13),
        ("$ROS_VERSION = 2", 14),
        ("${ROS_VERSION} == 2", 1),
        ("not 1 == 1", 5),
        ("a == b c", 8),
        ("(a == b", 8),
        ("", 1),
        ("1.0 == 1", 2),
        ("(" * 60 + "a == b" + ")" * 60, 51),
    ],
)
def test_an_invalid_condition_is_rejected_with_its_column(condition: str, column: int) -> None:
    with pytest.raises(ConditionError) as error:
        holds(condition, VARIABLES)
    assert error.value.column == column
