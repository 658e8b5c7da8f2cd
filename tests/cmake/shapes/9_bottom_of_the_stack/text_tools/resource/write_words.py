"""Write the header that the library is compiled with."""

import sys
from pathlib import Path

HEADER = """\
#ifndef TEXT_TOOLS__WORDS_H_
#define TEXT_TOOLS__WORDS_H_

#define TEXT_TOOLS_HELLO "hello"

#endif  // TEXT_TOOLS__WORDS_H_
"""

Path(sys.argv[1]).write_text(HEADER, encoding="utf-8")
