"""Before the build: the build's name, and what build_flags cannot tell the linker.

PlatformIO runs this before its platform's own script. It writes impid_build_id.h (see core/impid_build.h).
"""

import subprocess
from pathlib import Path

Import("env")

PROJECT = env.subst("$PROJECT_DIR")
# What an image is made of: changes elsewhere in the checkout leave it as it is.
SOURCES = ("firmware", "platformio.ini", "protocol")
MODIFIED, KNOWN = 1, 2


def git(*arguments):
    """What git says; None where there is no git or no checkout."""
    try:
        done = subprocess.run(["git", "-C", PROJECT, *arguments], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


commit = git("rev-parse", "HEAD")
state = (KNOWN if commit else 0) | (MODIFIED if git("status", "--porcelain", "--", *SOURCES) else 0)
text = f"#define IMPID_BUILD_COMMIT 0x{(commit or '0')[:8]}u\n#define IMPID_BUILD_SOURCE {state}u\n"
header = Path(env.subst("$BUILD_DIR")) / "build_id" / "impid_build_id.h"
header.parent.mkdir(parents=True, exist_ok=True)
if (
    not header.is_file() or header.read_text(encoding="utf-8") != text
):  # or everything behind it is built anew
    header.write_text(text, encoding="utf-8")
env.Append(
    CPPPATH=[str(header.parent)],
    # The start is ours, newlib is the small one.
    LINKFLAGS=["-nostartfiles", "--specs=nano.specs"],
)
