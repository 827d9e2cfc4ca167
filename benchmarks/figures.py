"""Measured figures beside their targets."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure; `at_most` or `at_least` is its target, neither makes it one that is only stated."""

    name: str
    value: float
    unit: str = ""
    at_most: float | None = None
    at_least: float | None = None
    spread: float | None = None

    @property
    def holds(self) -> bool:
        """True if the target is met or there is none."""
        if self.at_most is not None and self.value > self.at_most:
            return False
        return self.at_least is None or self.value >= self.at_least

    @property
    def target(self) -> str:
        """The target, for people."""
        limits = [
            f"{sign} {limit:g}" for sign, limit in ((">=", self.at_least), ("<=", self.at_most)) if limit is not None
        ]
        return ", ".join(limits)

    @property
    def verdict(self) -> str:
        """Whether the target is met, for people."""
        if not self.target:
            return ""
        return "holds" if self.holds else "MISSED"


def show(title: str, figures: Sequence[Figure]) -> int:
    """Print the figures and return the exit code: 1 if a target was missed."""
    table = Table(title=title, title_justify="left")
    for column, name in enumerate(("figure", "measured", "unit", "target", "")):
        table.add_column(name, justify="right" if column in (1, 3) else "left")
    for figure in figures:
        spread = "" if figure.spread is None else f" ({figure.spread:.3g})"
        table.add_row(figure.name, f"{figure.value:.4g}{spread}", figure.unit, figure.target, figure.verdict)
    console = Console(highlight=False, width=110)
    console.print(table)
    missed = sum(not figure.holds for figure in figures)
    console.print(f"{missed} missed")
    if any(figure.spread is not None for figure in figures):
        console.print("in parentheses: the spread over the repeats, largest - smallest")
    return int(missed > 0)
