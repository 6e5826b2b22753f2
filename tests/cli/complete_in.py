"""What a shell makes of TAB: complete_in.py SHELL SCRIPT FOLDER TEXT

Starts a real bash, zsh or fish on a terminal of its own, in FOLDER and with FOLDER first in PATH, has it load SCRIPT,
types TEXT (TABs in it are keys) and Enter. FOLDER has a program `berth` that writes its words to FOLDER/words, one a
line; they are printed. Status 3: no such shell, 1: the program was not run within a minute.
"""
import os
import pty
import select
import shutil
import sys
import time

shell, script, folder, text = sys.argv[1:5]
START = {
    "bash": (["--norc", "--noprofile", "-i"], f"source '{script}'\n"),
    "zsh": (["-f", "-i"], f"autoload -Uz compinit; compinit -u -D; source '{script}'\n"),
    "fish": (["--no-config", "-i"], f"source '{script}'\n"),
}


def main():
    program = shutil.which(shell)
    if program is None:
        print(f"no {shell}")
        return 3
    words = os.path.join(folder, "words")
    options, start = START[shell]
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(folder)
        os.environ.update({"PATH": folder + ":" + os.environ["PATH"], "TERM": "xterm", "HOME": folder, "PS1": "$ "})
        os.environ.pop("BASH_ENV", None)
        os.execv(program, [program, *options])
    seen, typed = b"", [start + "echo rea''dy\n", text + "\n"]
    end = time.monotonic() + 60
    while time.monotonic() < end and not os.path.exists(words):
        if select.select([terminal], [], [], 0.05)[0]:
            try:
                seen += os.read(terminal, 65536)
            except OSError:
                break
        # The next line only when the shell has done the one before: it throws away what is typed while it starts.
        if len(typed) == 2 and any(prompt in seen for prompt in (b"$ ", b"> ", b"% ", b"# ")):
            os.write(terminal, typed.pop(0).encode())
        elif len(typed) == 1 and b"\nready" in seen.replace(b"\r", b"\n"):
            os.write(terminal, typed.pop(0).encode())
    os.close(terminal)
    if not os.path.exists(words):
        print(seen.decode(errors="replace"), file=sys.stderr)
        return 1
    with open(words) as file:
        sys.stdout.write(file.read())
    return 0


sys.exit(main())
