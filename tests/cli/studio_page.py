"""A page of Studio without a browser: HTTP heads and one WebSocket, for scripts that are peers in tests."""
import base64
import json
import os


def head(line, host, *more):
    return "\r\n".join([f"{line} HTTP/1.1", f"Host: {host}", *more, "", ""]).encode()


def answer(connection):
    text = b""
    while b"\r\n\r\n" not in text:
        piece = connection.recv(65536)
        if not piece:
            break
        text += piece
    return text


def upgrade(host, origin, token):
    return head("GET /api/v1/socket", host, "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
                "Sec-WebSocket-Key: " + base64.b64encode(os.urandom(16)).decode(),
                f"Sec-WebSocket-Protocol: berth.v1, token.{token}", f"Origin: {origin}")


class Page:
    """A WebSocket over a connection that stands; `ConnectionError` when it is refused or ends."""

    def __init__(self, connection, host, origin, token):
        self.connection = connection
        connection.sendall(upgrade(host, origin, token))
        text = answer(connection)
        if not text.startswith(b"HTTP/1.1 101"):
            raise ConnectionError(f"no WebSocket: {text[:200]!r}")
        self.rest = text.split(b"\r\n\r\n", 1)[1]

    def take(self, count):
        while len(self.rest) < count:
            piece = self.connection.recv(65536)
            if not piece:
                raise ConnectionError("the server hung up")
            self.rest += piece
        out, self.rest = self.rest[:count], self.rest[count:]
        return out

    def message(self):
        text = b""
        while True:
            first, size = self.take(2)
            size &= 127
            if size > 125:
                size = int.from_bytes(self.take(2 if size == 126 else 8), "big")
            text += self.take(size)
            if first & 0x80:
                return json.loads(text) if first & 15 < 8 else {"type": "control"}

    def next(self, kind, so=lambda message: True):
        while (message := self.message())["type"] != kind or not so(message):
            pass
        return message

    def send(self, message):
        text = json.dumps(message).encode()
        size = bytes([0x80 | len(text)]) if len(text) < 126 else bytes([0xFE]) + len(text).to_bytes(2, "big")
        self.connection.sendall(b"\x81" + size + bytes(4) + text)

    def ask(self, verb, **arguments):
        self.send({"type": "request", "id": verb, "verb": verb, "arguments": arguments})
        return self.next("reply", lambda message: message["id"] == verb)
