"""Build a program: what PlatformIO collects as sources, by the compiler of the board's toolchain."""

from SCons.Script import AlwaysBuild, Default, DefaultEnvironment

# Prefix of the compiler's programs by the board's build.toolchain.
TOOLCHAINS = {"native": "", "arm": "arm-none-eabi-"}

env = DefaultEnvironment()
prefix = TOOLCHAINS[env.BoardConfig().get("build.toolchain")]
env.Replace(
    AR=f"{prefix}gcc-ar",
    AS=f"{prefix}as",
    CC=f"{prefix}gcc",
    CXX=f"{prefix}g++",
    LINK=f"{prefix}gcc",
    RANLIB=f"{prefix}gcc-ranlib",
    OBJCOPY=f"{prefix}objcopy",
    SIZETOOL=f"{prefix}size",
    ARFLAGS=["rc"],
)
# A sanitizer is linked as it is compiled.
env.Append(LINKFLAGS=[flag for flag in env.get("CCFLAGS", []) if str(flag).startswith("-fsanitize")])

program = env.BuildProgram()
AlwaysBuild(env.Alias("nobuild", program))
Default(program)
