"""Reserve ROS domains for test steps, and limit the discovery of ROS nodes to this host."""

from __future__ import annotations

import contextlib
import errno
import socket
import time
from collections.abc import Callable, Iterator, Mapping

from forge.base.distributions import VARIABLE as ROS_DISTRO
from forge.build.tasks import TEST_STEPS, Step
from forge.execution.job_pool import PARALLEL_TESTS

DOMAIN = "ROS_DOMAIN_ID"
DISABLED = "DISABLE_ROS_ISOLATION"
"""A variable of ament's isolated tests, which also disables this isolation."""
DOMAINS_VARIABLE = "FORGE_TEST_DOMAINS"
"""The domains for the tests of a package, for templates/testing/isolated_tests.cmake.j2."""
LAST_DOMAIN = 100
"""Linux assigns the ports of higher domains to arbitrary programs. 0 is the domain of the user's nodes."""
_LOCKS = (("", 32768), ("127.0.0.1", 22119))
"""A domain is taken as long as these TCP ports plus its number are bound.

The first is also used by ament's package domain_coordinator, the second by forge's
`ament_add_ros_isolated_...`, so that their tests get other domains. Ports belong to a network namespace, as
domains do, and a killed process leaves none locked.
"""
_SECONDS = 0.1
_DOMAINS_PER_JOB = 4
"""With more domains than jobs, a test rarely waits for another one with the same domain."""
_LAST_WITH_LOCALHOST_ONLY = "humble"


def discovery(variables: Mapping[str, str]) -> dict[str, str]:
    """Return the variable that limits ROS 2 to this host, unless the environment already sets one."""
    if DISABLED in variables or not {_OLD_DISCOVERY, _DISCOVERY}.isdisjoint(variables):
        return {}
    # Distributions are ordered alphabetically.
    if (variables.get(ROS_DISTRO) or _LAST_WITH_LOCALHOST_ONLY) <= _LAST_WITH_LOCALHOST_ONLY:
        return {_OLD_DISCOVERY: "1"}
    return {_DISCOVERY: "LOCALHOST"}


_OLD_DISCOVERY, _DISCOVERY = "ROS_LOCALHOST_ONLY", "ROS_AUTOMATIC_DISCOVERY_RANGE"


def is_isolated(variables: Mapping[str, str]) -> bool:
    """Return whether tests get separate domains: not if the environment names one."""
    return DOMAIN not in variables and DISABLED not in variables


@contextlib.contextmanager
def isolated(
    step: Step, variables: Mapping[str, str], is_stopped: Callable[[], bool] = lambda: False
) -> Iterator[Mapping[str, str]]:
    """Yield the environment of a test step with the domains that it holds until it ends."""
    if step.kind not in TEST_STEPS or not is_isolated(variables):
        yield variables
        return
    level = variables.get(PARALLEL_TESTS, "") if step.tests_at_once else ""
    jobs = int(level) if level.isdecimal() else 1
    # The domains that a package does not need are for others, which wait if none is left.
    wanted = 1 if jobs == 1 else min(jobs * _DOMAINS_PER_JOB, step.tests or LAST_DOMAIN)
    with contextlib.ExitStack() as stack:
        domains = list(_reserve(stack, wanted))
        while not domains and not is_stopped() and _can_bind():
            time.sleep(_SECONDS)
            domains = list(_reserve(stack, wanted))
        environment = dict(variables)
        if domains:
            environment[DOMAIN] = str(domains[0])
        if step.tests_at_once:
            environment[PARALLEL_TESTS] = str(min(jobs, max(1, len(domains))))
            environment[DOMAINS_VARIABLE] = ";".join(map(str, domains))
        yield environment


def _reserve(stack: contextlib.ExitStack, count: int) -> Iterator[int]:
    """Yield up to `count` free domains, taken until the stack is closed."""
    for domain in range(1, LAST_DOMAIN + 1):
        if count <= 0:
            return
        with contextlib.ExitStack() as taken, contextlib.suppress(OSError):
            for host, first_port in _LOCKS:
                lock = taken.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
                lock.bind((host, first_port + domain))
            stack.enter_context(taken.pop_all())
            count -= 1
            yield domain


def _can_bind() -> bool:
    """Return whether no domain is free because others hold them, rather than for lack of a network."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as lock:
            lock.bind((_LOCKS[0][0], _LOCKS[0][1] + 1))
    except OSError as error:
        return error.errno == errno.EADDRINUSE
    return True
