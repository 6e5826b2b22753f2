"""A node of our own on a bus that a socketcand server offers: hears every frame, sends raw ones, writes a candump log."""

import re
import socket
import threading
import time

import support
import wire

ELEMENT = re.compile(rb"<\s*(.*?)\s*>", re.S)


class Node:
    def __init__(self, test, port, name, log=None):
        self.name = name
        self.frames = []
        self.log = open(log, "w") if log else None
        self.socket = support.until(lambda: self.connect(port), f"a socketcand server at port {port}")
        self.waiting = b""
        for ask in (None, f"< open {name} >", "< rawmode >"):
            if ask:
                self.socket.sendall(ask.encode())
            answer = self.element()
            if answer not in (b"hi", b"ok"):
                raise AssertionError(f"socketcand: {ask}: {answer}")
        self.thread = threading.Thread(target=self.listen, daemon=True)
        self.thread.start()
        test.addCleanup(self.close)

    @staticmethod
    def connect(port):
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=support.PATIENCE)
        except OSError:
            return None

    def element(self):
        while True:
            found = ELEMENT.search(self.waiting)
            if found:
                self.waiting = self.waiting[found.end():]
                return found.group(1)
            more = self.socket.recv(65536)
            if not more:
                raise ConnectionError("the server closed the connection")
            self.waiting += more

    def listen(self):
        self.socket.settimeout(None)
        try:
            while True:
                words = self.element().decode().split()
                if words[0] == "frame":
                    self.add(float(words[2]), words[1], "".join(words[3:]))
        except (OSError, ValueError):
            pass

    def add(self, at, identifier, data):
        line = f"({at:.6f}) {self.name} {identifier}#{data.upper()}"
        self.frames.append(wire.Frame(line))
        if self.log:
            print(line, file=self.log, flush=True)

    def send(self, identifier, data=""):
        """`data` in hex. A server never echoes a frame to who sent it: it is added here."""
        name = f"{identifier:08X}" if identifier > 0x7FF else f"{identifier:03X}"
        raw = bytes.fromhex(data)
        self.socket.sendall(f"< send {name} {len(raw)} {' '.join(f'{byte:x}' for byte in raw)} >".encode())
        self.add(time.time(), name, data)

    def wait_for(self, identifier, data=None, since=0, what=""):
        """The first frame of this identifier, and data where given (hex, or a function of bytes), from `since` on."""
        def look():
            for frame in list(self.frames[since:]):
                if frame.id == identifier and (data is None or (data(frame.data) if callable(data)
                                                                else frame.data == bytes.fromhex(data))):
                    return frame
            return None
        try:
            return support.until(look, what)
        except AssertionError as error:
            last = "\n".join(frame.line for frame in self.frames[-40:])
            raise AssertionError(f"{error}: {identifier:03X} {data}; the last frames:\n{last}") from None

    def ask(self, identifier, data, answer, since=None):
        """Sends a frame and waits for one of another identifier that comes after it."""
        start = len(self.frames) if since is None else since
        self.send(identifier, data)
        return self.wait_for(answer, since=start)

    def close(self):
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.thread.join(5)
        self.socket.close()
        if self.log:
            self.log.close()
