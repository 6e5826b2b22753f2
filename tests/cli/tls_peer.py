#!/usr/bin/env python3
"""Peers of Studio's TLS that are not Berth: Python's ssl, curl, openssl s_client, and those who misbehave.

    tls_peer.py PORT CERTIFICATE TOKEN NAME

Prints what is not as docs/api.md says; exit status 1 then. NAME is one that the certificate is for; it need not resolve.
"""
import shutil
import socket
import ssl
import subprocess
import sys
import warnings

from studio_page import Page, answer, head, upgrade

warnings.simplefilter("ignore", DeprecationWarning)
port, certificate, token, name = int(sys.argv[1]), sys.argv[2], sys.argv[3], sys.argv[4]
PATIENCE = 60  # s, no figure of the product: a machine that does much else needs some of it
wrong = []


def expect(what, good):
    if not good:
        wrong.append(what)


def tcp():
    return socket.create_connection(("127.0.0.1", port), PATIENCE)


def trusting(lowest=ssl.TLSVersion.TLSv1_2, highest=ssl.TLSVersion.MAXIMUM_SUPPORTED):
    context = ssl.create_default_context(cafile=certificate)
    context.set_ciphers("DEFAULT@SECLEVEL=0")
    context.minimum_version, context.maximum_version = lowest, highest
    return context


def secured(context=None):
    return (context or trusting()).wrap_socket(tcp(), server_hostname=name)


def status(request):
    with secured() as connection:
        connection.sendall(request)
        return answer(connection).decode(errors="replace").split(" ")[1]


own = f"{name}:{port}"
bearer = f"Authorization: Bearer {token}"


def pages_and_hosts():
    expect("a page", status(head("GET /", own)) == "200")
    expect("the snapshot", status(head("GET /api/v1/snapshot", own, bearer)) == "200")
    expect("no token", status(head("GET /api/v1/snapshot", own)) == "401")
    expect("this computer's own name", status(head("GET /", f"127.0.0.1:{port}")) == "200")
    for host in (f"evil.example:{port}", name, f"{name}:1", f".{name}:{port}", f"x.{name}:{port}"):
        expect(f"Host {host}", status(head("GET /", host)) == "403")


def versions():
    with secured() as connection:
        expect("TLS 1.3", connection.version() == "TLSv1.3")
    with secured(trusting(highest=ssl.TLSVersion.TLSv1_2)) as connection:
        expect("TLS 1.2", connection.version() == "TLSv1.2")
    for old in (ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1):
        try:
            secured(trusting(lowest=old, highest=old)).close()
            expect(f"{old.name} is refused", False)
        except ssl.SSLError as error:
            expect(f"{old.name}: told so: {error}", "ALERT" in str(error).upper() or "VERSION" in str(error).upper())


def strangers_certificate():
    try:
        ssl.create_default_context().wrap_socket(tcp(), server_hostname=name).close()
        expect("who does not know the certificate refuses it", False)
    except ssl.SSLCertVerificationError:
        pass


def plain():
    with tcp() as connection:
        connection.sendall(head("GET /", own))
        text = answer(connection)
        expect(f"plain HTTP is told so: {text!r}", text.startswith(b"HTTP/1.1 400") and b"https" in text)
    with tcp() as connection:
        connection.sendall(b"\0" * 4096)
        connection.settimeout(PATIENCE)
        try:
            while connection.recv(4096):
                pass
        except ConnectionError:
            pass


def other_origins():
    expect("Origin http", status(upgrade(own, f"http://{own}", token)) == "403")
    expect("Origin of another", status(upgrade(own, "https://evil.example", token)) == "403")


def half_open(page):
    """More half handshakes than there are places: they keep nobody out, and none of them stays."""
    hello = ssl.MemoryBIO()
    ssl.create_default_context().wrap_bio(ssl.MemoryBIO(), hello, server_hostname=name)
    stuck = []
    for i in range(40):
        stuck.append(tcp())
        stuck[-1].sendall(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc"[: i % 10])
    expect("one more comes in", status(head("GET /", own)) == "200")
    page.send({"type": "request", "id": "a", "verb": "report", "arguments": {}})
    expect("a page that was there stays", page.next("reply")["id"] == "a")
    return stuck


def all_end(stuck):
    for connection in stuck:
        connection.settimeout(PATIENCE)
        try:
            while connection.recv(4096):
                pass
        except ConnectionError:
            pass
        except TimeoutError:
            expect("a handshake that does not go on ends", False)
            return


def command_line_clients():
    address = f"https://{own}/api/v1/snapshot"
    for tool, arguments, wanted in (
        ("curl", ["--silent", "--cacert", certificate, "--resolve", f"{own}:127.0.0.1", "-H", bearer, address], '"snapshot"'),
        ("openssl", ["s_client", "-connect", f"127.0.0.1:{port}", "-CAfile", certificate, "-verify_return_error",
                     "-verify_hostname", name], "Verification: OK"),
    ):
        if shutil.which(tool) is None:
            continue
        done = subprocess.run([tool, *arguments], input="", capture_output=True, text=True, timeout=PATIENCE)
        expect(f"{tool}: {done.stdout[:300]} {done.stderr[:300]}", wanted in done.stdout)


page = Page(secured(), own, f"https://{own}", token)
expect("the snapshot comes first", page.message()["type"] == "snapshot")
stuck = half_open(page)
for check in (pages_and_hosts, versions, strangers_certificate, plain, other_origins, command_line_clients):
    check()
all_end(stuck)
page.send({"type": "request", "id": "b", "verb": "report", "arguments": {}})
expect("the page is still there", page.next("reply")["id"] == "b")
print("\n".join(wrong))
sys.exit(1 if wrong else 0)
