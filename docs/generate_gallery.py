"""Write docs/gallery.md from the results that validation/ holds.

    python docs/generate_gallery.py           write the page
    python docs/generate_gallery.py --check   fail if it is not what would be written

Needs nothing but the clone. The figures stay where they are, and the page shows them from there when it is read in the
repository; docs/hooks.py shows them to the site.
"""

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
VALIDATION = DOCS.parent / "validation"

INTRODUCTION = """\
<!-- Written by docs/generate_gallery.py from validation/: run the check scripts instead of changing it. -->

# Validated cases

What Spume was compared with, what was to be reached and what was reached, as `spume validate` and the
check scripts of the repository wrote it down. A missed bar is printed as missed; `validation/README.md` of the
repository says what limits it. No case has models of its own. `spume validate --list` lists all cases with their
bars."""


def page() -> str:
    """Return the text of the page."""
    folders = [folder for folder in sorted(VALIDATION.iterdir()) if folder.is_dir() and records(folder)]
    bars = [bar for folder in folders for record in records(folder) for bar in rows(record)]
    holds = sum(verdict == "holds" for *_, verdict in bars)
    parts = [INTRODUCTION, f"{holds} of {len(bars)} bars hold."]
    for folder in folders:
        parts += section(folder)
    return "\n\n".join(part for part in parts if part) + "\n"


def records(folder: Path) -> list[dict[str, Any]]:
    """Return what ``spume validate`` or a check script wrote into a folder, if it judges a case."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("results*.json"))]
    return [record for record in found if isinstance(record, dict) and "bars" in record]


def section(folder: Path) -> list[str]:
    """Return title, description, figures, tables and command of a case."""
    found, readme = records(folder), folder / "README.md"
    first = found[0]
    text = readme.read_text(encoding="utf-8") if readme.exists() else f"# {first['title']}\n\n{first['reference']}"
    title = re.sub(r"^# ", "", text.splitlines()[0])
    body = re.sub(r"\s*!\[.*?\]\(.*?\)\s*", "\n\n", "\n".join(text.splitlines()[1:])).strip()
    command = re.search(r"`(spume validate [^`]+|python validation/[^`]+)`", body)
    body = re.sub(r"\s*`(?:spume validate|python validation/)[^`]*`\s*\Z", "", body).strip()
    parts = [f"## {title} {{ #{folder.name} }}", body]
    for figure in sorted(folder.glob("figure*.png")):
        alt = re.search(rf"!\[(.*?)\]\({re.escape(figure.name)}\)", text)
        parts.append(f"![{alt[1] if alt else title}](../validation/{folder.name}/{figure.name}){{ loading=lazy }}")
    for record in found:
        parts.append(f"**{record['title']}** – {record['date']}, {record['machine']}")
        parts += [table(record)] if record["bars"] else []
    parts.append(f"Command: `{command[1] if command else f'spume validate {folder.name}'}`")
    return parts


def rows(record: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return quantity, bar, reached value and verdict of each bar."""
    found = []
    for bar in record["bars"]:
        if "metric" in bar:  # of spume validate
            series = f"{bar['series']}: " if bar["series"] else ""
            at = f", {record['length']} = {bar['cells']}" if bar["cells"] else ""
            at += f", mean of {bar['mean of runs']} runs" if bar.get("mean of runs", 1) > 1 else ""
            found.append(
                (series + bar["metric"] + at, limits(bar["lower"], bar["upper"]), bar["reached"], bar["verdict"])
            )
        else:
            low, high = bar["bar"] if isinstance(bar["bar"], list) else (None, bar["bar"])
            verdict = "holds" if bar["holds"] else "MISSED"
            found.append((bar["quantity"], limits(low, high), bar["reached"], verdict))
    return [(quantity, bar, number(reached), verdict) for quantity, bar, reached, verdict in found]


def table(record: dict[str, Any]) -> str:
    """Return the bars beside what was reached."""
    lines = ["| quantity | bar | reached | |", "|---|---|---|---|"]
    for quantity, bar, reached, verdict in rows(record):
        words = quantity.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
        lines.append(f"| {words} | {bar} | {reached} | {'**missed**' if verdict == 'MISSED' else verdict} |")
    return "\n".join(lines)


def limits(low: float | None, high: float | None) -> str:
    """Return the limits of a bar as text."""
    if low is None or abs(low) == math.inf:
        return f"≤ {number(high)}"
    return f"≥ {number(low)}" if high is None or high == math.inf else f"{number(low)} … {number(high)}"


def number(value: float | None) -> str:
    """Return a number with three digits; a dash for none."""
    return "–" if value is None else f"{value:.3g}"


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
