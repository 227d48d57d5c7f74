"""Build, flash and debug as ststm32 does without a framework: the same flags, names and protocols.

Flags and file names are those that PlatformIO's ststm32 gives a project without `framework`, so that a binary
does not depend on which of the two built it.
"""

from pathlib import Path

from SCons.Script import COMMAND_LINE_TARGETS, AlwaysBuild, Builder, Default, DefaultEnvironment

env = DefaultEnvironment()
board = env.BoardConfig()
cpu = f"-mcpu={board.get('build.cpu')}"
prefix = "arm-none-eabi-"

env.Replace(
    AR=f"{prefix}gcc-ar",
    AS=f"{prefix}as",
    CC=f"{prefix}gcc",
    CXX=f"{prefix}g++",
    GDB=f"{prefix}gdb",
    OBJCOPY=f"{prefix}objcopy",
    RANLIB=f"{prefix}gcc-ranlib",
    SIZETOOL=f"{prefix}size",
    ARFLAGS=["rc"],
    SIZEPROGREGEXP=r"^(?:\.text|\.data|\.rodata|\.text.align|\.ARM.exidx)\s+(\d+).*",
    SIZEDATAREGEXP=r"^(?:\.data|\.bss|\.noinit)\s+(\d+).*",
    SIZECHECKCMD="$SIZETOOL -A -d $SOURCES",
    SIZEPRINTCMD="$SIZETOOL -B -d $SOURCES",
    PROGNAME="firmware",
    PROGSUFFIX=".elf",
)
env.Append(
    CCFLAGS=["-Os", "-ffunction-sections", "-fdata-sections", "-Wall", "-mthumb", cpu],
    CPPDEFINES=[("F_CPU", "$BOARD_F_CPU")],
    LINKFLAGS=["-Os", "-Wl,--gc-sections,--relax", "-mthumb", cpu],
    LIBS=["c", "gcc", "m"],
    BUILDERS={
        "ElfToBin": Builder(
            action=env.VerboseAction("$OBJCOPY -O binary $SOURCES $TARGET", "Building $TARGET"), suffix=".bin"
        )
    },
)

if "nobuild" in COMMAND_LINE_TARGETS:
    elf, image = "$BUILD_DIR/${PROGNAME}.elf", "$BUILD_DIR/${PROGNAME}.bin"
else:
    elf = env.BuildProgram()
    image = env.ElfToBin("$BUILD_DIR/${PROGNAME}", elf)
    env.Depends(image, "checkprogsize")
AlwaysBuild(env.Alias("nobuild", image))
program = env.Alias("buildprog", image, image)
size = env.Alias("size", elf, env.VerboseAction("$SIZEPRINTCMD", "Calculating size $SOURCE"))
AlwaysBuild(size)

protocol = env.subst("$UPLOAD_PROTOCOL")
tools = board.get("debug.tools", {})


def jlink_script(source, env, **_others):
    """What J-Link's commander is to do, as a file beside the image."""
    commands = ["h", f'loadfile "{source[0]}"', "r", "q"]
    Path(env.subst("$BUILD_DIR/upload.jlink")).write_text("\n".join(commands), encoding="utf-8")


steps = []
if protocol == "jlink":
    steps.append(env.VerboseAction(jlink_script, "Writing J-Link's commands"))
    device = board.get("debug.jlink_device")
    options = "-speed 4000 -if swd -autoconnect 1 -NoGui 1"
    env.Replace(UPLOADCMD=f"JLinkExe -device {device} {options} -CommanderScript $BUILD_DIR/upload.jlink")
elif protocol == "blackmagic":
    steps.append(env.VerboseAction(env.AutodetectUploadPort, "Looking for the Black Magic probe"))
    commands = ["target extended-remote $UPLOAD_PORT", "monitor swdp_scan", "attach 1", "load"]
    commands += ["compare-sections", "kill"]
    options = " ".join(f'-ex "{command}"' for command in commands)
    env.Replace(UPLOADCMD=f"$GDB -nx --batch {options} $SOURCE")
elif protocol in tools:
    options = " ".join(tools[protocol]["server"]["arguments"])
    env.Replace(UPLOADCMD=f'openocd -d1 {options} -c "program {{$SOURCE}} verify reset; shutdown;"')
elif protocol != "custom":
    known = ", ".join(["blackmagic", "jlink", *sorted(tools)])
    env.Exit(f"upload_protocol {protocol} is not known; known are {known}")
steps.append(env.VerboseAction("$UPLOADCMD", "Uploading $SOURCE"))
AlwaysBuild(env.Alias("upload", elf, steps))

Default([program, size])
