/* CRC-32 as in zlib, Ethernet and PNG (reflected polynomial 0xEDB88320; "123456789" gives 0xCBF43926).
 *
 * Data flow: bytes in, checksum out. Ownership: none. Timing: one table look-up a byte, 4 instructions on the
 * chip; the table of 256 entries takes 1 KiB of flash. Can fail: no.
 */
#ifndef IMPID_CRC32_H
#define IMPID_CRC32_H

#include <stddef.h>
#include <stdint.h>

uint32_t impid_crc32(const uint8_t *bytes, size_t count);

#endif
