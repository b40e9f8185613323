#!/usr/bin/env python3
"""Runs a command as root of a user namespace of its own; nothing outside is changed. Linux 6.7 or later.

namespace.py [--qemu PROGRAM] COMMAND…   other mounts and processes; programs for arm64 are run by PROGRAM (qemu-aarch64-static)
namespace.py --boot ROOT                 systemd of the folder ROOT as process 1, with a network and control groups of its own;
                                         prints `init PID`, and ends it when it is ended itself
"""
import ctypes
import os
import signal
import subprocess
import sys

MOUNTS, USERS, PROCESSES, NAMES, IPC, NETWORK, GROUPS = (
    0x20000, 0x10000000, 0x20000000, 0x4000000, 0x8000000, 0x40000000, 0x2000000)
# The beginning of a program for arm64 (ELF of 64 bits, little endian, machine 0xb7), as binfmt_misc reads it.
BINFMT = (r":qemu-aarch64:M::\x7fELF\x02\x01\x01" + r"\x00" * 9 + r"\x02\x00\xb7\x00"
          + ":" + r"\xff" * 7 + r"\x00" + r"\xff" * 8 + r"\xfe" + r"\xff" * 3 + ":%s:OCPF")

PLAIN = r"""
mount -t proc proc /proc
if [ -n "$BINFMT" ]; then
    mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc
    printf '%s' "$BINFMT" > /proc/sys/fs/binfmt_misc/register
fi
exec "$@"
"""
BOOT = r"""
set -e
mount --make-rprivate / 2>/dev/null || mount --make-rslave /
mount --bind "$1" "$1"; cd "$1"
mount -t proc proc proc
mount -t sysfs -o ro sysfs sys 2>/dev/null || mount --rbind /sys sys
mount -t cgroup2 cgroup2 sys/fs/cgroup
mount -t tmpfs -o mode=755 tmpfs dev
for device in null zero full random urandom tty; do touch dev/$device; mount --bind /dev/$device dev/$device; done
mkdir -p dev/pts dev/shm
mount -t devpts -o newinstance,ptmxmode=0666,mode=620,gid=5 devpts dev/pts
ln -s pts/ptmx dev/ptmx
mount -t tmpfs -o mode=755 tmpfs run; mount -t tmpfs tmpfs tmp
mount -o bind,ro proc/sys proc/sys 2>/dev/null || true
mkdir -p old; pivot_root . old; umount -l /old
ip link set lo up
exec env -i container=rehearsal PATH=/usr/bin:/usr/sbin:/bin:/sbin TERM=dumb /lib/systemd/systemd \
    --log-target=console --log-level=warning --show-status=0 </dev/null
"""


def unshare(flags):
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(flags):
        sys.exit("unshare: " + os.strerror(ctypes.get_errno()))


def enter(flags, group, command):
    """Starts a command as root in new namespaces, as process 1; returns the process that waits for it."""
    entered, mapped = os.pipe(), os.pipe()
    outer = os.fork()
    if outer == 0:
        if group:
            with open(group + "/cgroup.procs", "w") as procs:
                procs.write(str(os.getpid()))
        unshare(flags)
        os.write(entered[1], b"x")
        os.read(mapped[0], 1)
        os.setgid(0)
        os.setuid(0)
        inner = os.fork()
        if inner == 0:
            os.execvp(command[0], command)
        if group:
            print("init", inner, flush=True)
        signal.signal(signal.SIGTERM, lambda *_: os.kill(inner, signal.SIGKILL))
        _, status = os.waitpid(inner, 0)
        os._exit(os.waitstatus_to_exitcode(status) & 255)
    os.read(entered[0], 1)
    for ids in ("uid_map", "gid_map"):
        with open(f"/proc/{outer}/{ids}", "w") as ids:
            ids.write("0 0 1000000\n")
    os.write(mapped[1], b"x")
    return outer


def main(arguments):
    flags = USERS | MOUNTS | PROCESSES | NAMES | IPC
    if arguments[:1] == ["--boot"]:
        base = "/sys/fs/cgroup/unified" if os.path.isdir("/sys/fs/cgroup/unified") else "/sys/fs/cgroup"
        group = f"{base}/tomoswarm-{os.getpid()}"
        os.makedirs(group)
        outer = enter(flags | NETWORK | GROUPS, group, ["bash", "-c", BOOT, "boot", arguments[1]])
    else:
        if arguments[:1] == ["--qemu"]:
            os.environ["BINFMT"] = BINFMT % os.path.abspath(arguments[1])
            arguments = arguments[2:]
        outer = enter(flags, None, ["bash", "-c", PLAIN, "namespace"] + arguments)
    signal.signal(signal.SIGTERM, lambda *_: os.kill(outer, signal.SIGTERM))
    _, status = os.waitpid(outer, 0)
    sys.exit(os.waitstatus_to_exitcode(status) & 255)


main(sys.argv[1:])
