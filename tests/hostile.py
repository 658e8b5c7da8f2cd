"""Texts that mean something to one of the languages forge writes, and what becomes of them."""

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

CANARY = "sprung_canary"
"""A file that appears where the tests run if any of the texts is carried out."""

FRAGMENTS = (
    *(
        "*/",
        "/*",
        "//",
        '"""',
        "'''",
        '"',
        "'",
        "\\",
        "\\\\",
        "\\n",
        "\\u000a",
        "\\x0a",
        "\\N{DASH}",
        "\\012",
    ),
    *(
        "\n",
        "\r",
        "\r\n",
        "\t",
        "\x0b",
        "\x0c",
        "\x1b[31m",
        "\0",
        "\x7f",
        "\x85",
        "\u2028",
        "\u2029",
        "\ufeff",
    ),
    *("\u202e", "\u202d", "\u2066", "\u2067", "\u2068", "\u2069", "\u200e", "\u200f", "\u061c", "\U0001f600"),
    *(
        f"$(touch {CANARY})",
        f"`touch {CANARY}`",
        f"; touch {CANARY};",
        f"\ntouch {CANARY}\n",
        f"(touch {CANARY})",
    ),
    *(
        "$",
        "${PATH}",
        "$ENV{PATH}",
        "$<1:x>",
        "@PATH@",
        "%",
        "%s",
        "%(x)s",
        "{x}",
        "{{ x }}",
        "{% x %}",
        "!",
        "!!",
    ),
    *(
        f'")\nexecute_process(COMMAND touch {CANARY})\nset(x "',
        "#]]",
        "]==]",
        "[[",
        "#[[",
        ";",
        "a;b",
        "\\;",
        "#",
    ),
    *("??/", "??/\n", "??)", "??=include", "\\\n", "\\ \n", "#include </etc/passwd>", 'R"(', ')"', 'u8"x"'),
    *("-->", "<!--", "</script>", "<script>", "<img src=x>", "]]>", "<![CDATA[", "&lt;", "&", "<", ">", "'>"),
    *(
        "|",
        "| a |",
        "[a](b)",
        "![a](b)",
        "**",
        "_",
        "---",
        "# a",
        "- a",
        "1. a",
        "\u201c",
        "\u201d",
        "\u201e",
    ),
    *(
        f'"; import os; os.system("touch {CANARY}") #',
        f"*/ int {CANARY}; /*",
        f"\n#error {CANARY}\n",
        "/",
        "..",
        "~",
    ),
)
"""What has ended a comment, a literal, a line or a field somewhere."""

_TEXT = st.lists(st.one_of(st.sampled_from(FRAGMENTS), st.text(max_size=4)), min_size=1, max_size=6).map(
    "".join
)


def hostile(*without: str) -> SearchStrategy[str]:
    """Draw texts without some signs and without halves of characters."""
    unwanted = str.maketrans(dict.fromkeys(without, " "))
    return _TEXT.map(lambda text: text.translate(unwanted).encode(errors="replace").decode())
