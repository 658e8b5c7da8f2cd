from text_tools import HELLO


def test_hello():
    assert HELLO == "hello"
