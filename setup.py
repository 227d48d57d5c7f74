"""Everything that pyproject.toml cannot say: the C extensions of the simulator."""

from setuptools import setup

setup(
    cffi_modules=[
        "hil_sim/native_build.py:ffibuilder",
        "hil_sim/board/elf/chip_build.py:ffibuilder",
    ],
    # One wheel for all Pythons from this one on: cffi keeps to the limited interface.
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
)
