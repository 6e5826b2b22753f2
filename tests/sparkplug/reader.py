#!/usr/bin/env python3
"""A second reader and writer of Sparkplug B payloads, which shares nothing with Berth's: protobuf's Python, and a
description of the wire that is written here by hand from Sparkplug 3.0 §6.4.1.

usage: reader.py             a payload in hex in each line of the input: its JSON in each line of the output
       reader.py --payloads  prints payloads: name, hex
       reader.py --check     whether python3-protobuf is there (exit 3: it is not)

In the JSON a metric has what is on the wire, under the wire's names, and `which`: the field that its value is in.
"""
import json
import sys

try:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
except ImportError:
    sys.exit(3)

KIND = descriptor_pb2.FieldDescriptorProto
SCALARS = {"u32": KIND.TYPE_UINT32, "u64": KIND.TYPE_UINT64, "f32": KIND.TYPE_FLOAT, "f64": KIND.TYPE_DOUBLE,
           "bool": KIND.TYPE_BOOL, "text": KIND.TYPE_STRING, "bytes": KIND.TYPE_BYTES}
PLAIN = ["int_value u32", "long_value u64", "float_value f32", "double_value f64", "boolean_value bool", "string_value text"]


def values(first, *more):
    """The fields of a `oneof value` from this number on."""
    return [(f"{spec}", first + i, True) for i, spec in enumerate(PLAIN + list(more))]


# Fields as "name type", number; `*` before the type: repeated. True: of the oneof.
MESSAGES = {
    "P": [("timestamp u64", 1), ("metrics *M", 2), ("seq u64", 3), ("uuid text", 4), ("body bytes", 5)],
    "M": [("name text", 1), ("alias u64", 2), ("timestamp u64", 3), ("datatype u32", 4), ("is_historical bool", 5),
          ("is_transient bool", 6), ("is_null bool", 7), ("metadata Meta", 8), ("properties Props", 9),
          *values(10, "bytes_value bytes", "dataset_value Data", "template_value Tpl")],
    "Meta": [("is_multi_part bool", 1), ("content_type text", 2), ("size u64", 3), ("seq u64", 4), ("file_name text", 5),
             ("file_type text", 6), ("md5 text", 7), ("description text", 8)],
    "Props": [("keys *text", 1), ("values *Prop", 2)],
    "Prop": [("type u32", 1), ("is_null bool", 2), *values(3, "propertyset_value Props", "propertysets_value PropList")],
    "PropList": [("propertyset *Props", 1)],
    "Data": [("num_of_columns u64", 1), ("columns *text", 2), ("types *u32", 3), ("rows *Row", 4)],
    "Row": [("elements *Cell", 1)],
    "Cell": values(1),
    "Tpl": [("version text", 1), ("metrics *M", 2), ("parameters *Param", 3), ("template_ref text", 4), ("is_definition bool", 5)],
    "Param": [("name text", 1), ("type u32", 2), *values(3)],
}


def payload_class():
    wire = descriptor_pb2.FileDescriptorProto(name="hand.proto", package="hand", syntax="proto2")
    for name, fields in MESSAGES.items():
        message = wire.message_type.add(name=name)
        if any(len(each) == 3 for each in fields):
            message.oneof_decl.add(name="value")
        for each in fields:
            field_name, kind = each[0].split()
            field = message.field.add(name=field_name, number=each[1])
            field.label = KIND.LABEL_REPEATED if kind.startswith("*") else KIND.LABEL_OPTIONAL
            kind = kind.lstrip("*")
            if kind in SCALARS:
                field.type = SCALARS[kind]
            else:
                field.type, field.type_name = KIND.TYPE_MESSAGE, f".hand.{kind}"
            if len(each) == 3:
                field.oneof_index = 0
    pool = descriptor_pool.DescriptorPool()
    pool.Add(wire) if not hasattr(pool, "AddSerializedFile") else pool.AddSerializedFile(wire.SerializeToString())
    descriptor = pool.FindMessageTypeByName("hand.P")
    if hasattr(message_factory, "GetMessageClass"):
        return message_factory.GetMessageClass(descriptor)
    return message_factory.MessageFactory(pool).GetPrototype(descriptor)


def plain(message):
    """A message as dicts and lists, with what is there and no defaults."""
    out = {}
    for field, value in message.ListFields():
        if field.label == field.LABEL_REPEATED:
            out[field.name] = [plain(each) if field.message_type else each for each in value]
        elif field.message_type:
            out[field.name] = plain(value)
        else:
            out[field.name] = value.hex() if isinstance(value, bytes) else value
    if any(each.name == "value" for each in message.DESCRIPTOR.oneofs):
        out["which"] = message.WhichOneof("value")
    return out


def payloads(make):
    """What Berth must read: each form of value once, as another stack would write it."""
    birth = make(timestamp=1670000000000, seq=0)
    birth.metrics.add(name="bdSeq", timestamp=1, datatype=4, long_value=7)
    birth.metrics.add(name="Node Control/Rebirth", timestamp=1, datatype=11, boolean_value=False)
    birth.metrics.add(name="i8", alias=1, timestamp=2, datatype=1, int_value=0xFF)            # -1 in its own width
    birth.metrics.add(name="i16", alias=2, timestamp=3, datatype=2, int_value=0xFFFFFFFE)     # -2 in 32 bits
    birth.metrics.add(name="u32", alias=3, timestamp=4, datatype=7, long_value=4000000000)    # as some stacks do
    birth.metrics.add(name="f", alias=4, timestamp=5, datatype=9, float_value=1.5)
    birth.metrics.add(name="d", alias=5, timestamp=6, datatype=10, double_value=-0.1)
    birth.metrics.add(name="s", alias=6, timestamp=7, datatype=12, string_value="Grüße")
    birth.metrics.add(name="t", alias=7, timestamp=8, datatype=13, long_value=1670000000001)
    birth.metrics.add(name="none", alias=8, timestamp=9, datatype=12, is_null=True)
    birth.metrics.add(name="a", alias=9, timestamp=10, datatype=24, bytes_value=(-1).to_bytes(4, "little", signed=True))
    birth.metrics.add(name="odd", alias=10, timestamp=11, datatype=99, int_value=1)
    quality = birth.metrics.add(name="q", alias=11, timestamp=12, datatype=3, int_value=5).properties
    quality.keys.append("Quality")
    quality.values.add(type=3, int_value=500)
    table = birth.metrics.add(name="table", alias=12, timestamp=13, datatype=16).dataset_value
    table.num_of_columns = 2
    table.columns.extend(["n", "x"])
    table.types.extend([5, 10])
    row = table.rows.add()
    row.elements.add(int_value=3)
    row.elements.add(double_value=2.5)
    motor = birth.metrics.add(name="Motor", alias=13, timestamp=14, datatype=19).template_value
    motor.is_definition = True
    motor.metrics.add(name="speed", datatype=3, is_null=True)
    motor.parameters.add(name="poles", type=5, int_value=4)
    data = make(timestamp=1670000000002, seq=255)
    data.metrics.add(alias=1, timestamp=20, int_value=0xFFFFFF80)
    data.metrics.add(alias=6, timestamp=21, is_historical=True, string_value="x")
    return {"birth": birth, "data": data, "death": make(timestamp=1, seq=4)}


def main():
    make = payload_class()
    if "--check" in sys.argv:
        return
    if "--payloads" in sys.argv:
        for name, payload in payloads(make).items():
            print(name, payload.SerializeToString().hex())
        return
    for line in sys.stdin:
        message = make()
        message.ParseFromString(bytes.fromhex(line.strip()))
        print(json.dumps(plain(message)))


main()
