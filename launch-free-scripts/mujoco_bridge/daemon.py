"""Starts a sweepd of one's own, and ends it whatever happens.

In: the path of the program, a scene file, an instance. Out: a running process, ended at the close of the context.
"""

import os
import signal
import subprocess
from pathlib import Path

from .model import Refused

END_S = 5.0
"""How long the daemon may take to end before it is killed, seconds."""


class Daemon:
    """A context: the daemon runs inside it."""

    def __init__(self, program, scene, instance):
        # Whole: what has no slash would be looked for in $PATH.
        self.command = [str(Path(program).absolute()), "run", str(scene), "--instance", instance]
        self.process = None

    def __enter__(self):
        program = self.command[0]
        if not (os.path.isfile(program) and os.access(program, os.X_OK)):
            raise Refused(f"{program} is no program: build it with cargo build --release, or name another")
        try:
            # A session of its own: Ctrl-C reaches the bridge alone, which then ends the daemon in order.
            self.process = subprocess.Popen(self.command, stdin=subprocess.DEVNULL, start_new_session=True)
        except OSError as error:
            raise Refused(f"{program} cannot be started: {error.strerror}") from None
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def require_alive(self):
        """Raises Refused when the daemon has ended by itself; its own words are on stderr."""
        code = self.process.poll()
        if code is not None:
            raise Refused(f"sweepd ended with exit code {code}: see its message above")
