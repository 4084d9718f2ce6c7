"""What axe-core finds of a page: WCAG 2.2 A and AA. Its script is run by the browser's own debugger, which a
page's policy does not forbid."""

from pathlib import Path

RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


def findings(page, axe):
    """One line for each element that breaks a rule."""
    page.evaluate(Path(axe).read_text() + "; undefined")
    found = page.evaluate("rules => axe.run(document, {runOnly: rules, resultTypes: ['violations']})", RULES)
    return [
        f"{rule['id']}: {node['target'][0]}: {node['failureSummary'].splitlines()[-1].strip()}"
        for rule in found["violations"]
        for node in rule["nodes"]
    ]
