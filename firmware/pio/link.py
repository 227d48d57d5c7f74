"""What PlatformIO's build_flags cannot tell the linker: the start is ours, newlib is the small one."""

Import("env")

env.Append(LINKFLAGS=["-nostartfiles", "--specs=nano.specs"])
