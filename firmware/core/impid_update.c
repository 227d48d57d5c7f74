#include "impid_update.h"

#include "impid_assert.h"

static uint32_t read(void *context, uint32_t slot, uint32_t word) {
    const impid_update_t *update = context;
    return update->port->flash->read(update->port->flash->context, slot, word);
}

static bool program(const impid_update_t *update, uint32_t slot, uint32_t word, uint32_t value) {
    const impid_flash_t *flash = update->port->flash;
    /* Of the slot that runs only its confirmation is ever written: everything else is what a power cut must
     * leave alone. */
    IMPID_ASSERT(slot < IMPID_SLOTS && word < IMPID_SLOT_WORDS);
    IMPID_ASSERT(slot != update->port->running || word == IMPID_SLOT_AT_CONFIRMED);
    return flash->program(flash->context, slot, word, value) &&
           flash->read(flash->context, slot, word) == value;
}

void impid_update_init(impid_update_t *update, const impid_update_port_t *port) {
    *update = (impid_update_t){.port = port};
}

uint32_t impid_update_slot(const impid_update_t *update) {
    return (update->port->running + 1u) % IMPID_SLOTS;
}

impid_update_result_t impid_update_begin(impid_update_t *update, uint32_t bytes) {
    if (!impid_slots_length_fits(bytes)) {
        return IMPID_UPDATE_BAD_VALUE;
    }
    if (update->bytes == bytes && update->next == 0u) {
        return IMPID_UPDATE_OK; /* asked again while the erase held the answer up */
    }
    uint32_t slot = impid_update_slot(update);
    const impid_flash_t *flash = update->port->flash;
    update->bytes = 0u;
    /* The mark goes first: an erase cut short must not leave an old image that looks whole. */
    if (!program(update, slot, IMPID_SLOT_AT_MARK, 0u) || !flash->erase(flash->context, slot)) {
        return IMPID_UPDATE_FAILED;
    }
    update->bytes = bytes;
    update->next = 0u;
    return IMPID_UPDATE_OK;
}

impid_update_result_t impid_update_write(impid_update_t *update, uint8_t low, uint32_t word) {
    if (update->next > 0u && low == (uint8_t)(update->next - 1u) && word == update->last) {
        return IMPID_UPDATE_OK;
    }
    IMPID_ASSERT(update->bytes == 0u || 4u * update->next <= update->bytes);
    if (low != (uint8_t)update->next || 4u * update->next >= update->bytes) {
        return IMPID_UPDATE_BAD_ITEM;
    }
    if (!program(update, impid_update_slot(update), IMPID_SLOT_IMAGE + update->next, word)) {
        update->bytes = 0u; /* what is half written cannot be written again */
        return IMPID_UPDATE_FAILED;
    }
    update->last = word;
    update->next++;
    return IMPID_UPDATE_OK;
}

/* The second word of the vector table is where the image starts: within itself, if it was linked for this
 * slot. */
static bool linked_for(const impid_update_t *update, uint32_t slot) {
    uint32_t start = read((void *)(uintptr_t)update, slot, IMPID_SLOT_IMAGE + 1u);
    return start - (update->port->base[slot] + 4u * IMPID_SLOT_IMAGE) < update->bytes;
}

impid_update_result_t impid_update_finish(impid_update_t *update, uint32_t crc) {
    uint32_t slot = impid_update_slot(update);
    if (update->bytes == 0u || 4u * update->next != update->bytes) {
        return IMPID_UPDATE_BAD_ITEM;
    }
    if (impid_slots_crc(read, update, slot, update->next) != crc || !linked_for(update, slot)) {
        return IMPID_UPDATE_BAD_VALUE;
    }
    if (impid_slots_whole(read, update, slot)) {
        return IMPID_UPDATE_OK; /* asked again */
    }
    uint32_t sequence = read(update, update->port->running, IMPID_SLOT_AT_SEQUENCE) + 1u;
    bool written = program(update, slot, IMPID_SLOT_AT_BYTES, update->bytes) &&
                   program(update, slot, IMPID_SLOT_AT_CRC, crc) &&
                   program(update, slot, IMPID_SLOT_AT_SEQUENCE, sequence) &&
                   program(update, slot, IMPID_SLOT_AT_MARK, IMPID_SLOT_MARK);
    return written ? IMPID_UPDATE_OK : IMPID_UPDATE_FAILED;
}

bool impid_update_confirmed(const impid_update_t *update) {
    const impid_flash_t *flash = update->port->flash;
    return flash->read(flash->context, update->port->running, IMPID_SLOT_AT_CONFIRMED) !=
           IMPID_SLOT_UNWRITTEN;
}

impid_update_result_t impid_update_confirm(impid_update_t *update) {
    if (impid_update_confirmed(update)) {
        return IMPID_UPDATE_OK;
    }
    return program(update, update->port->running, IMPID_SLOT_AT_CONFIRMED, 0u) ? IMPID_UPDATE_OK
                                                                               : IMPID_UPDATE_FAILED;
}
