"""Tables: one content, written as CSV for programs, Markdown for notes and LaTeX (booktabs) for papers."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..common.files import whole, write_text


@dataclass(frozen=True)
class Entry:
    """What a cell of a table says; `value` is what it sorts by, `best` sets it in bold."""

    text: str
    value: float | str | None = None
    best: bool = False


@dataclass(frozen=True)
class Table:
    """Columns and rows of equal length; the first `labels` columns name the row, the others hold figures."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Entry, ...], ...]
    labels: int = 1


def save(table: Table, out: Path, name: str, records: Sequence[Mapping[str, object]]) -> tuple[str, ...]:
    """Writes name.csv (the plain numbers in `records`), name.md and name.tex; returns the three file names."""
    write_csv(out / f"{name}.csv", records)
    write_text(out / f"{name}.md", markdown(table))
    write_text(out / f"{name}.tex", latex(table))
    return (f"{name}.csv", f"{name}.md", f"{name}.tex")


def write_csv(path: Path, records: Sequence[Mapping[str, object]]) -> None:
    """Writes records that share their keys, floats to 6 significant digits; None is empty."""
    columns = list(records[0]) if records else []
    with whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows({key: _plain(value) for key, value in record.items()} for record in records)


def markdown(table: Table) -> str:
    """A GitHub table, numbers to the right."""
    rule = ["---" if column < table.labels else "---:" for column in range(len(table.columns))]
    rows = [[_bold(_markdown(entry.text), "**{}**", entry.best) for entry in row] for row in table.rows]
    lines = [[_markdown(column) for column in table.columns], rule, *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def latex(table: Table) -> str:
    """A booktabs tabular, to be read in by a paper."""
    align = "l" * table.labels + "r" * (len(table.columns) - table.labels)
    rows = [[_bold(_latex(entry.text), r"\textbf{{{}}}", entry.best) for entry in row] for row in table.rows]
    lines = [
        rf"\begin{{tabular}}{{{align}}}",
        r"\toprule",
        " & ".join(map(_latex, table.columns)) + r" \\",
        r"\midrule",
    ]
    lines += [" & ".join(row) + r" \\" for row in rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def best(values: Sequence[float | None], digits: int, lowest: bool = False) -> list[bool]:
    """Which of the values are the best as printed: those that round to the same figure share the place."""
    printed = [None if value is None else round(value, digits) for value in values]
    known = [value for value in printed if value is not None]
    if len(known) < 2:
        return [False] * len(printed)
    first = min(known) if lowest else max(known)
    return [value == first for value in printed]


def _bold(text: str, form: str, yes: bool) -> str:
    return form.format(text) if yes else text


def _markdown(text: str) -> str:
    for character in "\\|*_`<>[]":
        text = text.replace(character, "\\" + character)
    return " ".join(text.split())


_LATEX = {
    "\\": r"\textbackslash{}",
    **{character: "\\" + character for character in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "−": "$-$",
    "±": r"$\pm$",
    "Δ": r"$\Delta$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "<": "$<$",
    ">": "$>$",
    "–": "--",
}


def _latex(text: str) -> str:
    return " ".join("".join(_LATEX.get(character, character) for character in text).split())


def _plain(value: object) -> object:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else value
