"""Python imports this file first where its folder is in PYTHONPATH: it hides what Windows or macOS lacks.

The environment variable OTHER_SYSTEM is `windows` or `macos`. Processes that this one starts inherit both. Modules of
Python itself, and of rich, that choose by `sys.platform` are loaded before: the names are hidden from other code.
"""

import os
import sys

WINDOWS = {
    "modules": (
        "fcntl", "resource", "pty", "tty", "termios", "grp", "pwd", "syslog", "readline", "_posixshmem",
    ),
    "os": (
        "fork", "forkpty", "getuid", "geteuid", "getgid", "getegid", "sched_getaffinity", "sched_setaffinity",
        "sched_setscheduler", "sched_param", "SCHED_FIFO", "SCHED_OTHER", "openpty", "ttyname", "pread", "pwrite",
        "pipe2", "memfd_create", "eventfd", "pidfd_open", "killpg", "setsid", "fchmod", "fchown", "chown", "mkfifo",
        "sysconf", "wait", "WNOHANG", "O_NOFOLLOW", "O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY", "RTLD_NOW", "RTLD_NOLOAD",
        "posix_spawn", "nice", "getloadavg",
    ),
    "signal": (
        "SIGKILL", "SIGHUP", "SIGALRM", "SIGCHLD", "SIGCONT", "SIGSTOP", "SIGQUIT", "SIGPIPE", "SIGUSR1", "SIGUSR2",
        "SIGXCPU", "SIGPROF", "SIGWINCH", "SIG_BLOCK", "SIG_UNBLOCK", "SIG_SETMASK", "pthread_sigmask", "pthread_kill",
        "setitimer", "alarm", "sigwait", "siginterrupt", "pause",
    ),
    "socket": ("AF_UNIX", "AF_CAN", "AF_NETLINK", "SO_PEERCRED", "MSG_DONTWAIT", "SCM_RIGHTS", "SO_REUSEPORT"),
    "select": ("poll", "epoll", "kqueue", "POLLIN", "POLLOUT", "POLLHUP", "POLLERR", "POLLNVAL", "EPOLLIN"),
    "mmap": ("MAP_SHARED", "MAP_ANONYMOUS", "PROT_READ", "PROT_WRITE"),
    "time": ("clock_gettime", "clock_gettime_ns", "CLOCK_MONOTONIC"),
}  # fmt: skip
MACOS = {
    "modules": ("_posixshmem",),
    "os": (
        "sched_getaffinity", "sched_setaffinity", "sched_setscheduler", "sched_param", "pipe2", "memfd_create",
        "eventfd", "pidfd_open",
    ),
    "signal": ("pidfd_send_signal", "sigtimedwait", "sigwaitinfo", "SIGRTMIN", "SIGRTMAX"),
    "socket": ("AF_CAN", "AF_NETLINK", "AF_PACKET", "SO_PEERCRED"),
    "select": ("epoll", "EPOLLIN"),
    "mmap": ("MAP_POPULATE",),
    "time": (),
}  # fmt: skip
# They choose by the platform when they are loaded.
LOADED_BEFORE = (
    "asyncio", "concurrent.futures.process", "ctypes.util", "getpass", "multiprocessing.connection",
    "multiprocessing.resource_tracker", "platform", "selectors", "shutil", "socket", "socketserver", "ssl",
    "subprocess", "tempfile", "urllib.request", "uuid", "webbrowser", "zoneinfo", "rich.console",
)  # fmt: skip


def of_windows():
    """Of the module `msvcrt` the lock of a file's byte, which another process gets PermissionError for."""
    import fcntl
    import types

    def locking(descriptor, mode, count):
        assert mode == library.LK_NBLCK and count == 1
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise PermissionError(13, "Permission denied") from None

    library = types.ModuleType("msvcrt")
    library.LK_NBLCK, library.locking = 2, locking
    return library


def hide(lacking, platform):
    """Remove the names, and the folder /proc; `sys.platform` is what that system reports."""
    import builtins
    import contextlib
    import importlib
    import signal
    import subprocess
    import types

    for name in LOADED_BEFORE:
        importlib.import_module(name)
    with contextlib.suppress(ImportError):  # it lists the libraries of the process by calls of the real system
        lister = importlib.import_module("threadpoolctl")
        lister.sys, lister.open = types.SimpleNamespace(**vars(sys)), open
    if platform == "win32":
        sys.modules["msvcrt"] = of_windows()
        __import__("io")._WindowsConsoleIO = type("_WindowsConsoleIO", (), {})  # pytest looks whether a stream is one
        subprocess.Popen.kill = lambda process: process.send_signal(9)
        subprocess.Popen.terminate = lambda process: process.send_signal(15)
        of_process = subprocess.Popen.__init__

        def start(process, *arguments, **settings):
            for unknown in ("preexec_fn", "pass_fds"):
                if settings.get(unknown):
                    raise ValueError(f"{unknown} is not supported on Windows platforms")
            of_process(process, *arguments, **settings)

        subprocess.Popen.__init__ = start
    for module in lacking["modules"]:
        sys.modules[module] = None
    for module in ("os", "signal", "socket", "select", "mmap", "time"):
        library = importlib.import_module(module)
        for name in lacking[module]:
            if hasattr(library, name):
                delattr(library, name)
    if platform == "win32":
        import socket

        if hasattr(socket, "_fallback_socketpair"):
            socket.socketpair = socket._fallback_socketpair
    else:
        kind = __import__("socket").socket
        of_socket = kind.bind, kind.connect

        def without_abstract(method):
            def call(connection, address):
                if isinstance(address, str | bytes) and address[:1] in ("\0", b"\0"):
                    raise FileNotFoundError(2, "No such file or directory")
                return method(connection, address)

            return call

        kind.bind, kind.connect = map(without_abstract, of_socket)
    opened = builtins.open

    def without_proc(file, *arguments, **settings):
        if str(file).startswith("/proc/"):
            raise FileNotFoundError(2, "No such file or directory", str(file))
        return opened(file, *arguments, **settings)

    builtins.open = __import__("io").open = without_proc
    valid = signal.valid_signals()
    if platform == "win32":
        signal.valid_signals = lambda: {number for number in valid if number in (2, 4, 6, 8, 11, 15)}
    sys.platform = platform


if os.environ.get("OTHER_SYSTEM") == "windows":
    hide(WINDOWS, "win32")
elif os.environ.get("OTHER_SYSTEM") == "macos":
    hide(MACOS, "darwin")
