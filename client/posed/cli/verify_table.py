"""The findings of `posed verify` as a table."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from posed.verify.finding import Finding, Verdict

_STYLES = {Verdict.PASS: "green", Verdict.FAIL: "bold red", Verdict.SKIP: "dim"}


def print_table(findings: Sequence[Finding], seconds: float, every: bool) -> None:
    """Print every finding, or what failed and then one line a verification."""
    console = Console(highlight=False, markup=False)
    shown = findings if every else [finding for finding in findings if finding.verdict is Verdict.FAIL]
    if shown:
        console.print(_of_findings(shown))
    if not every:
        console.print(_of_verifications(findings))
    for note in dict.fromkeys(f"{f.verification}: {f.note}" for f in findings if f.note):
        subjects = [f.subject for f in findings if f"{f.verification}: {f.note}" == note]
        console.print(f"{note} ({len(subjects)}: {subjects[0]}{', ...' if len(subjects) > 1 else ''})", style="dim")
    counts = [sum(finding.verdict is verdict for finding in findings) for verdict in Verdict]
    console.print(f"{counts[0]} passed, {counts[1]} failed, {counts[2]} skipped in {seconds:.0f} s")


def _of_findings(findings: Sequence[Finding]) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
    for title in ("verification", "of", "measured", "threshold", ""):
        table.add_column(title)
    for f in findings:
        table.add_row(f.verification, f.subject, f.measured, f.threshold, f.verdict.value, style=_STYLES[f.verdict])
    return table


def _of_verifications(findings: Sequence[Finding]) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
    table.add_column("verification")
    for title in ("passed", "failed", "skipped"):
        table.add_column(title, justify="right")
    for title in ("for example", "measured", "threshold"):
        table.add_column(title)
    for name in dict.fromkeys(finding.verification for finding in findings):
        own = [finding for finding in findings if finding.verification == name]
        counts = [sum(finding.verdict is verdict for finding in own) for verdict in Verdict]
        first = min(own, key=lambda f: (Verdict.FAIL, Verdict.PASS, Verdict.SKIP).index(f.verdict))
        style = _STYLES[first.verdict] if first.verdict is Verdict.FAIL else ""
        table.add_row(name, *map(str, counts), first.subject, first.measured, first.threshold, style=style)
    return table
