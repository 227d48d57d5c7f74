"""Behind the linker: what makes images of the firmware.

Fills the header of the image in, links the objects once more for the other slot, and writes firmware.impid,
which `impid-host device update` sends to a board.
"""

import base64
import json
import re
import subprocess
import zlib
from pathlib import Path

Import("env")

MARK = 0x31544C53  # core/impid_slots.h
MODIFIED, KNOWN = 1, 2  # core/impid_build.h
# What the flash takes at once: a word of the header has so much for itself, and an image is a multiple of it.
UNIT = int(env.GetProjectOption("custom_flash_bytes", "4"))


def read_image(elf):
    """The bytes that the loader runs: what lies in flash behind the header."""
    binary = elf.with_suffix(".image")
    command = [env.subst("$OBJCOPY"), "-O", "binary", "-j", ".text", "-j", ".data", str(elf), str(binary)]
    subprocess.run(command, check=True)
    image = binary.read_bytes()
    binary.unlink()
    return image + b"\xff" * (-len(image) % UNIT)


def fill_header(elf, image):
    """Length and checksum into the header: what a probe flashes needs no trial."""
    words = (MARK, len(image), zlib.crc32(image), 1, 0, 0)
    header = elf.with_suffix(".header")
    rest = b"\xff" * (UNIT - 4)
    header.write_bytes(
        b"".join(word.to_bytes(4, "little") + (rest if word else b"\0" * len(rest)) for word in words)
    )
    subprocess.run([env.subst("$OBJCOPY"), "--update-section", f".header={header}", str(elf)], check=True)
    header.unlink()


def build_name():
    """Commit and state as the header of the build has them."""
    text = Path(env.subst("$BUILD_DIR/build_id/impid_build_id.h")).read_text(encoding="utf-8")
    commit, state = re.findall(r"define \w+ (\w+)u", text)
    return commit.removeprefix("0x").lower(), int(state)


def make_images(source, target, env):
    """Behind the linker: both images, the header of the one that is flashed, and the file of both."""
    elf = Path(str(target[0])).resolve()
    other = elf.with_name("slot_1.elf")
    linker = env.Clone()
    linker.Append(LINKFLAGS=["-Wl,--defsym=linker_slot=1", f"-Wl,-Map,{other.with_suffix('.map')}"])
    linker.Execute(linker.subst("$LINKCOM", source=source, target=env.File(str(other))))
    images = [read_image(elf), read_image(other)]
    fill_header(elf, images[0])
    commit, state = build_name()
    content = {
        "impid_firmware": 1,
        "board": env.subst("$PIOENV"),
        "commit": commit if state & KNOWN else None,
        "modified": bool(state & MODIFIED),
        "images": [
            {"slot": slot, "crc32": zlib.crc32(image), "data": base64.b64encode(image).decode()}
            for slot, image in enumerate(images)
        ],
    }
    (elf.parent / "firmware.impid").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


env.AddPostAction(
    "$BUILD_DIR/${PROGNAME}.elf", env.VerboseAction(make_images, "Making the images of both slots")
)
