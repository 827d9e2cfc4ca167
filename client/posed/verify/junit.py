"""Findings as JUnit XML, one test case a finding."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

from posed.verify.finding import Finding, Verdict


def junit_xml(findings: Sequence[Finding], seconds: float) -> str:
    """Return the document; a suite a verification."""
    root = ElementTree.Element("testsuites", {"name": "posed verify", "time": f"{seconds:.3f}", **_counts(findings)})
    for name in dict.fromkeys(finding.verification for finding in findings):
        own = [finding for finding in findings if finding.verification == name]
        suite = ElementTree.SubElement(root, "testsuite", {"name": name, **_counts(own)})
        for finding in own:
            case = ElementTree.SubElement(suite, "testcase", classname=name, name=finding.subject)
            text = f"measured {finding.measured}, threshold {finding.threshold}"
            if finding.verdict is Verdict.FAIL:
                ElementTree.SubElement(case, "failure", message=text)
            elif finding.verdict is Verdict.SKIP:
                ElementTree.SubElement(case, "skipped", message=finding.note)
            ElementTree.SubElement(case, "system-out").text = f"{text}. {finding.note}".strip()
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _counts(findings: Sequence[Finding]) -> dict[str, str]:
    verdicts = [finding.verdict for finding in findings]
    return {
        "tests": str(len(verdicts)),
        "failures": str(verdicts.count(Verdict.FAIL)),
        "skipped": str(verdicts.count(Verdict.SKIP)),
    }
