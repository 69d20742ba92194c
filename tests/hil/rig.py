#!/usr/bin/env python3
"""Runs a test in a QEMU guest that has Debian's kernel and, read-only, the host's files. Started by tests/hil/run.

The guest's root is the host's / over 9p with a memory overlay, so it runs what was just built and leaves nothing behind. A second
9p folder takes the test's exit code and files out. Nothing is downloaded, and no disk image is made.
"""
import argparse
import gzip
import lzma
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent
SKIPPED = 77
# What the first file system needs to reach the host's: the modules, and those that they need.
MODULES = ("virtio_pci", "9p", "9pnet_virtio", "overlay", "virtio_console")
# No rep movsb: QEMU's interpreter would go byte by byte.
TCG_CPU = "max,la57=off,erms=off,fsrm=off"
KERNEL_ARGUMENTS = "console=ttyS0 panic=-1 quiet mitigations=off nokaslr audit=0 tsc=reliable"


def skip(reason):
    print(f"skipped: hil: {reason}")
    sys.exit(SKIPPED)


def guest_kernel():
    """The newest kernel of which both image and modules are installed."""
    found = [path.name for path in Path("/lib/modules").glob("*") if Path(f"/boot/vmlinuz-{path.name}").exists()]
    if not found:
        skip("no kernel with its modules is installed (package linux-image-amd64)")
    return max(found, key=lambda name: [int(part) for part in re.findall(r"\d+", name)])


def module_files(kernel):
    """Files of MODULES and of what they need, in the order in which they can be loaded."""
    files = []
    for module in MODULES:
        lines = subprocess.run(["modprobe", "-S", kernel, "--show-depends", module], check=True, capture_output=True,
                               text=True).stdout.splitlines()
        files += [line.split()[1] for line in lines if line.startswith("insmod")]
    return [Path(name) for name in dict.fromkeys(files)]


def cpio(entries):
    """An archive of (name, mode, content), as the kernel unpacks it (format newc)."""
    archive = bytearray()
    for number, (name, mode, content) in enumerate([*entries, ("TRAILER!!!", 0, b"")], 1):
        fields = (number, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name) + 1, 0)
        archive += b"070701" + "".join(f"{field:08x}" for field in fields).encode() + name.encode() + b"\0"
        archive += bytes(-len(archive) % 4) + content
        archive += bytes(-len(archive) % 4)
    return bytes(archive)


def initial_files(kernel):
    folder, program, text = 0o040755, 0o100755, 0o100644
    entries = [(name, folder, b"") for name in ("bin", "dev", "proc", "sys", "lower", "rw", "newroot", "modules")]
    entries.append(("bin/busybox", program, Path(shutil.which("busybox")).read_bytes()))
    entries.append(("init", program, (HERE / "guest/init").read_bytes()))
    modules = module_files(kernel)
    entries += [(f"modules/{path.name}", text, path.read_bytes()) for path in modules]
    entries.append(("modules/order", text, "".join(f"{path.name}\n" for path in modules).encode()))
    return gzip.compress(cpio(entries), 1)


def uncompressed(image):
    """The kernel inside a bzImage (Documentation/x86/boot.rst): started so, it need not unpack itself under emulation."""
    setup_sectors = image[0x1f1] or 4
    offset, length = struct.unpack_from("<II", image, 0x248)
    begin = (setup_sectors + 1) * 512 + offset
    payload = image[begin:begin + length]
    if payload.startswith(b"\xfd7zXZ"):
        return lzma.LZMADecompressor().decompress(payload)
    if payload.startswith(b"\x1f\x8b"):
        return gzip.decompress(payload[:-4])
    return None


def boot_files(kernel, cache):
    """Paths of kernel and first file system, made anew where what they come from is newer."""
    cache.mkdir(parents=True, exist_ok=True)
    image, first = cache / f"kernel-{kernel}", cache / f"initrd-{kernel}.gz"
    source = Path(f"/boot/vmlinuz-{kernel}")
    if not image.exists() or image.stat().st_mtime < source.stat().st_mtime:
        packed = source.read_bytes()
        image.write_bytes(uncompressed(packed) or packed)
    first.write_bytes(initial_files(kernel))
    return image, first


def accelerator():
    """KVM where the processor virtualises by itself; a KVM without that cannot boot a stock kernel.

    Else an emulated processor, whose clock is its own instructions, a nanosecond each: a busy host makes the guest slower, not late.
    """
    flags = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    if os.access("/dev/kvm", os.W_OK) and re.search(r"\b(vmx|svm)\b", flags):
        return ["-accel", "kvm", "-cpu", "host"]
    return ["-accel", "tcg,thread=single,tb-size=512", "-icount", "shift=0,sleep=on", "-cpu", TCG_CPU]


def shared_folder(name, path, mode):
    return ["-fsdev", f"local,id={name},path={path},security_model=none,multidevs=remap{mode}",
            "-device", f"virtio-9p-pci,fsdev={name},mount_tag={name}"]


def run_guest(arguments, command, files):
    kernel, first = boot_files(guest_kernel(), arguments.build / "hil")
    (files / "command").write_text(command, encoding="utf-8")
    log, output = files / "console.log", os.dup(sys.stdout.fileno())
    qemu = ["qemu-system-x86_64", *accelerator(), "-machine", "q35,usb=off", "-smp", str(arguments.cpus), "-m", "1024",
            "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot", "-kernel", kernel, "-initrd", first,
            "-append", KERNEL_ARGUMENTS, "-serial", f"file:{log}", "-device", "virtio-rng-pci",
            *shared_folder("root", "/", ",readonly=on"), *shared_folder("files", files, ""),
            "-device", "virtio-serial-pci", "-add-fd", f"fd={output},set=1",
            "-chardev", "file,id=out,path=/dev/fdset/1,append=on",
            "-device", "virtserialport,chardev=out,name=hil.out"]
    try:
        subprocess.run(qemu, check=False, stdin=subprocess.DEVNULL, pass_fds=[output], timeout=arguments.timeout)
    except subprocess.TimeoutExpired:
        print(f"the guest did not end within {arguments.timeout} s; the end of its console:")
        print("".join(log.read_text(errors="replace").splitlines(keepends=True)[-20:]))
        return 1
    result = files / "exit_code"
    if not result.exists():
        print("the guest ended without a result; the end of its console:")
        print("".join(log.read_text(errors="replace").splitlines(keepends=True)[-20:]))
        return 1
    return int(result.read_text(encoding="utf-8"))


def main():
    parser = argparse.ArgumentParser(description="Runs one test in a virtual machine.")
    parser.add_argument("test", help="name of a tests/hil/TEST_guest.py")
    parser.add_argument("--build", type=Path, default=PROJECT / "build/release", help="folder of the build")
    parser.add_argument("--keep", type=Path, help="folder for console, kernel log and the test's files")
    parser.add_argument("--cpus", type=int, default=1, help="processors of the guest")
    parser.add_argument("--timeout", type=float, default=1500, help="seconds")
    arguments = parser.parse_args()
    arguments.build = arguments.build.resolve()
    script = HERE / f"{arguments.test}_guest.py"
    if not script.exists():
        parser.error(f"no test {arguments.test}; there are: " +
                     ", ".join(sorted(path.name.removesuffix("_guest.py") for path in HERE.glob("*_guest.py"))))
    if os.geteuid() != 0:
        skip("the guest's files are the host's, some of which only root can read")
    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder)
        shutil.copy(HERE / "guest/first", files)
        data = arguments.build / "hil/data"
        prepare = script.with_name(f"{arguments.test}_prepare.sh")
        if prepare.exists() and subprocess.run([prepare, arguments.build, data], check=False).returncode != 0:
            return 1
        code = run_guest(arguments, f"exec python3 -B {script} {arguments.build} {data}\n", files)
        if arguments.keep:
            shutil.copytree(files, arguments.keep, dirs_exist_ok=True)
        return code


if __name__ == "__main__":
    sys.exit(main())
