"""What is known of a processor, for packages that are compiled for it."""

from forge.engine.world import processor

ONE = """processor\t: 0
vendor_id\t: GenuineIntel
model name\t: A processor
cpu MHz\t\t: 1234.5
flags\t\t: fpu sse2 avx2
bogomips\t: 1
"""


def test_clock_rate_and_processor_count_are_ignored() -> None:
    again = ONE.replace("1234.5", "4321.0").replace(": 0", ": 1")
    assert processor(f"{ONE}\n{again}") == processor(ONE)


def test_processor_model_and_features_are_inputs() -> None:
    assert processor(ONE.replace("avx2", "avx")) != processor(ONE)
    assert processor(ONE.replace("A processor", "B processor")) != processor(ONE)


def test_arm_processors_are_identified() -> None:
    arm = "processor\t: 0\nFeatures\t: fp asimd\nCPU implementer\t: 0x41\nCPU part\t: 0xd0c\n"
    assert processor(arm) != processor(arm.replace("0xd0c", "0xd0d"))
