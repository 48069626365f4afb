"""R5 to R13: the compiled step, alone and behind FMI: bits, hours, instances, threads, real time, the host."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from .programs import (
    CALIBRATED,
    calibrated,
    call_program,
    compiler,
    compilers,
    core_program,
    image,
    library,
    small,
)
from .row import ROOT, Outcome, Row, Run, called, pytest, spoken

INDEX_FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
LEVELS = ("-O0", "-O1", "-O2", "-O3", "-Os")


def models(run: Run) -> dict[str, Path]:
    """Images: the paper's finger, all that calibrate writes, two fingers with random extensions."""

    from random_fingers import random_extended, random_finger

    found = {"index": image(run, INDEX_FINGER, "index"), "calibrated": image(run, CALIBRATED, "calibrated")}
    for seed in (1, 2):
        description = random_extended(seed, random_finger(seed))
        found[f"extended{seed}"] = image(run, description, f"extended{seed}")
    return found


def restored(run: Run) -> Outcome:
    program = core_program(run, "O2", ["-O2"], compiler("gcc", "clang"))
    tried = wrong = 0
    cuts = [1, 777, 4321, *range(6000, 6000 + run.count(20) * 97, 97)][: 3 + run.count(20, 0)]
    for name, model in models(run).items():
        kernels = [line.split()[0] for line in called(program, "trace", model, "10").splitlines()]
        for k, cut in enumerate(cuts):
            last, kernel = str(cut + 1500), kernels[k % len(kernels)]
            saved = run.work / f"{name}.state"
            whole = called(program, "rest", model, str(cut), last, kernel)
            called(program, "save", model, str(cut), kernel, saved)
            for other in kernels:
                tried += 1
                wrong += called(program, "continue", model, saved, str(cut), last, other) != whole
    number = (
        f"{tried} states of 4 fingers, each restored in a new process, on the kernel that saved it and on the others"
    )
    return Outcome(number, f"{wrong} differ by a bit over the next 1500 samples", wrong == 0)


def damaged(run: Run) -> Outcome:
    program = call_program(run, "O2", ["-O2"], compiler("gcc", "clang"))
    mine, other = small(run), calibrated(run)
    foreign = run.work / "other.state"
    called(program, "save", *other.words(), "500", foreign)
    older = run.work / "older.state"
    called(program, "save", *mine.words(), "700", older)
    content = bytearray(older.read_bytes())
    content[8] -= 1  # the version of a state of an FMU before this one; the checksum does not cover it
    older.write_bytes(content)
    flips = run.count(100_000)
    lines = called(program, "states", *mine.words(), "700", str(flips), foreign, older).splitlines()
    (lengths, by_length), (_, plain), (_, repaired), (files, others) = (map(int, line.split()) for line in lines)
    number = (
        f"{lengths} lengths, {flips:,} flipped bits, {flips:,} more under checksums made to fit, "
        f"{files} states of another finger and of an older version"
    )
    result = (
        f"{by_length + plain + others} wrongly taken over; {repaired:,} of those with a checksum made to fit are taken "
        "over, since the changed number is a possible one: the FMU then saves what it was given, and its next 20 "
        "samples are finite; all others are refused with no byte changed"
    )
    return Outcome(number, result, by_length + plain + others == 0)


def day(run: Run) -> Outcome:
    program = call_program(run, "O2", ["-O2"], compiler("gcc", "clang"))
    samples = run.count(86_400_000, 150_000)
    answer = called(program, "day", *small(run).words(), str(samples), "24").split()
    different, drift, largest = int(answer[0]), float(answer[1]), float(answer[2])
    heap, resident = int(answer[3]), int(answer[4])
    number = (
        f"{spoken(samples)} samples at 1 kHz ({samples / 3.6e6:.3g} h), beside an instance saved, freed and made anew "
        "24 times"
    )
    result = (
        f"{different} samples differ by a bit from those of the pieces; outputs of the last 6 s differ from the same "
        f"motion after the first hour by at most {drift:.1g}, the largest being {largest:.2g} (N·m, rad or rad/s); "
        f"in the second half the heap grows by {heap} bytes, the resident memory by {resident} KiB"
    )
    return Outcome(number, result, different == 0 and drift < 1e-6 * largest and heap <= 0 and resident < 256)


def instances(run: Run) -> Outcome:
    from leak_count import ROUNDS, least_growth

    made = run.count(100_000 // ROUNDS)
    loads = run.count(10_000 // ROUNDS)
    fmu = small(run).fmu
    used, opened = least_growth(fmu, "bare", made)
    lost, left = least_growth(fmu, "unloaded", loads)
    number = f"{ROUNDS * made:,} instances, {ROUNDS * loads:,} loads and unloads, each in {ROUNDS} equal rounds"
    result = (
        f"in the round that left least (a leak shows in each): after {made:,} instances {used} bytes and {opened} "
        f"handles, after {loads:,} loads {lost} bytes and {left} handles"
    )
    return Outcome(number, result, used < made and opened == 0 and lost < loads and left == 0)


def threads(run: Run) -> Outcome:
    clang = compiler("clang", "gcc")
    flags = ["-O1", "-g", "-fsanitize=thread", "-D__SANITIZE_THREAD__=1"]
    program, binary = call_program(run, "tsan", flags, clang), library(run, "tsan", flags, clang)
    samples = run.count(20_000)
    environment = {**os.environ, "TSAN_OPTIONS": "halt_on_error=0 exitcode=66"}
    words = [program, "threads", *small(run).words(binary), str(samples), "16"]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, env=environment)
    races = done.stderr.count("WARNING: ThreadSanitizer")
    different = int(done.stdout) if done.stdout.strip() else -1
    number = f"16 threads, an instance each, {samples:,} samples, states saved and restored in between"
    return Outcome(
        number,
        f"{races} reports of ThreadSanitizer; {different} of 16 differ from the same alone",
        races == 0 and different == 0,
    )


LOCKS = re.compile(r"pthread_|sem_|mtx_|cnd_|futex|call_once|__cxa_guard")


def real_time(run: Run) -> Outcome:
    program = call_program(run, "O2", ["-O2"], compiler("gcc", "clang"))
    steps = core_program(run, "O2", ["-O2"], compiler("gcc", "clang"))
    finger = calibrated(run)
    samples = run.count(1_000_000, 20_000)
    allocated, wrong, status, noticed = map(int, called(program, "quiet", *finger.words(), str(samples)).split())
    imported = {line.split()[-1] for line in called("nm", "-D", "--undefined-only", finger.fmu.binary).splitlines()}
    locks = sorted(name for name in imported if LOCKS.search(name))
    timed = run.count(100_000_000, 60_000)
    kernel, median, worst, longest, slow = called(
        steps, "times", image(run, CALIBRATED, "calibrated"), str(timed)
    ).split()
    number = f"{spoken(samples)} × set, step, get under seccomp; {spoken(timed)} steps timed"
    result = (
        f"{allocated} allocations, {'no' if status == 0 else 'a'} system call, {len(locks)} functions of locks among "
        f"the library's {len(imported)} imports; step ({kernel}) {median} ns, at its slowest sample {worst} ns; "
        f"with what a loaded machine adds at most {int(longest) / 1e6:.2g} ms, {float(slow):.0f} in 10⁶ above 10 µs"
    )
    return Outcome(number, result, allocated == wrong == status == 0 and noticed == -9 and not locks)


def same_bits(run: Run) -> Outcome:
    hashes: dict[str, set[str]] = {}
    fingers, samples = models(run), str(run.count(20_000, 500))
    builds = 0
    levels = LEVELS if run.scale >= 0.5 else ("-O0", "-O3")
    for name, command in compilers().items():
        for level in levels:
            program = core_program(run, name + level, [level], command)
            builds += 1
            for finger, model in fingers.items():
                for line in called(program, "trace", model, samples).splitlines():
                    hashes.setdefault(finger, set()).add(line.split()[1])
    kernels = [line.split()[0] for line in called(program, "trace", fingers["index"], "10").splitlines()]
    apart = sum(len(each) - 1 for each in hashes.values())
    number = (
        f"{', '.join(compilers())} × {', '.join(levels)} × kernels {', '.join(kernels)}: {builds * len(kernels)} ways, "
        f"{samples} samples of {len(fingers)} fingers"
    )
    return Outcome(number, f"{apart} results differ by a bit", apart == 0)


def comma_locale(run: Run) -> tuple[str | None, dict[str, str]]:
    """A locale with a decimal comma, and the environment to find it in."""
    if shutil.which("localedef") is None or not Path("/usr/share/i18n/locales/de_DE").exists():
        return None, {}
    folder = run.work / "locales"
    folder.mkdir(exist_ok=True)
    subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", folder / "de_DE.UTF-8"], capture_output=True)
    return "de_DE.UTF-8", {"LOCPATH": str(folder), "RELIABILITY_LOCALE": "de_DE.UTF-8"}


def host(run: Run) -> Outcome:
    program = call_program(run, "O2", ["-O2"], compiler("gcc", "clang"))
    locale, environment = comma_locale(run)
    samples = run.count(20_000, 500)
    answer = called(program, "host", *calibrated(run).words(), str(samples), env={**os.environ, **environment}).split()
    modes, calls, changed = map(int, answer[:3])
    number = f"{spoken(calls)} calls in {modes} floating-point modes (rounding × flush to zero), locale {locale or 'C'}"
    result = (
        f"{changed} calls changed rounding, masks, x87 word, locale, current folder, umask or SIGFPE; "
        f"outputs in other modes differ by at most {float(answer[3]):.1g}, the largest being {float(answer[4]):.2g} "
        "(N·m, rad or rad/s)"
    )
    return Outcome(number, result, changed == 0)


def exports(run: Run) -> Outcome:
    files = ("python_tests/fmu/test_fmu_library.py", "python_tests/simulate/test_plant_fmu_host.py")
    passed, failed, note = pytest(run, *files, "-k", "export or needs or stack")
    return Outcome(
        f"{passed + failed} tests of both libraries{note}",
        f"{passed} pass: fmi2* alone, libc and libm alone, no executable stack",
        failed == 0,
    )


def emulated(run: Run) -> Outcome:
    ready = run.work / "portable" / "binaries"
    if not ready.is_dir():
        called(sys.executable, ROOT / "tools" / "portable_binaries.py", ready.parent)
    words = ("python_tests/fmu/test_portable_binaries.py", "-m", "long or not long", "-k", "bits_of_the_native_one")
    passed, failed, note = pytest(run, *words, environment={"TENDONFMU_PORTABLE_BINARIES": str(ready)})
    systems = "Linux x86-64 (zig), aarch64 under qemu, Windows under wine"
    number = f"{passed + failed} libraries: {systems}; the reference trace{note}"
    return Outcome(number, f"{passed} give the bits of the native one", failed == 0 and "skipped" not in note)


ROWS = [
    Row(
        "R5",
        "Saved state restored in a new process and on the other kernel",
        "368 states",
        "states carried between machines of another kind (the step's bits are the same there: R20)",
        restored,
    ),
    Row(
        "R6",
        "Saved states of every length, with flipped bits, of another finger, of an older version",
        "2e5 flips",
        "two wrong bits at once; FNV-1a finds what happens by accident, not what is forged",
        damaged,
    ),
    Row("R7", "A day of samples", "8.64e7 samples", "a motion that repeats; months", day),
    Row("R8", "Instances and loads", "1e5 and 1e4", "the simulated finger's library", instances),
    Row(
        "R9",
        "Instances on threads",
        "16 × 20,000",
        "races in an importer; one instance on two threads, which FMI forbids",
        threads,
    ),
    Row(
        "R10",
        "Real time",
        "1e8 steps",
        "worst case on a quiet machine with a real-time kernel; page faults at the first step",
        real_time,
    ),
    Row(
        "R11",
        "Same bits by every compiler",
        "20,000 samples",
        "MSVC, which no machine here has; -ffast-math, which the sources do not allow",
        same_bits,
    ),
    Row("R12", "The host's modes", "20,000 samples", "traps that the host unmasks", host),
    Row("R13", "Exports", "all", "macOS libraries are read, not loaded", exports),
    Row("R20", "Windows and aarch64", "all", "real Windows and real ARM; macOS", emulated),
]
