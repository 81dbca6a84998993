"""The messages of idl/cairn as ctypes structures, made from the C headers that idlc has made of the IDL (build.sh).

No message is written down here: a member that is added to the IDL is there when build.sh has run again.
"""
import ctypes
import enum
import re

TYPES = {"bool": ctypes.c_bool, "uint8_t": ctypes.c_uint8, "int16_t": ctypes.c_int16, "int32_t": ctypes.c_int32,
         "uint32_t": ctypes.c_uint32, "int64_t": ctypes.c_int64, "uint64_t": ctypes.c_uint64, "float": ctypes.c_float,
         "double": ctypes.c_double}
INCLUDE = re.compile(r'^#include "(\w+\.h)"', re.MULTILINE)
TYPE = re.compile(r"^typedef (struct|enum) (\w+)\s*\{(.*?)^\}", re.MULTILINE | re.DOTALL)
MEMBER = re.compile(r"(?:struct )?(\w+) *(\**) *(\w+)(?:\[(\d+)\])?;")


def _member_type(types, base, stars, length):
    kind = ctypes.c_char_p if base == "char" else types[base]  # `char *` is a string.
    for _ in stars[1:] if base == "char" else stars:
        kind = ctypes.POINTER(kind)
    return kind * int(length) if length else kind


def _read(header, types, names):
    text = header.read_text()
    for included in INCLUDE.findall(text):
        if (header.parent / included).exists():  # Otherwise it is one of the DDS.
            _read(header.parent / included, types, names)
    for keyword, name, body in TYPE.findall(text):
        if keyword == "enum":  # The IDL gives no numbers: they count from 0.
            types[name] = ctypes.c_uint32
            names[name] = enum.IntEnum(name, body.replace("cairn_v1_", ""), start=0)
        elif name not in types:
            members = [(member, _member_type(types, base, stars, length))
                       for base, stars, member, length in MEMBER.findall(body)]
            types[name] = names[name] = type(name, (ctypes.Structure,), {"_fields_": members})


class Messages:
    """Every type by its name in the IDL: messages.Scan, messages.SessionPhase.SESSION_ACTIVE."""

    def __init__(self, folder):
        types, names = dict(TYPES), {}
        for header in sorted(folder.glob("*.h")):
            _read(header, types, names)
        vars(self).update((name.removeprefix("cairn_v1_"), value) for name, value in names.items())


def fill(sequence, values):
    """Makes a sequence of a message hold the values. Their memory lives as long as the message."""
    kind = dict(sequence._fields_)["_buffer"]._type_
    sequence._buffer = (kind * len(values))(*values)
    sequence._maximum = sequence._length = len(values)
