"""Tests of one package run in parallel, each in a ROS domain of its own."""

import re
from contextlib import ExitStack
from pathlib import Path

import pytest

from forge.build.tasks import Step, StepKind
from forge.plugins.test_domains.domains import discovery, isolated
from tests.conftest import Forge, Tree
from tests.testable import PYTEST, UNITTEST, cmake_package, counted_results, python_package

pytestmark = pytest.mark.needs("cmake")

TEST = r"""set -e
mkdir "running_$ROS_DOMAIN_ID"  # fails if a test that runs has the same domain
echo "$1 $ROS_DOMAIN_ID $ROS_LOCALHOST_ONLY$ROS_AUTOMATIC_DISCOVERY_RANGE" >> domains
touch "started_$1"
for _ in $(seq 300); do
  test "$(ls started_* | wc -l)" -ge "$2" && break
  sleep 0.1
done
test "$(ls started_* | wc -l)" -ge "$2"
rmdir "running_$ROS_DOMAIN_ID"
"""


def package(tests: int, together: int, *more: str) -> dict[str, str]:
    """Return a package with tests that end when so many of them have begun."""
    lines = [
        f"add_test(NAME t{number} COMMAND sh ${{CMAKE_SOURCE_DIR}}/run.sh {number} {together})"
        for number in range(tests)
    ]
    return {**cmake_package("p", *lines, *more), "src/p/run.sh": TEST}


def domains(root: Path) -> dict[str, list[str]]:
    lines = (root / "build/p/domains").read_text(encoding="utf-8").splitlines()
    return {line.split()[0]: line.split()[1:] for line in lines}


def test_tests_of_a_package_run_together_within_the_job_limit(forge: Forge, built: Tree) -> None:
    own = 'set_tests_properties(t3 PROPERTIES ENVIRONMENT "ROS_DOMAIN_ID=77;X=1")'
    root = built(package(4, 2, own))
    ran = forge("test", "-j2", cwd=root)
    assert "4 tests, 0 errors, 0 failures, 0 skipped" in ran.out, ran.out
    found = domains(root)
    assert {found[name][1] for name in found} == {"1"}
    assert found["3"][0] == "77"
    assert all(1 <= int(found[name][0]) <= 100 for name in found)
    assert (root / "build/p/Testing/TAG").is_file()
    assert "4 tests, 0 errors" in counted_results(root / "build")


def test_sequential_tests_share_the_domain_of_their_package(forge: Forge, built: Tree) -> None:
    root = built(package(3, 1))
    for words in (("-j1",), ("-j2", "--test-jobs", "1"), ("-j2", "--ctest-args", "-j1")):
        (root / "build/p/domains").unlink(missing_ok=True)
        assert "3 tests, 0 errors, 0 failures" in forge("test", *words, cwd=root).out
        assert len({domain for domain, _ in domains(root).values()}) == 1


def test_a_domain_set_by_the_user_is_kept_and_tests_run_sequentially(forge: Forge, built: Tree) -> None:
    env = {"ROS_DOMAIN_ID": "42", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    root = built(package(3, 1))
    assert "3 tests, 0 errors, 0 failures" in forge("test", "-j2", cwd=root, env=env).out
    assert domains(root) == {str(number): ["42", "SUBNET"] for number in range(3)}


def test_ctest_sees_the_same_tests_as_without_forge(forge: Forge, built: Tree) -> None:
    tests = r"""
add_test(NAME quotes COMMAND sh -c "test \"\$1\" = 'a\;b\${c}\\'" sh "a\;b\${c}\\")
add_test(NAME lines COMMAND sh -c "
test -z '' " "")
add_test(NAME fails COMMAND sh -c "exit 3")
set_tests_properties(fails PROPERTIES WILL_FAIL TRUE LABELS "a;b" RESOURCE_LOCK lock)
add_subdirectory(sub)
"""
    sub = 'add_test(NAME below COMMAND sh -c "test $(basename $PWD) = sub")\n'
    root = built({**cmake_package("p", tests), "src/p/sub/CMakeLists.txt": sub})
    results = []
    for words in (("--test-jobs", "1"), ()):
        assert "4 tests, 0 errors, 0 failures" in forge("test", "-j2", *words, cwd=root).out
        (result,) = (root / "build/p/Testing").glob("*/Test.xml")
        text = result.read_text(encoding="utf-8")
        results.append(sorted(re.findall(r"<(?:Path|FullName|FullCommandLine)>[^<]*<", text)))
    assert results[0] == results[1]


@pytest.mark.parametrize("pytest_", [True, False])
def test_python_tests_run_in_one_domain(forge: Forge, built: Tree, pytest_: bool) -> None:
    text = (PYTEST if pytest_ else UNITTEST).replace("import p\n", "import p\n")
    note = "import os\nopen('domain', 'w').write(os.environ['ROS_DOMAIN_ID'])\n"
    root = built(python_package("p", note + text.format(name="p"), pytest=pytest_))
    assert "failure" in forge("test", cwd=root).out
    assert 1 <= int((root / "src/p/domain").read_text(encoding="utf-8")) <= 100


def test_concurrent_steps_on_a_host_have_distinct_domains() -> None:
    step = Step(StepKind.PYTEST, ("pytest",), Path())
    several = Step(StepKind.CTEST, ("ctest",), Path(), tests_at_once=9)
    level = {"CTEST_PARALLEL_LEVEL": "2"}
    with isolated(step, {}) as one, isolated(several, level) as many, isolated(step, {}) as last:
        taken = [one["ROS_DOMAIN_ID"], *many["FORGE_TEST_DOMAINS"].split(";"), last["ROS_DOMAIN_ID"]]
        assert len(taken) == len(set(taken)) == 10
    with isolated(step, {}) as again:
        assert again["ROS_DOMAIN_ID"] == one["ROS_DOMAIN_ID"]


def test_a_package_takes_no_more_domains_than_tests_also_after_waiting() -> None:
    few = Step(StepKind.CTEST, ("ctest",), Path(), tests_at_once=3, tests=3)
    many = Step(StepKind.CTEST, ("ctest",), Path(), tests_at_once=100)
    level = {"CTEST_PARALLEL_LEVEL": "30"}
    held = ExitStack()

    def release() -> bool:
        held.close()
        return False

    with held:
        while "ROS_DOMAIN_ID" in held.enter_context(isolated(many, level, lambda: True)):
            pass  # until all are taken
        with isolated(few, level, release) as environment:
            assert len(environment["FORGE_TEST_DOMAINS"].split(";")) == 3


def test_a_test_waits_for_a_domain_if_all_are_taken() -> None:
    many = Step(StepKind.CTEST, ("ctest",), Path(), tests_at_once=100)
    asked = []

    def is_stopped() -> bool:
        asked.append(1)
        return len(asked) > 3

    with ExitStack() as held:
        first = held.enter_context(isolated(many, {"CTEST_PARALLEL_LEVEL": "25"}))
        assert len(first["FORGE_TEST_DOMAINS"].split(";")) > 90
        while "ROS_DOMAIN_ID" in held.enter_context(isolated(many, {}, is_stopped)):
            asked.clear()  # another test on this machine has just released its domain
        assert len(asked) > 3


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({}, {"ROS_LOCALHOST_ONLY": "1"}),
        ({"ROS_DISTRO": "foxy"}, {"ROS_LOCALHOST_ONLY": "1"}),
        ({"ROS_DISTRO": "humble"}, {"ROS_LOCALHOST_ONLY": "1"}),
        ({"ROS_DISTRO": "iron"}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}),
        ({"ROS_DISTRO": "rolling"}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}),
        ({"ROS_DISTRO": "jazzy", "ROS_LOCALHOST_ONLY": "0"}, {}),
        ({"DISABLE_ROS_ISOLATION": "1"}, {}),
    ],
)
def test_discovery_is_limited_to_this_host_unless_a_variable_is_set(
    variables: dict[str, str], expected: dict[str, str]
) -> None:
    assert discovery(variables) == expected
