#!/usr/bin/env python3
"""The monitoring files of deploy/ beside what cairn-web says: monitoring_test.py SOURCE_DIR

Every figure that an alert, a test of the alerts or a panel names is one that cairn-web serves. Every alert has its row in the
runbook, and in alerts_test.yml (which alert_rules_test.sh runs) a case in which it fires and one in which it does not.
"""
import json
import pathlib
import re
import sys

import yaml

source = pathlib.Path(sys.argv[1])
folder = source / "deploy" / "monitoring"
alerts = (folder / "alerts.yml").read_text()
alerts_test = (source / "tests/deploy/alerts_test.yml").read_text()
dashboard = json.loads((folder / "dashboard.json").read_text())
figure = r"\bcairn_[a-z0-9_]+"
served = set(re.findall(r'"(cairn_[a-z0-9_]+)"', (source / "client/web/web_metrics.cpp").read_text()))
failed = []

named = re.findall(figure, alerts) + re.findall(figure, alerts_test)
for panel in dashboard["panels"]:
    named += [name for target in panel["targets"] for name in re.findall(figure, target["expr"])]
if not served or not named:
    failed.append("no figures were found at all")
failed += [f"cairn-web serves no {name}" for name in sorted(set(named) - served)]

rules = re.findall(r"alert: (\w+)", alerts)
rows = re.findall(r"^\| `(Cairn\w+)` \|", (folder / "README.md").read_text(), re.MULTILINE)
if rules != rows:
    failed.append(f"alerts {rules} and rows of the runbook {rows} differ")

cases = [case for group in yaml.safe_load(alerts_test)["tests"] for case in group["alert_rule_test"]]
for fires in (True, False):
    tested = {case["alertname"] for case in cases if bool(case["exp_alerts"]) == fires}
    failed += [f"no case in which {rule} {'fires' if fires else 'is silent'}" for rule in rules if rule not in tested]

print("\n".join(failed) or f"{len(rules)} alerts, {len(dashboard['panels'])} panels, {len(served)} figures")
sys.exit(1 if failed else 0)
