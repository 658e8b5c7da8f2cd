"""Strategies that several tests share."""

from hypothesis import strategies as st

NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)


@st.composite
def graphs(draw: st.DrawFn, *, acyclic: bool = True) -> dict[str, frozenset[str]]:
    """Draw name -> needs; in an acyclic graph a name needs only names that were drawn before it."""
    names = draw(st.lists(NAMES, unique=True, max_size=8))
    graph = {}
    for index, name in enumerate(names):
        pool = names[:index] if acyclic else names
        graph[name] = frozenset(draw(st.sets(st.sampled_from(pool)))) if pool else frozenset()
    return graph
