"""What stands on a page and can be run: blocks of shell, Python and files, and what is said of them.

A comment just before a block says what a reader need not see:

    <!-- file: scene.toml -->     the block is this file
    <!-- exit: 0 1 -->            the exit codes that are right (0 if not said)
    <!-- also: COMMAND -->        done before the block
    <!-- without: WORDS: WHY -->  lines with these words are left out, and why
    <!-- not run: WHY -->         the block is not run, and why
    <!-- printed by: WORDS -->    the block is what the last block that holds these words printed

Of what is printed, `...` stands for any text or, alone on a line, for any lines; a number with decimals
or of four digits may differ by one in its last digit, and spaces may differ.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

#: Words of a shell block that make it one to be run.
COMMAND = re.compile(r"^(.*[|&;(] *|.*\s)?pegfit [a-z]", re.MULTILINE)
MARK = re.compile(r"^<!-- (file|exit|also|without|not run|printed by): (.*) -->$")
NUMBER = re.compile(r"[-\u2212]?\d+(?:\.\d+)?(?:e[-+\u2212]?\d+)?")


@dataclass
class Block:
    """A block of a page and the marks before it."""

    line: int
    language: str
    text: str
    marks: dict[str, str] = field(default_factory=dict)

    @property
    def runs(self) -> bool:
        """Whether it is one that has to be run or marked."""
        if self.language in ("python", "file") or "printed by" in self.marks:
            return True
        return self.language in ("sh", "", "bash") and bool(COMMAND.search(self.text))


def pages() -> list[Path]:
    """README, that of the packages and every page below docs, tutorials left out: they run while
    the site is built."""
    docs = [p for p in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in p.parts]
    return [ROOT / "README.md", ROOT / "crates" / "README.md"] + [p for p in docs if "file_format: mystnb" not in p.read_text()]


def blocks(text: str) -> list[Block]:
    """The fenced and the indented blocks of a page, in order."""
    found: list[Block] = []
    marks: dict[str, str] = {}
    lines = text.split("\n")
    at = 0
    while at < len(lines):
        line = lines[at]
        mark = MARK.match(line)
        if mark:
            marks[mark[1]] = mark[2]
        elif line.startswith("```") or line.startswith("    "):
            block, at = _block(lines, at)
            block.marks, marks = marks, {}
            if "without" in block.marks:
                words = block.marks["without"].split(":")[0]
                kept = [line for line in block.text.split("\n") if words not in line]
                block.text = "\n".join(kept)
            if "file" in block.marks:
                block.language = "file"
            found.append(block)
        elif line.strip():
            marks = {}
        at += 1
    return found


def _block(lines: list[str], at: int) -> tuple[Block, int]:
    """The block that begins at a line, and its last line."""
    first = at
    if lines[at].startswith("```"):
        at += 1
        while at < len(lines) and not lines[at].startswith("```"):
            at += 1
        return Block(first + 1, lines[first][3:].strip(), "\n".join(lines[first + 1 : at])), at
    while at < len(lines) and (lines[at].startswith("    ") or not lines[at].strip()):
        at += 1
    text = "\n".join(line[4:] for line in lines[first:at]).rstrip()
    # Python in the middle of a page of shell is told by its first word.
    python = re.match(r"(import|from|def) ", text) is not None
    return Block(first + 1, "python" if python else "", text), at - 1


def differs(expected: str, found: str) -> str:
    """Where a text that was printed is not what stands on a page; nothing where it is."""
    rest = [line for line in found.split("\n") if line.strip()]
    free = False
    for line in (line.strip() for line in expected.split("\n")):
        if line in ("", "..."):
            free = free or line == "..."
            continue
        while free and rest and not _same(line, rest[0]):
            rest.pop(0)
        if not rest or not _same(line, rest[0]):
            return f"expected: {line}\nfound: {rest[0] if rest else 'the end'}\nin:\n{found}"
        rest.pop(0)
        free = False
    return f"expected: the end\nfound: {rest[0]}" if rest and not free else ""


def _same(expected: str, found: str) -> bool:
    """Whether two lines are the same but for what may differ."""

    def literal(text: str) -> str:
        return ".*".join(r"\s+".join(map(re.escape, re.split(r"\s+", t))) for t in text.split("..."))

    numbers = NUMBER.findall(expected)
    pattern = f"({NUMBER.pattern})".join(literal(t) for t in NUMBER.split(expected))
    match = re.fullmatch(pattern, found.strip())
    return match is not None and all(map(_near, numbers, match.groups()))


def _near(expected: str, found: str) -> bool:
    """Whether two numbers are the same or, of those with decimals or four digits, one apart in the
    last digit."""
    expected, found = (text.replace("\u2212", "-") for text in (expected, found))
    digits, _, power = expected.partition("e")
    decimals = len(digits.partition(".")[2])
    if not (decimals or power) and len(digits.lstrip("-")) < 4:
        return expected == found
    return abs(float(expected) - float(found)) < 1.01 * 10.0 ** (int(power or 0) - decimals)
