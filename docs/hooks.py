"""What the site shows besides the folder docs: the figures of validation/.

A page names them as they lie in the repository, ``../validation/<case>/figure.png``. There is nothing above the
site, so there they are beside its pages.
"""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]


def on_files(files: Files, config: Any) -> Files:
    """Add validation/<case>/figure*.png to the files of the site."""
    for figure in sorted((ROOT / "validation").glob("*/figure*.png")):
        files.append(File.generated(config, figure.relative_to(ROOT).as_posix(), abs_src_path=str(figure)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Name the figures of validation/ where the site has them."""
    return markdown.replace("](../validation/", "](validation/")
