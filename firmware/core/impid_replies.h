/* The last answers given, so that a repeated request gets the same answer and no second action.
 *
 * Data flow: find() before a command is carried out, remember() after it. Ownership: the core's.
 * Timing: main loop; eight comparisons. Can fail: an answer older than eight commands or two seconds is
 * forgotten, so that a host that starts anew with the same numbers is not answered out of its predecessor's
 * session. A host has one command under way on a carrier and repeats it three times at most. Requests on
 * different carriers are different requests.
 */
#ifndef IMPID_REPLIES_H
#define IMPID_REPLIES_H

#include "impid_messages.h"
#include "impid_port.h"

#define IMPID_REPLIES           8u
#define IMPID_REPLY_LIFETIME_US 2000000u

typedef struct {
    struct impid_messages_command_t command;
    struct impid_messages_response_t response;
    uint64_t at_us;
    impid_carrier_t carrier;
    bool used;
} impid_reply_t;

typedef struct {
    impid_reply_t replies[IMPID_REPLIES];
    uint8_t next; /* the oldest, replaced next */
} impid_replies_t;

/* The answer given to this very request on this carrier, or NULL. */
const struct impid_messages_response_t *impid_replies_find(const impid_replies_t *replies,
                                                           impid_carrier_t carrier,
                                                           const struct impid_messages_command_t *command,
                                                           uint64_t now_us);
void impid_replies_remember(impid_replies_t *replies, impid_carrier_t carrier,
                            const struct impid_messages_command_t *command,
                            const struct impid_messages_response_t *response, uint64_t now_us);

#endif
