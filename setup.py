"""Everything that pyproject.toml cannot say: the C extension of the simulator."""

from setuptools import setup

setup(cffi_modules=["hil_sim/native_build.py:ffibuilder"])
