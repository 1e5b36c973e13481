"""The part of a page between two marks."""

from pathlib import Path


def rewrite(page: Path, command: str, lines: list[str]) -> None:
    """Puts lines between the marks that name the command which writes them."""
    begin, end = f"<!-- begin: {command} -->", f"<!-- end: {command} -->"
    before, rest = page.read_text(encoding="utf-8").split(begin)
    after = rest.split(end)[1]
    text = "\n".join([begin, "", *lines, "", end])
    page.write_text(before + text + after, encoding="utf-8")
