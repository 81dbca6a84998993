#!/usr/bin/env python3
"""The container files of deploy/ beside the programs that they start: containers_test.py SOURCE_DIR [BIN_DIR]

What they copy is there, what they set is what the programs take, and the Dockerfile, the compose file and the manifests agree on names,
users, ports and paths. `run-cairn` is run with a program that prints its arguments. With BIN_DIR, the options that they give are tried.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import yaml

source = pathlib.Path(sys.argv[1])
bin_dir = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
folder = source / "deploy" / "containers"
failed = []


def expect(holds, what):
    if not holds:
        failed.append(what)


def manifests(path):
    return [one for one in yaml.safe_load_all(path.read_text()) if one]


# The Dockerfile: each target with its instructions.
targets = {}
for line in re.sub(r"\\\n", " ", (folder / "Dockerfile").read_text()).splitlines():
    if match := re.match(r"FROM \S+ AS (\w+)$", line):
        target = targets.setdefault(match[1], [])
    elif line and not line.startswith("#"):
        target.append(line.split(None, 1))
expect(set(targets) == {"packages", "server", "web", "discovery"}, f"targets {sorted(targets)}")
for name, instructions in targets.items():
    for word, rest in instructions:
        if word == "COPY" and not rest.startswith("--from"):
            for path in rest.split()[:-1]:
                expect((source / path).exists(), f"{name} copies {path}, which is not there")
users = {name: [rest for word, rest in instructions if word == "USER"] for name, instructions in targets.items()}
expect(all(users[name] == ["10001"] for name in ("server", "web", "discovery")), f"users {users}")

# The compose file.
compose = yaml.safe_load((folder / "compose.yaml").read_text())
variables = set(re.findall(r"\$\{(\w+)", (folder / "compose.yaml").read_text()))
rows = set(re.findall(r"^\| `(CAIRN_\w+)` \|", (folder / "README.md").read_text(), re.MULTILINE))
expect(variables == rows, f"variables {sorted(variables)} and rows of the README {sorted(rows)} differ")
version = re.search(r"project\(cairn VERSION ([0-9.]+)", (source / "CMakeLists.txt").read_text())[1]
images = set()
for name, service in compose["services"].items():
    image, tag = service["image"].split(":")
    images.add(image)
    expect(tag == version, f"{name}: version {tag}, not {version}")
    context = (folder / service["build"]["context"]).resolve()
    expect(context == source.resolve(), f"{name}: its context is {context}")
    expect((context / service["build"]["dockerfile"]).exists(), f"{name}: no Dockerfile")
    expect(service["build"]["target"] in targets, f"{name}: no target {service['build']['target']}")
    expect(service["network_mode"] == "host" and service["cap_drop"] == ["ALL"] and service["read_only"], f"{name}: not as the README says")
state = dict(instruction for instruction in targets["server"] if instruction[0] == "ENV")["ENV"].split("=")[1]
expect(compose["services"]["cairnd"]["volumes"] == [f"state:{state}"], "the state is not on the volume")

# The manifests.
kubernetes = folder / "kubernetes"
kustomization = yaml.safe_load((kubernetes / "kustomization.yaml").read_text())
named = set(kustomization["resources"]) | {"kustomization.yaml"}
expect(named == {path.name for path in kubernetes.iterdir()}, f"resources {sorted(named)} and files differ")
expect(all(image["newTag"] == version for image in kustomization["images"]), f"the tags of kustomization.yaml are not {version}")
pods = []
services = []
for file in kustomization["resources"]:
    for one in manifests(kubernetes / file):
        if one["kind"] in ("StatefulSet", "Deployment"):
            pods.append(one["spec"]["template"])
            expect(one["spec"]["selector"]["matchLabels"].items() <= one["spec"]["template"]["metadata"]["labels"].items(), f"{file}: selector")
        if one["kind"] == "Service":
            services.append(one["spec"])
        if one["kind"] == "Namespace":
            expect(one["metadata"]["name"] == kustomization["namespace"], "namespace")
expect(len(pods) == 2 and len(services) == 1, f"{len(pods)} pods, {len(services)} services")
for pod in pods:
    spec = pod["spec"]
    (container,) = spec["containers"]
    expect(container["image"] in images, f"image {container['image']}")
    expect(container["image"] in {image["name"] for image in kustomization["images"]}, f"no tag for {container['image']}")
    expect(str(spec["securityContext"]["runAsUser"]) == "10001", "user")
    expect({env["name"] for env in container["env"]} <= rows, f"{container['name']}: variables")
    mounted = {mount["name"]: mount["mountPath"] for mount in container.get("volumeMounts", [])}
    expect(mounted.get("state", state) == state, "the state is not on the claim")
    for port in container.get("ports", []):
        expect(["EXPOSE", str(port["containerPort"])] in targets["web"], f"port {port}")
expect(all(any(service["selector"].items() <= pod["metadata"]["labels"].items() for pod in pods) for service in services), "a service without a pod")

# run-cairn, with a program that prints its arguments.
with tempfile.TemporaryDirectory() as directory:
    program = pathlib.Path(directory) / "cairn-prints"
    program.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    program.chmod(0o755)

    def run(*arguments, **environment):
        variables = {key: value for key, value in os.environ.items() if not key.startswith("CAIRN_")}
        variables.update(environment, PATH=f"{directory}:{os.environ['PATH']}")
        return subprocess.run([folder / "run-cairn", *arguments], env=variables, capture_output=True, text=True)

    said = run("cairn-prints", "status", "a b", CAIRN_INTERFACES="10.0.0.5,10.0.1.5")
    expect(said.stdout.splitlines() == ["status", "a b", "--set", "wire.interfaces=10.0.0.5,10.0.1.5"], f"run-cairn: {said}")
    said = run("cairn-prints", CAIRN_INTERFACES="10.0.0.5", CAIRN_DISCOVERY_SERVERS="10.0.0.9")
    expect(said.stdout.splitlines() == ["--set", "wire.interfaces=10.0.0.5", "--set", "wire.discovery_servers=10.0.0.9"], f"run-cairn: {said}")
    said = run("cairn-prints")  # A machine without a network has no address.
    found = re.fullmatch(r"--set\nwire\.interfaces=\d+\.\d+\.\d+\.\d+\n", said.stdout)
    expect(found or (said.returncode == 1 and "set CAIRN_INTERFACES" in said.stderr), f"run-cairn: {said}")
    expect(run().returncode == 2, "run-cairn without a program")

# What it adds, and what the images add, is what the programs take.
if bin_dir:
    checks = [
        ["cairnd", "--config", source / "deploy/cairnd.yaml", "--set", "wire.interfaces=127.0.0.1", "--set", "wire.discovery_servers=10.0.0.9", "--check-config"],
        ["cairn", "status", "--timeout", "5", "--set", "wire.interfaces=127.0.0.1", "--help"],
        ["cairn-web", "--address", "0.0.0.0", "--host", "cairn-web", "--host", "x", "--set", "wire.interfaces=127.0.0.1", "--help"],
    ]
    for check in checks:
        said = subprocess.run([bin_dir / check[0], *check[1:]], capture_output=True, text=True)
        expect(said.returncode == 0, f"{check}: {said.stdout}{said.stderr}")

print("\n".join(failed) or f"{len(targets)} targets, {len(compose['services'])} services, {len(pods)} pods")
sys.exit(1 if failed else 0)
