/* CRC-32 as in zlib, Ethernet and PNG (reflected polynomial 0xEDB88320; "123456789" gives 0xCBF43926).
 *
 * Data flow: bytes in, checksum out. Ownership: none. Timing: two table look-ups a byte; the table has 16
 * entries because flash is dearer here than cycles. Can fail: no.
 */
#ifndef IMPID_CRC32_H
#define IMPID_CRC32_H

#include <stddef.h>
#include <stdint.h>

uint32_t impid_crc32(const uint8_t *bytes, size_t count);

#endif
