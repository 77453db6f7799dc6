"""Processes that need not load the libraries: forked from one that has loaded them.

``Forked`` is ``subprocess.Popen`` for ``python -m MODULE``, ``python -c CODE`` and scripts. What it
starts is a process like any other: it has its own arguments, environment, folder, streams, signals
and exit status. But it is not a new interpreter, and ``/proc`` shows the arguments and environment
of the server: what needs either is tested with others.

The server is this file as a script. It is started when it is first needed, and ends with the
process that has started it.
"""

import atexit
import contextlib
import functools
import gc
import importlib
import inspect
import json
import os
import random
import re
import runpy
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import types
from pathlib import Path

ADDRESS = "BOTOHE_TEST_FORKS"  # variable of the environment: the server's socket
_HEADER = struct.Struct("<q")
_PATH = "PYTHONPATH"
# Variables of the environment that are read when an interpreter or a library starts.
_READ_AT_START = re.compile(r"PYTHON(?!PATH$)|NUMBA_(?!NUM_THREADS$)|LC_|LANG|LD_")


class Forked(subprocess.Popen):
    """A process that is forked from the server; its own runs are forked, too."""

    def _execute_child(self, *given):
        names = inspect.signature(super()._execute_child).parameters
        arguments = dict(zip(names, given, strict=True))
        if arguments["preexec_fn"] is not None or arguments["pass_fds"]:
            raise ValueError("What is called before a process starts needs a new interpreter.")
        env = arguments["env"]
        request = {
            "command": [os.fspath(argument) for argument in arguments["args"]],
            "cwd": os.fspath(arguments["cwd"] or Path.cwd()),
            "env": {**(os.environ if env is None else env), ADDRESS: start_server()},
            "start_new_session": bool(arguments["start_new_session"]),
        }
        child_ends = [arguments[name] for name in ("p2cread", "c2pwrite", "errwrite")]
        streams = [own if end == -1 else end for own, end in enumerate(child_ends)]
        self._server = socket.socket(socket.AF_UNIX)
        self._server.connect(start_server())
        content = json.dumps(request).encode()
        socket.send_fds(self._server, [_HEADER.pack(len(content))], streams)
        self._server.sendall(content)
        self.pid = self._receive()
        self._child_created = True
        ends = ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite")
        self._close_pipe_fds(*(arguments[name] for name in ends))

    def _receive(self):
        return _HEADER.unpack(self._server.recv(_HEADER.size, socket.MSG_WAITALL))[0]

    def _try_wait(self, wait_flags):
        """Stand in for ``os.waitpid``, for the process is the server's child."""
        if wait_flags & os.WNOHANG and not select.select([self._server], [], [], 0)[0]:
            return 0, 0
        status = self._receive()
        self._server.close()
        return self.pid, status

    def _internal_poll(self, *_, **__):
        if self.returncode is None and self._waitpid_lock.acquire(blocking=False):
            try:
                if self.returncode is None:
                    pid, status = self._try_wait(os.WNOHANG)
                    if pid:
                        self._handle_exitstatus(status)
            finally:
                self._waitpid_lock.release()
        return self.returncode


def run_forked(command, *, timeout=200, **options):
    """Do as ``subprocess.run`` does, and capture text."""
    pipe = subprocess.PIPE
    with Forked(command, stdout=pipe, stderr=pipe, text=True, **options) as process:
        out, err = process.communicate(timeout=timeout)
    return subprocess.CompletedProcess(command, process.returncode, out, err)


class ForkedSubprocess:
    """Replaces the module ``subprocess`` where the processes of runs are started."""

    Popen = Forked
    TimeoutExpired = subprocess.TimeoutExpired
    run = staticmethod(subprocess.run)


@functools.cache
def start_server():
    """Start the server unless it is there, for this process and all that it starts."""
    address = os.environ.get(ADDRESS)
    if address is None:
        address = f"{tempfile.mkdtemp(prefix='forks-')}/socket"
        one_thread = {
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "NUMBA_NUM_THREADS": "1",
            # pandas loads pyarrow where it is installed.
            "JE_ARROW_MALLOC_CONF": "background_thread:false",
        }
        server = subprocess.Popen(
            # -P: its own folder must not stand in for other modules.
            [sys.executable, "-P", __file__, address],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **one_thread},
            start_new_session=True,  # Ctrl-C is not for it
        )
        atexit.register(server.communicate)  # closes its standard input
        if not server.stdout.read(1):
            raise RuntimeError("The server of forked processes does not start.")
    return address


# From here on: the server.

_LIBRARIES = (
    "alive_progress", "matplotlib.backends.backend_agg", "pandas", "psutil",
    "rich.progress", "scipy.stats", "typer", "yaml",
)  # fmt: skip
_OURS = (
    "plots.front", "plots.mission", "solving", "study.loading", "study.report", "study.runner",
)  # fmt: skip


def load():
    """Load the libraries, this package without its command line, and its kernels."""
    from pymoo.optimize import minimize

    from botohe_moo import BOTOHE, load_mission, make_algorithm

    for name in (*_LIBRARIES, *(f"botohe_moo.{name}" for name in _OURS)):
        importlib.import_module(name)
    problem = BOTOHE(load_mission("toy"))
    for name in ("bo-aco", "nsga2", "greedy", "pareto-local-search", "random"):
        minimize(problem, make_algorithm(name), ("n_eval", 250), seed=1)


def forget():
    """Forget what this package has found out about the environment."""
    importlib.invalidate_caches()
    for name, module in list(sys.modules.items()):
        if name.startswith("botohe_moo"):
            for value in vars(module).values():
                if isinstance(value, type(functools.cache(len))):
                    value.cache_clear()


def serve(address):
    """Fork a process for each request, until standard input is closed; in it, give the request."""
    load()
    forget()
    gc.freeze()
    assert len(list(Path("/proc/self/task").iterdir())) == 1  # others would not be forked
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(address)
    listener.listen(100)
    os.write(1, b"!")
    while True:
        if sys.stdin in select.select([sys.stdin, listener], [], [])[0]:
            Path(address).unlink()
            Path(address).parent.rmdir()
            os._exit(0)
        connection, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            return fork(connection)
        connection.close()
        with contextlib.suppress(ChildProcessError):  # those that have ended
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass


def fork(connection):
    """Fork the process that is asked for, tell how it ends; in it, give the request."""
    header, streams, *_ = socket.recv_fds(connection, _HEADER.size, 3)
    content = connection.recv(_HEADER.unpack(header)[0], socket.MSG_WAITALL)
    pid = os.fork()
    if pid == 0:
        connection.close()
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
        for stream in streams:
            os.close(stream)
        return json.loads(content)
    for stream in (0, 1, 2, *streams):
        os.close(stream)
    with contextlib.suppress(OSError):  # whoever has asked is gone
        connection.sendall(_HEADER.pack(pid))
        connection.sendall(_HEADER.pack(os.waitpid(pid, 0)[1]))
    os._exit(0)


def run(request, usual_path, usual_environment):
    """Become the process that is asked for."""
    command, env = request["command"], request["env"]
    for name in {*env, *usual_environment}:
        if _READ_AT_START.match(name):
            assert env.get(name) == usual_environment.get(name), f"{name} needs a new interpreter"
    if request["start_new_session"]:
        os.setsid()
    os.chdir(request["cwd"])
    os.environ.clear()
    os.environ.update(env)
    for name, number, mode in (("stdin", 0, "r"), ("stdout", 1, "w"), ("stderr", 2, "w")):
        usual = getattr(sys, name)
        stream = open(  # noqa: SIM115
            number, mode, encoding=usual.encoding, errors=usual.errors, closefd=False,
            buffering=1 if number == 2 or os.isatty(number) else -1,
        )  # fmt: skip
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    random.seed()
    importlib.import_module("numpy").random.seed()
    fork_its_runs()

    entries = env.get(_PATH)
    sys.path[:] = [*(entries.split(os.pathsep) if entries else ()), *usual_path]
    if command[0] != sys.executable:
        sys.argv[:] = command
        sys.path.insert(0, str(Path(command[0]).parent))
        runpy.run_path(command[0], run_name="__main__")
        return
    isolated = command[1] == "-P"
    kind, what, *rest = command[1 + isolated :]
    sys.argv[:] = [kind, *rest]
    if not isolated:
        sys.path.insert(0, os.getcwd() if kind == "-m" else "")  # noqa: PTH109
    if kind == "-m":
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    else:
        assert kind == "-c", f"{kind} needs a new interpreter"
        sys.modules["__main__"] = main = types.ModuleType("__main__")
        exec(what, vars(main))


def fork_its_runs():
    """Let the processes of runs be forked, too."""
    from botohe_moo.study import pool

    pool.subprocess = ForkedSubprocess


if __name__ == "__main__":
    inherited = dict(os.environ)
    n_given = len(os.environ.get(_PATH, "").split(os.pathsep)) if os.environ.get(_PATH) else 0
    own_path = sys.path[n_given:]
    run(serve(sys.argv[1]), own_path, inherited)
