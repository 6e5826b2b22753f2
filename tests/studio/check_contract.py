#!/usr/bin/env python3
"""Holds docs/api (OpenAPI, AsyncAPI, the messages' schema) against Studio's server.

    check_contract.py SOURCE_DIR HEARD

HEARD is a file of JSON lines: {"sent": MESSAGE} that the server sent, {"answer": BODY} of POST /api/v1/request,
{"signals": BODY} of GET /api/v1/signals,
{"opened": BODY} of POST /api/v1/read, {"verbs": [...]} of the code's table, {"taken": [...]} the types of message that the
server takes. Prints what differs; exit status 1 then, 3 without the validator.
"""
import json
import pathlib
import re
import sys

try:
    from jsonschema import Draft202012Validator
except ImportError:
    print("python3-jsonschema is not installed (apt-get install python3-jsonschema)")
    sys.exit(3)

source = pathlib.Path(sys.argv[1])
api = source / "docs" / "api"
schema, openapi, asyncapi = (
    json.loads((api / name).read_text()) for name in ("messages.schema.json", "openapi.json", "asyncapi.json")
)
Draft202012Validator.check_schema(schema)
wrong = []


def validator(name):
    return Draft202012Validator({"$schema": schema["$schema"], "$defs": schema["$defs"], "$ref": "#/$defs/" + name})


def check(name, message):
    for error in validator(name).iter_errors(message):
        wrong.append(f"{name}: {'/'.join(map(str, error.absolute_path))}: {error.message[:200]}")


def same(what, code, file):
    for missing in sorted(set(code) - set(file)):
        wrong.append(f"{what} {missing!r}: the code has it, docs/api has not")
    for unknown in sorted(set(file) - set(code)):
        wrong.append(f"{what} {unknown!r}: docs/api has it, the code has not")


def references(tree):
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from [value] if key == "$ref" else references(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from references(value)


def of(action):
    names = [m["$ref"].rsplit("/", 1)[1] for m in asyncapi["operations"][action]["messages"]]
    return [name.replace("_", " ") for name in names]


heard = [json.loads(line) for line in pathlib.Path(sys.argv[2]).read_text().splitlines()]
sent = [entry["sent"] for entry in heard if "sent" in entry]
for message in sent:
    check(message["type"], message)
for entry in heard:
    if "answer" in entry:
        check("answer", entry["answer"])
    if "signals" in entry:
        check("signals", entry["signals"])
    if "opened" in entry:
        check("opened file", entry["opened"])
    if "verbs" in entry:
        same("verb", entry["verbs"], schema["$defs"]["verb name"]["enum"])
    if "taken" in entry:
        same("message to the server", entry["taken"], [name.removeprefix("to ") for name in of("receive")])
texts = [name for name in of("send") if name != "live frames"]
same("message that was heard:", {message["type"] for message in sent}, texts)
written = set()
for path in (source / "berth" / "studio").glob("*.cpp"):
    written |= set(re.findall(r'"type\\?"(?::\\?|, )"(\w+)', path.read_text()))
same("message of the sources:", written, texts)
for tree in (openapi, asyncapi):
    for reference in references(tree):
        if reference.startswith("messages.schema.json#/$defs/") and reference.split("/$defs/")[1] not in schema["$defs"]:
            wrong.append(f"{reference}: there is no such schema")
paths = set()
for path in (source / "berth" / "studio").glob("*.cpp"):
    paths |= set(re.findall(r'"(/api/v1/\w+|/metrics)"', path.read_text()))
same("path", paths, list(openapi["paths"]) + [asyncapi["channels"]["socket"]["address"]])
for name, definition in schema["$defs"].items():
    for example in definition.get("examples", []):
        check(name, example)
print("\n".join(wrong[:50]) or f"{len(sent)} messages are as docs/api says")
sys.exit(1 if wrong else 0)
