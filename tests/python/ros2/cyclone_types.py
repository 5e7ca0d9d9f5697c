"""The types of `tests/data/ros2_types.txt` as Cyclone DDS's Python binding wants them: no ROS 2 anywhere."""

import dataclasses
import sys
import types as python_types
from pathlib import Path

from cyclonedds.idl import IdlStruct, annotations
from cyclonedds.idl import types as idl

TYPES = Path(__file__).resolve().parents[2] / "data/ros2_types.txt"
SIMPLE = {
    "bool": bool, "string": str, "byte": idl.uint8, "uint8": idl.uint8, "int8": idl.int8, "uint16": idl.uint16,
    "int16": idl.int16, "uint32": idl.uint32, "int32": idl.int32, "uint64": idl.uint64, "int64": idl.int64,
    "float32": idl.float32, "float64": idl.float64,
}  # fmt: skip

_fields = {}
_made = {}
for _line in TYPES.read_text().splitlines():
    _left, _right = _line.split()
    if _line.startswith(" "):
        _fields[_last].append((_left, _right))
    else:
        _last = _left
        _fields[_last] = []


def _annotation(word):
    if word.endswith("]"):
        element, count = word[:-1].split("[")
        inner = _annotation(element)
        if count.isdigit():
            return idl.array[inner, int(count)]
        return idl.sequence[inner, int(count[2:])] if count else idl.sequence[inner]
    return SIMPLE.get(word) or make(word)


def make(name):
    """The class of a type, say `sweepd_msgs/msg/Tick`, under the name that ROS 2 gives it on DDS."""
    if name not in _made:
        package, kind, short = name.split("/")
        annotated = {field: _annotation(word) for field, word in _fields[name]}
        bare = python_types.new_class(
            short,
            (IdlStruct,),
            {"typename": f"{package}::{kind}::dds_::{short}_"},
            lambda space: space.update(__annotations__=annotated, __module__=__name__),
        )
        _made[name] = annotations.final(dataclasses.dataclass(bare))
        setattr(sys.modules[__name__], short, _made[name])
    return _made[name]


def zero(name):
    """A value of a type with every field 0 or empty."""
    values = {}
    for field, word in _fields[name]:
        element, _, count = word.partition("[")
        one = zero(element) if element in _fields else {"string": "", "bool": False}.get(element, 0)
        values[field] = one if not count else [one] * int(count[:-1]) if count[:-1].isdigit() else []
    return make(name)(**values)
