#!/usr/bin/env python3
"""A page on a real bus: it reads and asks, and changes nothing until a person unlocks the bus, and after it is locked again.

    lock_peer.py PORT TOKEN NODE

Prints what is otherwise; exit status 1 then.
"""
import socket
import sys

from studio_page import Page

port, token, node = sys.argv[1:]
PATIENCE = 120  # s, no figure of the product
own = f"127.0.0.1:{port}"
wrong = []


def expect(what, good):
    if not good:
        wrong.append(what)


page = Page(socket.create_connection(("127.0.0.1", int(port)), PATIENCE), own, f"http://{own}", token)
lock = page.message()["lock"]
expect(f"a real bus is locked at first: {lock}", lock == {"real": True, "unlocked_until_s": None})


def refused(what):
    reply = page.ask("nmt", node=node, command="preop", yes="1")
    expect(f"{what}: {reply}", reply["status"] == 1 and "read-only" in reply["error"])


refused("a command while it is locked")
reply = page.ask("sdo read", node=node, object="1018h:01")
expect(f"asking is allowed: {reply}", reply["status"] == 0)
page.send({"type": "unlock", "minutes": 1})
page.next("change", lambda change: (change.get("lock") or {}).get("unlocked_until_s") is not None)
reply = page.ask("nmt", node=node, command="preop", yes="1")
expect(f"a command while it is unlocked: {reply}", reply["status"] == 0)
page.send({"type": "lock"})
refused("a command after it is locked again")
print("\n".join(wrong))
sys.exit(1 if wrong else 0)
