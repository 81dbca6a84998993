"""Computes the type hashes of ROS 2 (REP 2011, RIHS01) from idl/ros2/*.idl and compares them with those in the code that is
named: type_hash_test.py ROOT. The hash is the SHA-256 of a JSON text that describes a type and all types in it. That the
computation is right is shown by types whose hashes ROS publishes."""
import hashlib
import json
import pathlib
import re
import sys

NUMBERS = {"int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9, "float": 10,
           "double": 11, "boolean": 15, "octet": 16, "string": 17}
ARRAY, SEQUENCE = 48, 144  # Added to the number of the element's type.

# From the generated sources of ROS 2 Jazzy.
PUBLISHED = {
    "builtin_interfaces/msg/Time": "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    "geometry_msgs/msg/Point": "6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881",
    "geometry_msgs/msg/Quaternion": "8a765f66778c8ff7c8ab94afcc590a2ed5325a1d9a076ffff38fbce36f458684",
    "nav_msgs/srv/GetMap_Request": "b531e302f1bd6a81f8a5e03453266c378b1f711b4296000c1c0f53a40e00a7c4",
}


def read_types(folder):
    types = {}
    for path in sorted(folder.glob("*.idl")):
        text = re.sub(r"//.*", "", path.read_text())
        package = re.search(r"module (\w+)", text).group(1)
        kind = "msg"
        for module, name, body in re.findall(r"module (msg|srv) \{|struct (\w+)_ \{(.*?)\}", text, re.DOTALL):
            kind = module or kind
            if name:
                types[f"{package}/{kind}/{name}"] = re.findall(r"([\w:<>]+) _?(\w+)(?:\[(\d+)\])?;", body)
    return types


def field_type(kind, length):
    is_sequence = kind.startswith("sequence<")
    if is_sequence:
        kind = kind[len("sequence<"):-1]
    nested = ""
    if "::" in kind:
        package, folder, _, name = kind.split("::")
        nested = f"{package}/{folder}/{name[:-1]}"
    number = 1 if nested else NUMBERS[kind]
    number += ARRAY if length else SEQUENCE if is_sequence else 0
    return {"type_id": number, "capacity": int(length or 0), "string_capacity": 0, "nested_type_name": nested}


def describe(types, name):
    return {"type_name": name,
            "fields": [{"name": field, "type": field_type(kind, length)} for kind, field, length in types[name]]}


def types_in(types, name):
    found = set()
    for kind, _, length in types[name]:
        nested = field_type(kind, length)["nested_type_name"]
        if nested:
            found |= {nested} | types_in(types, nested)
    return found


def type_hash(types, name):
    text = json.dumps({"type_description": describe(types, name),
                       "referenced_type_descriptions": [describe(types, one) for one in sorted(types_in(types, name))]})
    return hashlib.sha256(text.encode()).hexdigest()


def main(root):
    types = read_types(root / "idl/ros2")
    wrong = [f"{name}: {type_hash(types, name)}, but ROS says {known}" for name, known in PUBLISHED.items()
             if type_hash(types, name) != known]
    code = "".join((root / "common/wire/ros2" / name).read_text() for name in ("message_types.h", "service_types.h"))
    pairs = re.findall(r"using \w*Wire = ::(\w+)::(msg|srv)::dds_::(\w+)_;.*?Hash = \"(\w+)\"", code, re.DOTALL)
    if len(pairs) < 18:
        wrong.append(f"only {len(pairs)} hashes are found in message_types.h and service_types.h")
    for package, kind, name, known in pairs:
        computed = type_hash(types, f"{package}/{kind}/{name}")
        if computed != known:
            wrong.append(f"{package}/{kind}/{name}: {computed}, but the code says {known}")
    print("\n".join(wrong) or f"{len(pairs)} type hashes are right")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
