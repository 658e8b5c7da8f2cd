"""generate HTML documentation of the interfaces of the workspace"""

from __future__ import annotations

from pathlib import Path

from forge.base.frozen import frozen
from forge.base.layout import INTERFACE_PAGES_DIR
from forge.base.options import flag, option, options_of
from forge.cli.commands.interface.inputs import IncludeOptions
from forge.cli.options import profile_option

_OUTPUT = Path("build") / INTERFACE_PAGES_DIR


@frozen
class Options:
    EPILOG = "Types that the interfaces refer to are documented, too, so that all links work."
    packages: tuple[str, ...] = option(
        "document only these packages, which may be outside of the workspace",
        default=(),
        positional=True,
        metavar="PKG",
    )
    output: Path | None = option(f"output folder (default: {_OUTPUT})", parse=Path, short="-o", metavar="DIR")
    underlays: bool = flag("also document all interfaces in sourced prefixes")
    embedded: bool = flag("also document all interfaces embedded in forge")
    title: str = option("title of the site (default: %(default)s)", default="Interfaces", metavar="TEXT")
    others: IncludeOptions = options_of(IncludeOptions)
    profile: str | None = profile_option()


def run(options: Options) -> int:
    from forge.plugins.interface_pages.documenting import make_site

    return make_site(options, _OUTPUT)
