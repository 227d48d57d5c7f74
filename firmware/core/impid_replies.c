#include "impid_replies.h"

#include "impid_assert.h"

static bool same(const struct impid_messages_command_t *a, const struct impid_messages_command_t *b) {
    return a->request_id == b->request_id && a->opcode == b->opcode && a->item == b->item &&
           a->value == b->value;
}

const struct impid_messages_response_t *impid_replies_find(const impid_replies_t *replies,
                                                           impid_carrier_t carrier,
                                                           const struct impid_messages_command_t *command,
                                                           uint64_t now_us) {
    for (uint32_t i = 0; i < IMPID_REPLIES; i++) {
        const impid_reply_t *reply = &replies->replies[i];
        if (reply->used && reply->carrier == carrier && same(&reply->command, command) &&
            now_us - reply->at_us <= IMPID_REPLY_LIFETIME_US) {
            return &reply->response;
        }
    }
    return NULL;
}

void impid_replies_remember(impid_replies_t *replies, impid_carrier_t carrier,
                            const struct impid_messages_command_t *command,
                            const struct impid_messages_response_t *response, uint64_t now_us) {
    IMPID_ASSERT(replies->next < IMPID_REPLIES);
    replies->replies[replies->next] = (impid_reply_t){
        .command = *command, .response = *response, .at_us = now_us, .carrier = carrier, .used = true};
    replies->next = (uint8_t)((replies->next + 1u) % IMPID_REPLIES);
}
