"""Compiles single sources of berth/ with the options of build/test, and links test programs in which they take the place
of those in the libraries: the linker takes the first definition of each function."""
import json
import os
import pathlib
import re
import shlex
import subprocess
import tempfile
import time

SHORTEST = 60      # s, before a program counts as one that hangs
TIMES_LONGER = 10  # than without a mistake
COMMAND = "berth"
UNKNOWN = 900      # s, for a test that was never run without one


def limit(usual):
    return UNKNOWN if usual is None else max(SHORTEST, TIMES_LONGER * usual)


def run_test(path, test, most, folder, environment=None):
    """(what failed, or None; seconds) of the program at `path`, which is `test` (test_co, or test_co:Suite.Name*)."""
    program, _, only = test.partition(":")
    command = [str(path), "--gtest_fail_fast"]
    command += [f"--gtest_filter={only}"] if only else []
    start = time.monotonic()
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=most,
                              stdin=subprocess.DEVNULL, env=environment)
    except subprocess.TimeoutExpired:
        return f"{program} did not end within {most:.0f} s", most
    seconds = time.monotonic() - start
    if done.returncode == 0:
        return None, seconds
    failed = re.findall(r"^\[  FAILED  \] (\S+\.\S+?)[,.]? ", done.stdout + " ", re.MULTILINE)
    running = re.findall(r"^\[ RUN      \] (\S+)", done.stdout, re.MULTILINE)
    return failed[0] if failed else f"{running[-1] if running else program} crashed ({done.returncode})", seconds


class Folder:
    """The objects of one mistake; they and the programs go at its end."""

    def __init__(self):
        self.kept = tempfile.TemporaryDirectory(prefix="berth-mutant-")
        self.path = pathlib.Path(self.kept.name)
        self.objects = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kept.cleanup()


class Objects:
    def __init__(self, root):
        self.root = root
        self.build = root / "build/test"
        # Both definitions of a constant are in the program; that is meant here.
        options = os.environ.get("ASAN_OPTIONS", "")
        self.environment = os.environ | {"ASAN_OPTIONS": f"{options}:detect_odr_violation=0".lstrip(":")}
        listed = subprocess.run(["ninja", "-C", str(self.build), "-t", "compdb"], capture_output=True, check=True).stdout
        self.compile_commands, self.link_commands = {}, {}
        self.running_the_command = {f"test_{path.parent.name}" for path in (root / "tests").glob("*/*.?pp")
                                    if "test::binary()" in path.read_text()}
        for entry in json.loads(listed):
            if entry["output"].startswith("tests/test_") or entry["output"] == COMMAND:
                self.link_commands[entry["output"].removeprefix("tests/")] = entry["command"]
            elif entry["output"].endswith(".o") and "CMakeFiles/berth_" in entry["output"]:
                self.add_sources(entry)

    def add_sources(self, entry):
        path = self.build / entry["file"]
        sources = re.findall(r'#include "(.*)"', path.read_text()) if "/Unity/" in entry["output"] else [str(path)]
        for source in sources:
            self.compile_commands[os.path.relpath(source, self.root)] = entry["command"]

    @staticmethod
    def can_take(files):
        return all(file.startswith("berth/") and file.endswith(".cpp") for file in files)

    def compile(self, texts):
        """(folder with the objects, what the compiler said or None) for {path: text}."""
        folder = Folder()
        for number, (path, text) in enumerate(texts.items()):
            source = folder.path / f"{number}.cpp"
            source.write_text(text)
            words = [word for word in shlex.split(self.compile_commands[path]) if not word.endswith("ccache")]
            words = words[:words.index("-MD")] + ["-w", "-o", str(source) + ".o", "-c", str(source)]
            done = subprocess.run(words, cwd=self.build, capture_output=True, text=True)
            if done.returncode != 0:
                folder.__exit__()
                return None, done.stderr[-3000:]
            folder.objects.append(str(source) + ".o")
        return folder, None

    def link(self, folder, test):
        """(the program, what the linker said or None). A test that runs the command finds it with the mistake in."""
        program = test.partition(":")[0]
        if program in self.running_the_command:
            _, wrong = self.link_program(folder, COMMAND)
            if wrong:
                return None, wrong
        return self.link_program(folder, program)

    def environment_of(self, folder, test):
        runs = test.partition(":")[0] in self.running_the_command
        return self.environment | ({"BERTH_TEST_BINARY": str(folder.path / COMMAND)} if runs else {})

    def link_program(self, folder, program):
        path = folder.path / program
        if path.exists():
            return path, None
        words = shlex.split(self.link_commands[program].removeprefix(": && ").removesuffix(" && :"))
        words[words.index("-o") + 1] = str(path)
        first = next(place for place, word in enumerate(words) if word.endswith(".o"))
        words[first:first] = folder.objects + ["-Wl,--allow-multiple-definition"]
        done = subprocess.run(words, cwd=self.build, capture_output=True, text=True)
        return (path, None) if done.returncode == 0 else (None, done.stderr[-3000:])
