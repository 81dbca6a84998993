#!/usr/bin/env python3
"""The monitoring files of deploy/ beside what cairn-web says: monitoring_test.py SOURCE_DIR

Every figure that an alert or a panel names is one that cairn-web serves, and every alert has its row in the runbook. Where promtool
is installed, it checks the rules and the configuration.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys

source = pathlib.Path(sys.argv[1])
folder = source / "deploy" / "monitoring"
alerts = (folder / "alerts.yml").read_text()
dashboard = json.loads((folder / "dashboard.json").read_text())
served = set(re.findall(r'"(cairn_[a-z_]+)"', (source / "client/web/web_metrics.cpp").read_text()))
failed = []

named = re.findall(r"\bcairn_[a-z_]+", alerts)
for panel in dashboard["panels"]:
    named += [name for target in panel["targets"] for name in re.findall(r"\bcairn_[a-z_]+", target["expr"])]
if not served or not named:
    failed.append("no figures were found at all")
failed += [f"cairn-web serves no {name}" for name in sorted(set(named) - served)]

rules = re.findall(r"alert: (\w+)", alerts)
rows = re.findall(r"^\| `(Cairn\w+)` \|", (folder / "README.md").read_text(), re.MULTILINE)
if rules != rows:
    failed.append(f"alerts {rules} and rows of the runbook {rows} differ")

if shutil.which("promtool"):
    for check in (["rules", "alerts.yml"], ["config", "prometheus.yml"]):
        said = subprocess.run(["promtool", "check", *check], cwd=folder, capture_output=True, text=True)
        if said.returncode != 0:
            failed.append(said.stdout + said.stderr)
else:
    print("promtool is not installed: the rules' syntax is not checked")

print("\n".join(failed) or f"{len(rules)} alerts, {len(dashboard['panels'])} panels, {len(served)} figures")
sys.exit(1 if failed else 0)
