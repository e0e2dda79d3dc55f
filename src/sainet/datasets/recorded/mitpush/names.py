"""What the name of a file of the MIT Push dataset says, and which files to take."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from sainet.datasets.recorded.files import ArchivedFile
from sainet.datasets.recorded.mitpush.disk import DISK, NO_DISKS, SPEED_RANGE

SMALLEST = 100  # bytes: files below are the remains of recordings that failed
ENDINGS = (".json", ".h5")  # of the same push, the first is taken
_NAME = re.compile(
    r"motion_surface=(?P<surface>[A-Za-z0-9.-]+)_shape=(?P<shape>[A-Za-z0-9.-]+)"
    r"_a=(?P<acceleration>-?\d{1,6})_v=(?P<speed>-?\d{1,6})"
    r"_(?P<place>i=-?\d+\.\d{3}_s=-?\d+\.\d{3}_t=-?\d+\.\d{3})(_rep=\d{4,})?\.(h5|json)",
    re.ASCII,
)


@dataclass(frozen=True)
class MotionFile:
    """A file that holds one push, and what its name says of it."""

    file: ArchivedFile
    surface: str
    shape: str
    acceleration: int  # mm/s^2
    speed: int  # mm/s; -1 of a push that accelerates
    plan: str  # surface, side, contact and direction: alike of repeats

    @property
    def push(self) -> str:
        """What names the push, whatever the kind of file."""
        return self.file.name.rpartition(".")[0]

    @property
    def group(self) -> str:
        """Surface and speed (mm/s)."""
        return f"{self.surface}-{self.speed}"


def choose(
    files: Sequence[ArchivedFile],
) -> tuple[list[MotionFile], Counter[str]]:
    """Return the pushes that can be modelled, by name, and why others were left out."""
    skipped: Counter[str] = Counter()
    chosen: dict[str, MotionFile] = {}
    recordings = [file for file in files if file.name.endswith(ENDINGS)]
    for file in sorted(recordings, key=_order):
        motion = _parse(file)
        reason = _reason(motion, file)
        if motion is None or reason:
            skipped[reason] += 1
        elif motion.push in chosen:
            skipped["the same push in another file"] += 1
        else:
            chosen[motion.push] = motion
    return list(chosen.values()), skipped


def _order(file: ArchivedFile) -> tuple[str, int, str]:
    stem, _, ending = file.name.rpartition(".")
    return stem, ENDINGS.index("." + ending), str(file)


def _parse(file: ArchivedFile) -> MotionFile | None:
    match = _NAME.fullmatch(file.name)
    if match is None:
        return None
    return MotionFile(
        file=file,
        surface=match["surface"],
        shape=match["shape"],
        acceleration=int(match["acceleration"]),
        speed=int(match["speed"]),
        plan=f"{match['surface']}_{match['place']}",
    )


def _reason(motion: MotionFile | None, file: ArchivedFile) -> str:
    """Say why a file is left out; nothing when it is taken."""
    if motion is None:
        return "named unlike a push of this dataset"
    if motion.shape != DISK:
        known = "no disk" if motion.shape in NO_DISKS else "an unknown shape"
        return f"shape {motion.shape}: {known}"
    if motion.acceleration != 0 or motion.speed <= 0:
        return "accelerated"
    if not SPEED_RANGE[0] <= motion.speed <= SPEED_RANGE[1]:
        return "a speed beyond 1 to 1000 mm/s"
    return "under 100 bytes" if file.size < SMALLEST else ""
