"""Build a program: what PlatformIO collects as sources, by the compiler of the board's toolchain."""

from SCons.Script import AlwaysBuild, Default, DefaultEnvironment

# Prefix of the compiler's programs by the board's build.toolchain.
TOOLCHAINS = {"native": "", "arm": "arm-none-eabi-"}

env = DefaultEnvironment()
board = env.BoardConfig()
prefix = TOOLCHAINS[board.get("build.toolchain")]
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

# What a board's processor and memory ask of compiler and linker; none of it on this machine.
env.Append(
    CCFLAGS=board.get("build.flags", []),
    LINKFLAGS=[*board.get("build.flags", []), *board.get("build.link_flags", [])],
)
if board.get("build.ldscript", ""):
    env.Replace(PROGSUFFIX=".elf", LDSCRIPT_PATH=f"$PROJECT_DIR/{board.get('build.ldscript')}")
    env.Append(LINKFLAGS=["-Wl,-Map,$BUILD_DIR/${PROGNAME}.map"])
    # For PlatformIO's own line of sizes; scripts/firmware_budget.py judges.
    env.Replace(
        SIZECHECKCMD="$SIZETOOL -A -d $SOURCES",
        SIZEPROGREGEXP=r"^(?:\.text|\.data)\s+(\d+).*",
        SIZEDATAREGEXP=r"^(?:\.stack|\.data|\.bss|\.noinit)\s+(\d+).*",
    )

program = env.BuildProgram()
AlwaysBuild(env.Alias("nobuild", program))

configs = board.get("debug.openocd_configs", [])
if configs:
    options = " ".join(f"-f {config}" for config in configs)
    env.Replace(UPLOADCMD=f'openocd {options} -c "program {{$SOURCE}} verify reset exit"')
    env.AddPlatformTarget(
        "upload",
        program,
        env.VerboseAction("$UPLOADCMD", "Flashing $SOURCE"),
        "Upload",
        "Flash through OpenOCD",
    )
Default([program, "checkprogsize"] if board.get("build.ldscript", "") else program)
