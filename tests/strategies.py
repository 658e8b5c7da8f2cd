"""Hypothesis strategies for several tests."""

from hypothesis import strategies as st

NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)


@st.composite
def graphs(draw: st.DrawFn, *, acyclic: bool = True) -> dict[str, frozenset[str]]:
    """Draw a graph that maps each name to the names it needs."""
    names = draw(st.lists(NAMES, unique=True, max_size=8))
    graph = {}
    for index, name in enumerate(names):
        pool = names[:index] if acyclic else names
        graph[name] = frozenset(draw(st.sets(st.sampled_from(pool)))) if pool else frozenset()
    return graph
