"""Packages of messages of any size, the same for the same seed, much as people write them."""

import random
from pathlib import Path

PRIMITIVES = (
    "bool", "byte", "char", "float32", "float32", "float64", "float64", "int8", "uint8", "int16", "uint16",
    "int32", "uint32", "uint32", "int64", "uint64", "uint64", "string", "string", "string<=16",
)  # fmt: skip
OTHERS = ("std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Pose", "geometry_msgs/Vector3")
COLLECTIONS = ("", "", "", "", "", "[]", "[3]", "[<=8]")
WORDS = "front left rear wheel motor arm battery speed limit error count mode target state age".split()
UNITS = ("", "", "  # [m]", "  # [rad/s]", "  # what it is now", "  # since the start [s]")


def write_definitions(folder: Path, messages: int, seed: int = 1, *, others: bool = True) -> Path:
    """Write as many .msg files below `folder`; each may refer to earlier ones, and to `others`' packages.

    Return the folder.
    """
    chance = random.Random(seed)
    (folder / "msg").mkdir(parents=True)
    names: list[str] = []
    for number in range(messages):
        name = "".join(word.title() for word in chance.sample(WORDS, 2)) + f"{number}"
        (folder / "msg" / f"{name}.msg").write_text(
            _message(chance, names, OTHERS if others else PRIMITIVES), encoding="utf-8"
        )
        names.append(name)
    return folder


def _message(chance: random.Random, earlier: list[str], others: tuple[str, ...]) -> str:
    lines = ["# One of many messages that measure how long it takes to compile them.", ""]
    constants = chance.randrange(6) if chance.random() < 0.4 else 0
    lines += [f"uint8 {chance.choice(WORDS).upper()}_{number} = {number}" for number in range(constants)]
    for number in range(chance.randrange(3, 16)):
        kind = chance.random()
        type_ = chance.choice(others if kind < 0.1 else earlier if kind < 0.2 and earlier else PRIMITIVES)
        name = f"{chance.choice(WORDS)}_{chance.choice(WORDS)}_{number}"
        lines.append(f"{type_}{chance.choice(COLLECTIONS)} {name}{chance.choice(UNITS)}")
    return "\n".join(lines) + "\n"
