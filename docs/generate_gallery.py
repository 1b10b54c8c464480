"""Write docs/gallery.md from the results that validation/ holds.

    python docs/generate_gallery.py           write the page
    python docs/generate_gallery.py --check   fail if it is not what would be written

Needs nothing but the clone. The figures stay where they are: docs/hooks.py shows them to the site.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
VALIDATION = DOCS.parent / "validation"

INTRODUCTION = """\
<!-- Written by docs/generate_gallery.py from validation/: run the check scripts instead of changing it. -->

# Validated cases

What Spume was compared with, what was to be reached and what was reached, as the check scripts of the repository wrote
it down. A missed bar is printed as missed; `validation/README.md` of the repository says what limits it. No case has
settings of its own. Every command runs in a clone, from its root."""


def page() -> str:
    """Return the text of the page."""
    folders = [folder for folder in sorted(VALIDATION.iterdir()) if folder.is_dir() and records(folder)]
    counts = [bar["holds"] for folder in folders for record in records(folder) for bar in record["bars"]]
    parts = [INTRODUCTION, f"{sum(counts)} of {len(counts)} bars hold."]
    for folder in folders:
        parts += section(folder)
    return "\n\n".join(part for part in parts if part) + "\n"


def records(folder: Path) -> list[dict[str, Any]]:
    """Return what the check script of a folder wrote, if it wrote bars."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("results*.json"))]
    return [record for record in found if record.get("bars")]


def section(folder: Path) -> list[str]:
    """Return title, description, figures, tables and command of a case."""
    text = (folder / "README.md").read_text(encoding="utf-8")
    title = re.sub(r"^# ", "", text.splitlines()[0])
    body = re.sub(r"\s*!\[.*?\]\(.*?\)\s*", "\n\n", "\n".join(text.splitlines()[1:])).strip()
    command = re.search(r"`(python validation/[^`]+)`", body)
    body = re.sub(r"\s*`python validation/[^`]+`\s*\Z", "", body).strip()
    parts = [f"## {title} {{ #{folder.name} }}", body]
    for figure in sorted(folder.glob("figure*.png")):
        alt = re.search(rf"!\[(.*?)\]\({re.escape(figure.name)}\)", text)
        parts.append(f"![{alt[1] if alt else title}](validation/{folder.name}/{figure.name}){{ loading=lazy }}")
    for record in records(folder):
        parts += [f"**{record['title']}** – {record['date']}, {record['machine']}", table(record["bars"])]
    parts.append(f"Command: `{command[1] if command else f'python validation/{folder.name}/check.py'}`")
    return parts


def table(bars: list[dict[str, Any]]) -> str:
    """Return the bars beside what was reached."""
    lines = ["| quantity | bar | reached | |", "|---|---|---|---|"]
    for bar in bars:
        limit = bar["bar"]
        text = f"{number(limit[0])} … {number(limit[1])}" if isinstance(limit, list) else f"≤ {number(limit)}"
        verdict = "holds" if bar["holds"] else "**missed**"
        quantity = bar["quantity"].replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
        lines.append(f"| {quantity} | {text} | {number(bar['reached'])} | {verdict} |")
    return "\n".join(lines)


def number(value: float | None) -> str:
    """Return a number with three digits; bars without a limit on one side show none."""
    if value is None or abs(value) == float("inf"):
        return ""
    return f"{value:.3g}"


def stale() -> bool:
    """Whether the page is not what would be written."""
    path = DOCS / "gallery.md"
    return not path.exists() or path.read_text(encoding="utf-8") != page()


def main() -> None:
    """Write the page, or check it."""
    if "--check" in sys.argv:
        if stale():
            sys.exit("out of date: gallery.md; run python docs/generate_gallery.py")
        return
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
