"""Peers and functions: which test tried which function of which peer. The runner fills the table with what came of it.

A cell is a test's, or has a reason here: what a peer can do and no test tries fails the run. docs/peers.md has the words."""

PEERS = ("npm master", "npm device", "python-can", "can-utils", "tshark")
SDO = tuple(f"SDO {how} {way}" for how in ("expedited", "segmented", "block") for way in ("upload", "download"))
SERVICES = (*SDO, "NMT", "heartbeat", "EMCY", "SYNC", "PDO", "LSS")
FUNCTIONS = (*SERVICES, "EDS load", "trace formats")
CANNOT = {
    ("npm master", "trace formats"): "reads and writes no traces",
    ("npm device", "trace formats"): "reads and writes no traces",
    ("python-can", "EDS load"): "knows frames, no descriptions",
    ("can-utils", "EDS load"): "knows frames, no descriptions",
    ("tshark", "EDS load"): "its CANopen dissector reads no descriptions",
}


def tries(peer, *functions):
    """Marks a test with what it tries. A test may have several marks."""
    unknown = [name for name in (peer,) if name not in PEERS] + [name for name in functions if name not in FUNCTIONS]
    if unknown:
        raise ValueError(f"not in the matrix: {unknown}")

    def mark(test):
        test.tries = getattr(test, "tries", ()) + tuple((peer, function) for function in functions)
        return test
    return mark


def tried_by(test):
    return getattr(getattr(test, getattr(test, "_testMethodName", "none"), None), "tries", ())


class Matrix:
    def __init__(self, tests):
        self.came = {}  # cell -> {test's name: word}
        for test in tests:
            for cell in tried_by(test):
                self.came.setdefault(cell, {})[test.id()] = "skipped"  # a class that is skipped tells of no test

    def tell(self, word, test):
        for cell in tried_by(test):
            self.came[cell][test.id()] = word

    def word(self, peer, function):
        """The passed tests' number, FAILED, skipped, - (cannot), or nothing."""
        came = self.came.get((peer, function))
        if not came:
            return "-" if (peer, function) in CANNOT else ""
        words = list(came.values())
        if "FAILED" in words:
            return "FAILED"
        return str(words.count("passed") or "skipped")

    def wrong(self):
        """Cells that nobody answers for, and those that somebody does though they have a reason not to."""
        cells = [(peer, function) for peer in PEERS for function in FUNCTIONS]
        return [f"{peer}: {function}: no test tries it, and no reason is given" for peer, function in cells
                if not self.word(peer, function)] + \
               [f"{peer}: {function}: a test tries what it is said not to do" for peer, function in CANNOT
                if (peer, function) in self.came]

    def __str__(self):
        head = f"{'passed tests of':24}" + "".join(f"{peer:>11}" for peer in PEERS)
        rows = [f"{function:24}" + "".join(f"{self.word(peer, function):>11}" for peer in PEERS) for function in FUNCTIONS]
        return "\n".join([head, *rows])
