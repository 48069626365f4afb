"""R5 to R11: the compiled step, alone and behind FMI: bits, hours, threads, real time."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

from evidence.reliability.programs import (
    CALIBRATED,
    HERE,
    Packed,
    calibrated,
    call_program,
    compiler,
    compilers,
    core_program,
    image,
    library,
    small,
)
from evidence.reliability.row import Measure, Outcome, Run, called, spoken
from evidence.runner import EXAMPLES, INDEX_FINGER

FINGERS = (
    INDEX_FINGER,
    CALIBRATED,
    HERE / "small_finger.json",
    EXAMPLES / "demo_recording" / "two_joints.json",
)
LEVELS = ("-O0", "-O1", "-O2", "-O3", "-Os")


def models(run: Run) -> dict[str, Path]:
    """Images: the paper's finger, all that calibrate writes, two small ones with extensions and without."""
    return {finger.stem: image(run, finger) for finger in FINGERS}


def steps_program(run: Run) -> Path:
    return core_program(run, "O2", ["-O2"], compiler("gcc", "clang"))


def answers(run: Run, what: str, finger: Packed, *words: object, **options: object) -> list[str]:
    """What fmu_calls prints."""
    program = call_program(run, "O2", ["-O2"], compiler("gcc", "clang"))
    return called(program, what, *finger.words(), *map(str, words), **options).split()


def restored(run: Run) -> Outcome:
    program = steps_program(run)
    tried = wrong = 0
    cuts = [1, 777, 4321, *range(6000, 6000 + run.count(20) * 97, 97)][: 3 + run.count(20, 0)]
    for name, model in models(run).items():
        kernels = [line.split()[0] for line in called(program, "trace", model, "10").splitlines()]
        for k, cut in enumerate(cuts):
            last, kernel = str(cut + 1500), kernels[k % len(kernels)]
            saved = run.work / f"{name}.state"
            whole = called(program, "continue", model, "-", str(cut), last, kernel)
            called(program, "save", model, str(cut), kernel, saved)
            for other in kernels:
                tried += 1
                wrong += called(program, "continue", model, saved, str(cut), last, other) != whole
    number = (
        f"{tried} states of 4 fingers, each restored in a new process, on the kernel that saved it and on the others"
    )
    return Outcome(number, f"{wrong} differ by a bit over the next 1500 samples", wrong == 0)


def damaged(run: Run) -> Outcome:
    finger, foreign, older = small(run), run.work / "other.state", run.work / "older.state"
    answers(run, "save", calibrated(run), 500, foreign)
    answers(run, "save", finger, 700, older)
    content = bytearray(older.read_bytes())
    content[8] -= 1  # the version of a state of an FMU before this one; the checksum does not cover it
    older.write_bytes(content)
    flips = run.count(100_000)
    counts = map(int, answers(run, "states", finger, 700, flips, foreign, older))
    lengths, by_length, _, plain, _, repaired, files, others = counts
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
    samples = run.count(86_400_000, 150_000)
    answer = answers(run, "day", small(run), samples, 24)
    different, heap, resident = int(answer[0]), int(answer[3]), int(answer[4])
    drift, largest = float(answer[1]), float(answer[2])
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
    finger = calibrated(run)
    samples = run.count(1_000_000, 20_000)
    allocated, wrong, status, noticed = map(int, answers(run, "quiet", finger, samples))
    imported = {line.split()[-1] for line in called("nm", "-D", "--undefined-only", finger.binary).splitlines()}
    locks = sorted(name for name in imported if LOCKS.search(name))
    timed = run.count(100_000_000, 60_000)
    times = called(steps_program(run), "times", image(run, CALIBRATED), str(timed)).split()
    kernel, median, worst, longest, slow = times
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
    kernels = [line.split()[0] for line in called(program, "trace", fingers[INDEX_FINGER.stem], "10").splitlines()]
    apart = sum(len(different) - 1 for different in hashes.values())
    number = (
        f"{', '.join(compilers())} × {', '.join(levels)} × kernels {', '.join(kernels)}: {builds * len(kernels)} ways, "
        f"{samples} samples of {len(fingers)} fingers"
    )
    return Outcome(number, f"{apart} results differ by a bit", apart == 0)


ROWS: dict[str, Measure] = {
    "R5": restored,
    "R6": damaged,
    "R7": day,
    "R9": threads,
    "R10": real_time,
    "R11": same_bits,
}
