"""Rows of the comparison as two tables of a page."""

from __future__ import annotations

import platform
import textwrap
from pathlib import Path

from marks import rewrite

COLUMNS = ["pair", "clearance", "triangles", "tool", "set-up", "MiB", "poses", "p50", "p99", "false",
           "missed", "rises", "torque", "loop", "pull", "note"]

#: Columns of the two tables: title, how a number is shown.
BY_SIZE = {"set-up": ("set-up, s", "{:.2g}"), "MiB": ("MiB", "{:.0f}"), "p50": ("p50, µs", "{:.3g}"),
           "p99": ("p99, µs", "{:.3g}"), "poses": ("poses", "{:.0f}")}
BY_CLEARANCE = {"false": ("false, %", "{:.1f}"), "missed": ("missed, %", "{:.1f}"),
                "rises": ("rises", "{:.2g}"), "torque": ("torque", "{:.2g}"),
                "loop": ("loop", "{:.2g}"), "pull": ("pull", "{:.3g}")}
PER_CENT = "false", "missed"


def processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def shown(row: dict | None, column: str, form: str) -> str:
    if row is None:
        return "?"
    text = row[column]
    if text in ("", "nan"):
        return "-"
    value = float(text) * (100 if column in PER_CENT else 1)
    # No exponents: 1.2e+03 reads worse than 1200.
    said = form.format(value)
    return f"{float(said):.0f}" if "e+" in said else said


def table(rows: list[dict], keys: list[tuple], sections: list[str], by: str, columns: dict) -> str:
    """A line per tool and size or clearance; in every cell the pairs, one after the other."""
    found = {(r["tool"], r["clearance"], r["triangles"], r["pair"]): r for r in rows}
    lines = [f"| tool | {by} | " + " | ".join(title for title, _ in columns.values()) + " |",
             "|---|---|" + "---|" * len(columns)]
    for tool in dict.fromkeys(r["tool"] for r in rows):
        for clearance, triangles, label in keys:
            of = [found.get((tool, clearance, triangles, s)) for s in sections]
            if not any(of):
                continue
            cells = []
            for column, (_, form) in columns.items():
                said = [shown(row, column, form) for row in of]
                cells.append(said[0] if len(set(said)) == 1 else " / ".join(said))
            lines.append(f"| {tool} | {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def notes(rows: list[dict]) -> str:
    """What kept rows from being measured, each once."""
    said: dict[str, list[str]] = {}
    for r in rows:
        if r["note"]:
            case = f"{r['pair']}, {r['clearance']} mm, {r['triangles']} triangles"
            said.setdefault(f"{r['tool']}: {r['note']}", []).append(case)
    lines = []
    for note, where in said.items():
        pairs = {w.split(",")[0] for w in where}
        place = where[0] if len(where) == 1 else f"{len(where)} rows ({', '.join(sorted(pairs))})"
        lines.append(f"- {note}: {place}.")
    return "\n".join(lines)


def write_page(page: Path, rows: list[dict], middle: tuple[float, int]) -> None:
    """Writes what lies between the marks of the page."""
    clearance, size = f"{1e3 * middle[0]:g}", str(middle[1])
    sections = list(dict.fromkeys(r["pair"] for r in rows))
    sizes = sorted({r["triangles"] for r in rows}, key=int)
    widths = sorted({r["clearance"] for r in rows}, key=float)
    asked = sorted({int(r["poses"]) for r in rows if r["poses"]})
    head = (f"{processor()}, one thread; {len(rows)} rows; {asked[0]} to {asked[-1]} poses a row, as "
            f"many as the time given to a row allows. In every cell the pairs {', '.join(sections)}; "
            "`?` was not measured.")
    head = textwrap.fill(head, 100, break_long_words=False, break_on_hyphens=False)
    lines = [
        head, "", f"At {clearance} mm of clearance, by the size of the meshes:", "",
        table(rows, [(clearance, s, s) for s in sizes], sections, "triangles", BY_SIZE), "",
        f"With {size} triangles, by clearance:", "",
        table(rows, [(w, size, w) for w in widths], sections, "clearance, mm", BY_CLEARANCE), "",
        notes(rows),
    ]
    rewrite(page, "just contact-peers", lines)
